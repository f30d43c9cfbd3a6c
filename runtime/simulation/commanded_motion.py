"""Positions that a robot with a control law reaches from its commands alone.

    (M(q) + J) ddq + c(q, dq) + F_v dq + F_c sgn(dq) + F_o = u(t) − K q − D dq

u is the torque that the law commands at q = 0 and dq = 0, K and D are its stiffness and damping at
the joints. A step of length h finds the speed x at its end,

    A x + F_c sgn(x) ∋ b,   A = (M + J) / h + F_v + D + h K

by Gauss–Seidel with a shrinkage per joint. Dry friction holds a joint exactly, and a stiff law
needs no small step. Source: time stepping of Moreau and of Stewart and Trinkle.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import SimulationError
from runtime.library import Array, Library

LEAST_STEP = 0.004  # [s]: half of it moves servo arms by less than a count of 12 bits
FAR = 1e4  # position from which on a motion has diverged [rad, m]
SWEEPS = 30
DONE = 1e-9  # change of a speed at which the sweeps end [rad/s, m/s]


@dataclass(frozen=True, slots=True)
class ServoDrive:
    """Law and friction of the drives at the joints, (n,) each [SI]."""

    stiffness: Array  # K
    damping: Array  # D
    viscous: Array  # F_v
    dry: Array  # F_c
    offset: Array  # F_o
    armature: Array  # J


def commanded_motion(
    lib: Library,
    pi: Array,
    drive: ServoDrive,
    t: Array,
    command: Array,
    first: tuple[Array, Array],
    zero: Array,
) -> Array:
    """Positions (N, n) at t from u (N, n), and q and dq (n,) at first; links are at q + zero."""
    q, speed = first
    step = max(float(np.median(np.diff(t))), LEAST_STEP)
    steps = np.arange(t[0], t[-1] + step, step)
    torque = np.stack([np.interp(steps + step, t, each) for each in command.T], axis=1)
    torque -= drive.offset
    inertia = np.diag(drive.armature / step + drive.viscous + drive.damping)
    inertia += step * np.diag(drive.stiffness)
    path = np.empty_like(torque)
    for k, push in enumerate(torque):
        path[k] = q
        place = q + zero
        mass = lib.mass_matrix(place, pi) / step
        bias = lib.inverse_dynamics(place, speed, 0 * speed, pi) + lib.known_torque(place)
        b = mass @ speed + drive.armature / step * speed + push - bias - drive.stiffness * q
        speed = _held(mass + inertia, b, drive.dry, speed)
        q = q + step * speed
        if not np.abs(q).max() < FAR:
            raise SimulationError(
                f"the motion of the model diverged after {steps[k] - t[0]:.3g} s, as of bodies "
                "that cannot exist or of an unstable law; identify with the method map"
            )
    return np.stack([np.interp(t, steps, each) for each in path.T], axis=1)


def _held(A: Array, b: Array, dry: Array, x: Array) -> Array:
    """Solution of A x + F_c sgn(x) ∋ b, from a guess on."""
    x, size = x.copy(), np.diag(A)
    for _ in range(SWEEPS):
        before = x.copy()
        for j in range(len(x)):
            rest = b[j] - A[j] @ x + size[j] * x[j]
            x[j] = np.sign(rest) * max(abs(rest) - dry[j], 0.0) / size[j]
        if np.abs(x - before).max() < DONE:
            break
    return x
