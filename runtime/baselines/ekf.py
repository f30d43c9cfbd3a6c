"""EKF: state [q, dq, π, φ], one sample after the other, first-order covariance.

The derivatives of forward dynamics follow from the kernels of inverse dynamics,
∂ddq/∂x = −M⁻¹ ∂τ/∂x. Source: Gautier & Poignet 2001; the semi-implicit Jacobian is ours.
"""

import numpy as np

from runtime.baselines.ols import fit_of_pi
from runtime.baselines.stream import (
    FIRST_FRICTION,
    SPEED_VARIANCE,
    Stream,
    prior_covariance,
    process_noise,
    stream_of,
)
from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.problem import Fit, Problem

_LOOK = 100
"""Steps between two looks at the consistency of π."""


def fit_ekf(problem: Problem) -> Fit:
    """π and φ after the last sample.

    Raises:
        IdentificationError: the recording suits no filter, or the filter diverged.
    """
    stream = stream_of(problem, "ekf")
    return _fit(problem, stream, *run_ekf(problem.lib, stream, problem.start))


def _fit(problem: Problem, stream: Stream, x: Array, covariance: Array, bad: int) -> Fit:
    lib = problem.lib
    n, n_pi = lib.n_joints, lib.pi0.size
    pi, phi = x[2 * n : 2 * n + n_pi], x[2 * n + n_pi :].reshape(n, -1)
    looks = 1 + (len(stream.q) - 1) // _LOOK
    base = lib.base_matrix @ covariance[2 * n : 2 * n + n_pi, 2 * n : 2 * n + n_pi]
    sigma = np.sqrt(np.einsum("ij,ij->i", base, lib.base_matrix).clip(0))
    notes = [
        f"noise taken from the recording: position {stream.sigma_q.max():.2g}, torque "
        f"{stream.sigma_tau.max():.2g} at most"
    ]
    if bad:
        notes.append(
            f"on its way the filter held links that cannot exist at {bad} of {looks} looks; "
            "nothing in it keeps them physical"
        )
    status = (
        f"filtered {len(stream.q)} samples; largest standard deviation of a base parameter "
        f"{sigma.max():.2g}"
    )
    return fit_of_pi(problem, pi, phi, status, len(stream.q), tuple(notes))


@np.errstate(over="ignore", invalid="ignore")  # told as a sentence at the end
def run_ekf(lib: Library, stream: Stream, lam: Array) -> tuple[Array, Array, int]:
    """State and covariance after the last sample, and how often a look found no bodies.

    Args:
        lib: of the robot.
        stream: samples.
        lam: λ of the first guess.

    Raises:
        IdentificationError: the state became infinite.
    """
    n, n_pi = lib.n_joints, lib.pi0.size
    at = slice(2 * n, None)
    x = np.concatenate(
        [stream.q[0], stream.first_speed, lib.pi_from_lam(lam), stream.first_friction]
    )
    p = np.zeros((x.size, x.size))
    p[:n, :n] = np.diag(stream.sigma_q**2)
    p[n : 2 * n, n : 2 * n] = SPEED_VARIANCE * np.eye(n)
    p[2 * n : 2 * n + n_pi, 2 * n : 2 * n + n_pi] = prior_covariance(lib, lam)
    tail = np.arange(2 * n + n_pi, x.size)
    p[tail, tail] = FIRST_FRICTION**2
    noise, bad = np.diag(stream.sigma_q**2), 0
    top = np.zeros((2 * n, x.size))
    for step, (q, tau) in enumerate(zip(stream.q, stream.tau, strict=True)):
        gain = np.linalg.solve(p[:n, :n] + noise, p[:n])
        x = x + gain.T @ (q - x[:n])
        p = p - gain.T @ p[:n]
        if not np.isfinite(x).all():
            break
        if step % _LOOK == 0:
            bad += bool((lib.relative_eigenvalues(x[at][:n_pi]) < 0).any())
        if step == len(stream.q) - 1:
            break
        x[: 2 * n], spread = _advance(lib, stream, x, tau, top)
        rows = top @ p
        p[: 2 * n, 2 * n :] = rows[:, 2 * n :]
        p[2 * n :, : 2 * n] = rows[:, 2 * n :].T
        p[: 2 * n, : 2 * n] = rows @ top.T
        p[: 2 * n, : 2 * n] += spread
        p = (p + p.T) / 2
    if not (np.isfinite(x).all() and np.isfinite(p).all()):
        raise IdentificationError(
            f"the filter diverged after {step * stream.dt:.2f} s; the first guess is too far from "
            "the robot, or the torque's unit, sign or friction is not what was said"
        )
    return x, p, bad


def _advance(lib: Library, stream: Stream, x: Array, tau: Array, top: Array) -> tuple[Array, Array]:
    """The next [q, dq] and its process noise; `top` receives its derivative by the state."""
    n, n_pi, dt = lib.n_joints, lib.pi0.size, stream.dt
    q, dq, pi, phi = np.split(x, [n, 2 * n, 2 * n + n_pi])
    secants, bends, constants = stream.friction(dq)
    phi = stream.passive(phi.reshape(n, -1))
    secant, bend, constant = (np.sum(part * phi, axis=1) for part in (secants, bends, constants))
    mass = lib.mass_matrix(q, pi)
    implicit = mass + dt * np.diag(secant)
    force = tau - secant * dq - constant - lib.bias_forces(q, dq, pi)
    ddq = np.linalg.solve(implicit, force)
    after = dq + dt * ddq
    _, by_q, by_dq, _ = lib.torque_derivatives(q, dq, ddq, pi)
    k = secants.shape[1]
    right = np.zeros((n, 3 * n + n_pi + n * k))
    right[:, :n] = -dt * by_q
    right[:, n : 2 * n] = mass - dt * by_dq - dt * np.diag(bend * after)
    right[:, 2 * n : 2 * n + n_pi] = -dt * lib.regressor(q, dq, ddq)
    columns = secants * after[:, None] + constants
    for j in range(n):
        right[j, 2 * n + n_pi + j * k : 2 * n + n_pi + (j + 1) * k] = -dt * columns[j]
    right[:, -n:] = dt * np.diag(stream.sigma_tau)
    solved = np.linalg.solve(implicit, right)
    top[n:] = solved[:, :-n]
    top[:n] = dt / 2 * top[n:]
    top[:n, : 2 * n] += np.concatenate([np.eye(n), dt / 2 * np.eye(n)], axis=1)
    moved = np.concatenate([q + dt / 2 * (dq + after), after])
    return moved, process_noise(np.asarray(solved[:, -n:], dtype=float), dt)
