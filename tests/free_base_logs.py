"""Logs of virtual robots with a free base, computed by Pinocchio: motion, torques, wrenches."""

from dataclasses import dataclass

import numpy as np
import pinocchio
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class VirtualLog:
    """Arrays of the NPZ, and the masses and π (Pinocchio's order) of the simulated bodies."""

    arrays: dict[str, Array]
    pi: Array


def virtual_log(
    urdf: str,
    feet: tuple[str, ...],
    seed: int,
    *,
    count: int = 600,
    rate_hz: float = 100.0,
    changed: float = 0.1,
    noise: float = 0.0,
) -> VirtualLog:
    """A log of a robot whose bodies differ from those of the URDF.

    Base and joints follow sums of sines. The wrenches of all feet but the first are sines; that of
    the first satisfies the six equations of the base.

    Args:
        urdf: text of the URDF.
        feet: names of links in contact.
        seed: of motion, bodies and noise.
        count: number of instants.
        rate_hz: of the log [Hz].
        changed: entries of G in P' = (1 + G) P (1 + G)ᵀ of every body's pseudo-inertia.
        noise: standard deviation of torques and wrenches over their RMS.

    Returns:
        The log, whose motion is exact.
    """
    rng = np.random.default_rng(seed)
    model = pinocchio.buildModelFromXML(urdf, pinocchio.JointModelFreeFlyer())
    for i in range(1, model.njoints):
        pseudo = model.inertias[i].toPseudoInertia().toMatrix()
        turn = np.eye(4) + changed * rng.normal(size=(4, 4)) * _LENGTHS
        model.inertias[i] = pinocchio.Inertia.FromPseudoInertia(
            pinocchio.PseudoInertia.FromMatrix(turn @ pseudo @ turn.T)
        )
    data, t, n = model.createData(), np.arange(count) / rate_hz, model.nv - 6
    # Three sines per coordinate: position 5 cm, rotation vector 0.3 rad, joints 0.4 rad.
    size = np.concatenate([np.full(3, 0.05), np.full(3, 0.3), np.full(n, 0.4)])
    speed = rng.uniform(1.5, 9.0, (3, 6 + n))
    phase = rng.uniform(0, 2 * np.pi, (3, 6 + n))
    scale = size / np.sqrt(3) * np.ones((3, 1))

    def course(at: Array, order: int) -> Array:
        angle = at[:, None, None] * speed + phase
        wave = (np.sin(angle), np.cos(angle), -np.sin(angle))[order]
        return np.asarray((scale * speed**order * wave).sum(axis=1))

    def omega(at: Array) -> Array:
        x, dx = course(at, 0)[:, 3:6], course(at, 1)[:, 3:6]
        return np.array([pinocchio.Jexp3(w) @ dw for w, dw in zip(x, dx, strict=True)])

    x, dx, ddx = (course(t, order) for order in range(3))
    step = 1e-4  # central difference: error of step² and of rounding over step, both 1e-8
    alpha = (omega(t + step) - omega(t - step)) / (2 * step)
    turns = [pinocchio.exp3(w) for w in x[:, 3:6]]
    w = omega(t)
    v = np.array([r.T @ u for r, u in zip(turns, dx[:, :3], strict=True)])
    dv = np.array([r.T @ u for r, u in zip(turns, ddx[:, :3], strict=True)]) - np.cross(w, v)
    pose = np.array(
        [
            np.concatenate([p, pinocchio.Quaternion(r).coeffs()])
            for p, r in zip(x[:, :3], turns, strict=True)
        ]
    )
    wrench = _wrenches(rng, t, len(feet))
    tau = np.empty((count, n))
    ids = [model.getFrameId(foot, pinocchio.BODY) for foot in feet]
    for k in range(count):
        state = np.concatenate([pose[k], x[k, 6:]])
        rates = np.concatenate([v[k], w[k], dx[k, 6:]])
        whole = pinocchio.rnea(
            model, data, state, rates, np.concatenate([dv[k], alpha[k], ddx[k, 6:]])
        ).copy()
        pinocchio.computeJointJacobians(model, data, state)
        pinocchio.updateFramePlacements(model, data)
        jacobians = [
            pinocchio.getFrameJacobian(model, data, i, pinocchio.LOCAL).copy() for i in ids
        ]
        for j, force in zip(jacobians[1:], wrench[k, 1:], strict=True):
            whole -= j.T @ force
        wrench[k, 0] = np.linalg.solve(jacobians[0][:, :6].T, whole[:6])
        tau[k] = (whole - jacobians[0].T @ wrench[k, 0])[6:]
    arrays = {
        "t": t,
        "q": x[:, 6:],
        "dq": dx[:, 6:],
        "ddq": ddx[:, 6:],
        "tau": tau + noise * np.sqrt(np.mean(tau**2)) * rng.normal(size=tau.shape),
        "joints": np.array(list(model.names[2:])),
        "base_pose": pose,
        "base_twist": np.hstack([v, w]),
        "base_acceleration": np.hstack([dv, alpha]),
        "contact_links": np.array(feet),
        "contact_wrench": wrench
        + noise * np.sqrt(np.mean(wrench**2, axis=(0, 1))) * rng.normal(size=wrench.shape),
    }
    pi = np.concatenate([body.toDynamicParameters() for body in model.inertias[1:]])
    return VirtualLog(arrays, pi)


_LENGTHS = np.array([[1, 1, 1, 0.1], [1, 1, 1, 0.1], [1, 1, 1, 0.1], [0.1, 0.1, 0.1, 1]])
"""Entries of G: m beside the first moments, 1/m beside the mass, as of a decimetre."""


def _wrenches(rng: np.random.Generator, t: Array, feet: int) -> Array:
    """Sines of 20 N and 2 N·m."""
    speed, phase = rng.uniform(1, 8, (feet, 6)), rng.uniform(0, 2 * np.pi, (feet, 6))
    size = np.repeat([20.0, 2.0], 3)
    return size * np.sin(t[:, None, None] * speed + phase)
