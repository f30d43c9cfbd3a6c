"""EKF: state [q, dq, π, φ], one sample after the other, first-order covariance.

The derivatives of forward dynamics follow from the kernels of inverse dynamics,
∂ddq/∂x = −M⁻¹ ∂τ/∂x. Source: Gautier & Poignet 2001; the semi-implicit Jacobian is ours.
"""

import numpy as np

from runtime.baselines.ols import fit_of_pi
from runtime.baselines.stream import (
    FRICTION_DEVIATION,
    JITTER,
    SPEED_VARIANCE,
    Stream,
    prior_covariance,
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


def run_ekf(lib: Library, stream: Stream, lam: Array) -> tuple[Array, Array, int]:
    """State and covariance after the last sample, and how often a look found no bodies.

    Args:
        lib: of the robot.
        stream: samples.
        lam: λ of the first guess.

    Raises:
        IdentificationError: the state became infinite.
    """
    n, n_pi, k = lib.n_joints, lib.pi0.size, len(stream.names)
    at = slice(2 * n, None)
    x = np.concatenate([stream.q[0], stream.first_speed, lib.pi_from_lam(lam), np.zeros(n * k)])
    p = np.zeros((x.size, x.size))
    p[:n, :n] = np.diag(stream.sigma_q**2)
    p[n : 2 * n, n : 2 * n] = SPEED_VARIANCE * np.eye(n)
    p[2 * n : 2 * n + n_pi, 2 * n : 2 * n + n_pi] = prior_covariance(lib, lam)
    tail = np.arange(2 * n + n_pi, x.size)
    p[tail, tail] = FRICTION_DEVIATION**2
    noise, bad = np.diag(stream.sigma_q**2), 0
    top = np.zeros((2 * n, x.size))
    top[:n, :n] = np.eye(n)
    top[:n, n : 2 * n] = stream.dt * np.eye(n)
    for step, (q, tau) in enumerate(zip(stream.q, stream.tau, strict=True)):
        gain = np.linalg.solve(p[:n, :n] + noise, p[:n])
        x = x + gain.T @ (q - x[:n])
        p = p - gain.T @ p[:n]
        if step % _LOOK == 0:
            if not np.isfinite(x).all():
                break
            bad += bool((lib.relative_eigenvalues(x[at][:n_pi]) < 0).any())
        if step == len(stream.q) - 1:
            break
        x[: 2 * n], spread = _advance(lib, stream, x, tau, top)
        rows = top @ p
        p[: 2 * n, 2 * n :] = rows[:, 2 * n :]
        p[2 * n :, : 2 * n] = rows[:, 2 * n :].T
        p[: 2 * n, : 2 * n] = rows @ top.T
        p[n : 2 * n, n : 2 * n] += spread
        p = (p + p.T) / 2
    if not (np.isfinite(x).all() and np.isfinite(p).all()):
        raise IdentificationError(
            f"the filter diverged after {step * stream.dt:.2f} s; the first guess is too far from "
            "the robot, or the torque's unit, sign or friction is not what was said"
        )
    return x, p, bad


def _advance(lib: Library, stream: Stream, x: Array, tau: Array, top: Array) -> tuple[Array, Array]:
    """The next [q, dq] and its process noise; the rows of dq in the Jacobian `top` are renewed."""
    n, n_pi, dt = lib.n_joints, lib.pi0.size, stream.dt
    q, dq, pi, phi = np.split(x, [n, 2 * n, 2 * n + n_pi])
    columns, slopes = stream.friction(dq)
    phi = phi.reshape(n, -1)
    friction = np.einsum("jk,jk->j", columns, phi)
    slope = np.einsum("jk,jk->j", slopes, phi)
    force = tau - friction - lib.bias_forces(q, dq, pi)
    mass = lib.mass_matrix(q, pi)
    implicit = mass + dt * np.diag(np.maximum(slope, 0.0))
    ddq = np.linalg.solve(implicit, force)
    _, by_q, by_dq, _ = lib.torque_derivatives(q, dq, ddq, pi)
    k = columns.shape[1]
    right = np.empty((n, 3 * n + n_pi + n * k))
    right[:, :n] = -dt * by_q
    right[:, n : 2 * n] = mass - dt * by_dq - dt * np.diag(np.minimum(slope, 0.0))
    right[:, 2 * n : 2 * n + n_pi] = -dt * lib.regressor(q, dq, ddq)
    spread = np.zeros((n, n, k))
    spread[np.arange(n), np.arange(n)] = -dt * columns
    right[:, 2 * n + n_pi : -n] = spread.reshape(n, -1)
    right[:, -n:] = dt * np.diag(stream.sigma_tau)
    solved = np.linalg.solve(implicit, right)
    top[n:] = solved[:, :-n]
    noise = solved[:, -n:]
    return np.concatenate([q + dt * dq, dq + dt * ddq]), noise @ noise.T + JITTER * np.eye(n)
