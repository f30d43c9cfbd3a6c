"""UKF: state [q, dq, β, φ], one sample after the other, covariance from sigma points.

2 L + 1 points x ± √(α² L) columns of the Cholesky factor of P, α = 0.1, β = 2, κ = 0. Base
parameters, because a direction that the data never see would only make the points wander.
Source: Julier & Uhlmann 1997; van der Merwe 2004 for the weights.
"""

import numpy as np

from runtime.baselines.ols import fit_of_base
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

ALPHA, BETA = 0.1, 2.0
_LOOK = 100
_RIDGE = 1e-12
"""Relative addition to the covariance where rounding makes it indefinite."""


def fit_ukf(problem: Problem) -> Fit:
    """β and φ after the last sample.

    Raises:
        IdentificationError: the recording suits no filter, or the filter diverged.
    """
    lib, stream = problem.lib, stream_of(problem, "ukf")
    n, n_b = lib.n_joints, len(lib.base_columns)
    x, covariance = run_ukf(lib, stream, problem.start)
    sigma = np.sqrt(np.diag(covariance)[2 * n : 2 * n + n_b])
    status = (
        f"filtered {len(stream.q)} samples; largest standard deviation of a base parameter "
        f"{sigma.max():.2g}"
    )
    beta, phi = x[2 * n : 2 * n + n_b], x[2 * n + n_b :].reshape(n, -1)
    return fit_of_base(problem, beta, phi, status, len(stream.q))


def run_ukf(lib: Library, stream: Stream, lam: Array) -> tuple[Array, Array]:
    """State and covariance after the last sample.

    Raises:
        IdentificationError: the state became infinite.
    """
    n, n_b, k = lib.n_joints, len(lib.base_columns), len(stream.names)
    beta = lib.base_matrix @ lib.pi_from_lam(lam)
    x = np.concatenate([stream.q[0], stream.first_speed, beta, np.zeros(n * k)])
    p = np.zeros((x.size, x.size))
    p[:n, :n] = np.diag(stream.sigma_q**2)
    p[n : 2 * n, n : 2 * n] = SPEED_VARIANCE * np.eye(n)
    inside = slice(2 * n, 2 * n + n_b)
    p[inside, inside] = lib.base_matrix @ prior_covariance(lib, lam) @ lib.base_matrix.T
    tail = np.arange(2 * n + n_b, x.size)
    p[tail, tail] = FRICTION_DEVIATION**2
    noise = np.diag(stream.sigma_q**2)
    scale = ALPHA**2 * x.size
    weights = np.full(2 * x.size + 1, 1 / (2 * scale))
    weights[0] = 1 - x.size / scale
    about = weights.copy()
    about[0] += 1 - ALPHA**2 + BETA
    for step, (q, tau) in enumerate(zip(stream.q, stream.tau, strict=True)):
        gain = np.linalg.solve(p[:n, :n] + noise, p[:n])
        x = x + gain.T @ (q - x[:n])
        p = p - gain.T @ p[:n]
        if step == len(stream.q) - 1 or (step % _LOOK == 0 and not np.isfinite(x).all()):
            break
        root = np.sqrt(scale) * _root(p)
        points = np.concatenate([x[None], x + root.T, x - root.T])
        middle = _advance(lib, stream, x[None], tau)[1][0]
        points[:, : 2 * n], _ = _advance(lib, stream, points, tau)
        # Differences to the image of the mean: the large negative weight of the centre then
        # multiplies zero, and nothing cancels.
        offsets = points - points[0]
        shift = weights @ offsets
        x = points[0] + shift
        centred = offsets - shift
        p = (centred * about[:, None]).T @ centred
        p[n : 2 * n, n : 2 * n] += middle @ middle.T + JITTER * np.eye(n)
    if not (np.isfinite(x).all() and np.isfinite(p).all()):
        raise IdentificationError(
            f"the filter diverged after {step * stream.dt:.2f} s; the first guess is too far from "
            "the robot, or the torque's unit, sign or friction is not what was said"
        )
    return x, p


def _root(p: Array) -> Array:
    """Lower Cholesky factor of P."""
    p = (p + p.T) / 2
    try:
        return np.asarray(np.linalg.cholesky(p), dtype=float)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(p)
        raised = np.maximum(values, _RIDGE * values[-1])
        return np.asarray(vectors * np.sqrt(raised))


def _advance(lib: Library, stream: Stream, points: Array, tau: Array) -> tuple[Array, Array]:
    """[q, dq] of all points after a step, and dt (M + dt D)⁻¹ σ_τ of the first one."""
    n, n_b, dt = lib.n_joints, len(lib.base_columns), stream.dt
    q, dq, beta, phi = np.split(points, [n, 2 * n, 2 * n + n_b], axis=1)
    columns, slopes = stream.friction(dq)
    phi = phi.reshape(len(points), n, -1)
    friction = np.einsum("ijk,ijk->ij", columns, phi)
    damping = dt * np.maximum(np.einsum("ijk,ijk->ij", slopes, phi), 0.0)
    pi = np.zeros((len(points), lib.pi0.size))
    pi[:, lib.base_columns] = beta
    ddq = lib.forward_dynamics(q, dq, tau - friction, pi, damping)
    inverse = np.linalg.inv(lib.mass_matrix(q[:1], pi[:1]) + np.diag(damping[0]))
    moved = np.concatenate([q + dt * dq, dq + dt * ddq], axis=1)
    return moved, dt * inverse * stream.sigma_tau
