"""Linearised model of links, friction, delay and encoder bias around one identified model.

    e = τ(t + δ) − Y(q + b, dq, ddq) π − F φ
    ∂e/∂d = s τ̇,   ∂e/∂b_j = −∂(Y π)/∂q_j,   δ = s d

The Newton step in (d, b) at the most probable (π, φ) and the covariance of all unknowns come from
the same information matrix,

    H = XᵀW X / S + κ ∇²D(π) + 1/σ_b²,

with X of all unknowns, S the density of the residual noise and D the entropic prior (Laplace's
approximation, MacKay 2003, Ch. 27). Columns of π are in units of its prior.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from runtime.estimators.convex import bodies_of
from runtime.estimators.regression.coloured_noise import coloured_noise_of_basis
from runtime.estimators.regression.factor import basis_of_joints, triangle_of_joints
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.estimators.regression.samples import Samples
from runtime.identification.identified import Identification
from runtime.library import Array, Library
from runtime.recording.preprocessing.segments import segments

ROUGH_ROWS = 600
"""Rows of the passes before the last: rows of a low-passed log are nearly redundant."""
MOST_ROWS, STRETCHES = 6000, 8
"""Rows above which only as many, in contiguous stretches, are used."""
_H = 1e-6
"""Step of the central difference in q [rad, m]: its error is 1e-12 relative, rounding 1e-10."""
_RANK = 1e-9
"""Singular value of unit columns, over the largest, below which a direction is undetermined."""
_INVOLVED = 1e-6
"""Share of a coefficient in an undetermined direction above which it has no standard deviation."""


@dataclass(frozen=True, slots=True)
class LinearisedDrive:
    """Newton step and standard deviations.

    Attributes:
        delay_step: step of d, (m,) [s].
        bias_step: step of b, (n,) [rad, m]; empty where b is not an unknown.
        delay_sigma: (m,) [s].
        bias_sigma: (n,) or empty [rad, m].
        phi_sigma: (n, k); NaN where a coefficient is not determined.
        phi_covariance: of the coefficients of every joint, (n, k, k).
    """

    delay_step: Array
    bias_step: Array
    delay_sigma: Array
    bias_sigma: Array
    phi_sigma: Array
    phi_covariance: Array


def bias_columns(lib: Library, samples: Samples, pi: Array) -> Array:
    """Columns ∂(Y π)/∂q of the encoder biases, by central differences of the exact model.

    pi (10 n,) → (N, n, n).
    """
    n = lib.n_joints
    columns = np.empty((len(samples), n, n))
    for j in range(n):
        step = np.zeros(n)
        step[j] = _H
        ahead = lib.inverse_dynamics(samples.q + step, samples.dq, samples.ddq, pi)
        behind = lib.inverse_dynamics(samples.q - step, samples.dq, samples.ddq, pi)
        columns[:, :, j] = (ahead - behind) / (2 * _H)
    return columns


def torque_rate(result: Identification, samples: Samples, per_joint: bool) -> Array:
    """∂e/∂d = s τ̂̇ at the rows of the training part.

    The predicted torque is differentiated: the noise of the logged one, differentiated, would count
    as information on the delay.

    Returns (N, n, 1) [N·m/s].
    """
    predicted = result.predict_samples(samples)
    t = result.train.t
    rate = np.zeros_like(predicted)
    for part in segments(t):
        if part.stop - part.start > 1:
            rate[part] = np.gradient(predicted[part], t[part], axis=0)
    rate *= sign_of_delay(result.train)
    if not per_joint:
        return rate[:, :, None]
    return rate[:, :, None] * np.eye(rate.shape[1])


def linearised(
    result: Identification,
    samples: Samples,
    *,
    kappa: float,
    delay_columns: Array,
    biases: Array,
    bias_prior: float,
    phi_prior: Array | None = None,
    rough: bool = False,
) -> LinearisedDrive:
    """Newton step of delay and biases, and the standard deviations of all unknowns.

    delay_columns (N, n, m), biases (n,) [rad, m], phi_prior (n, k).
    """
    lib, pi, phi = result.lib, result.pi, result.phi
    n, k, n_base = lib.n_joints, phi.shape[1], len(lib.base_matrix)
    scale = np.sqrt(result.weights)
    rest = (samples.tau - samples.rigid(lib, pi) - samples.friction(phi)) * scale
    further = -delay_columns
    if biases.size:
        further = np.concatenate([further, bias_columns(lib, samples, pi)], axis=2)
    further = further * scale[:, None]
    # The gradient in π and φ vanishes at the most probable model: d and b alone drive the step.
    pull = np.einsum("ijk,ij->k", further, rest)
    taken = _taken(len(samples), rough)
    part = samples.rows(taken)
    rows = np.concatenate([part.base_rows(lib), part.friction_rows()], axis=2) * scale[:, None]
    rows = np.concatenate([rows, further[taken]], axis=2)
    rest = rest[taken]
    # One orthogonal factorisation gives the information and the basis for the noise.
    triangle = triangle_of_joints(rows)
    slope = rows.reshape(-1, rows.shape[2]).T @ rest.ravel()
    noise = np.sqrt(max(_density(rows, triangle, slope, rest), np.finfo(float).tiny))
    # Rows that are left out between others lower S as much as N; stretches lower N alone.
    share = len(samples) / len(part)
    more, coarse = (1.0, share) if rough else (np.sqrt(share), 1.0)
    # Columns of π in units of the prior, (κ ∇²D)^(-1/2): there the prior is the identity.
    shrink = block_diag(*bodies_of(lib).spread(pi)) / np.sqrt(kappa)
    data = np.hstack([triangle[:, :n_base] @ (lib.base_matrix @ shrink), triangle[:, n_base:]])
    slope = np.concatenate([np.zeros(len(pi) + n * k), pull / (coarse * noise**2)])
    prior = np.zeros(data.shape[1])
    prior[: len(pi)] = 1.0
    if phi_prior is not None:
        prior[len(pi) : len(pi) + n * k] = 1.0 / phi_prior.ravel()
    if biases.size:
        prior[-n:] = 1.0 / bias_prior
        slope[-n:] -= biases / bias_prior**2
    rows_of_all = np.vstack([data * (more / noise), np.diag(prior)])
    lengths = np.linalg.norm(rows_of_all, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    _, sizes, turn = np.linalg.svd(np.linalg.qr(rows_of_all / lengths, mode="r"))
    present = sizes > _RANK * float(sizes.max(initial=1e-300))
    root = turn[present].T / sizes[present] / lengths[:, None]
    absent = np.abs(turn[~present]).max(axis=0, initial=0.0) > _INVOLVED
    sigma = np.where(absent, np.nan, np.linalg.norm(root, axis=1))
    step = root @ (root.T @ slope)
    first, m = len(pi) + n * k, delay_columns.shape[2]
    return LinearisedDrive(
        delay_step=step[first : first + m],
        bias_step=step[first + m :],
        delay_sigma=sigma[first : first + m],
        bias_sigma=sigma[first + m :],
        phi_sigma=sigma[len(pi) : first].reshape(n, k),
        phi_covariance=_blocks(root[len(pi) : first].reshape(n, k, -1)),
    )


def _blocks(root: Array) -> Array:
    """Covariance blocks (n, k, k) from rows of their root, (n, k, r)."""
    return np.asarray(root @ np.swapaxes(root, 1, 2))


def _density(rows: Array, triangle: Array, slope: Array, rest: Array) -> float:
    """S of the residual of the linearised model, from the basis Q = X R⁻¹ of its columns."""
    lengths = np.linalg.norm(triangle, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    _, sizes, turn = np.linalg.svd(triangle / lengths)
    present = sizes > _RANK * float(sizes.max(initial=1e-300))
    root = turn[present].T / sizes[present] / lengths[:, None]
    left = rest - rows @ (root @ (root.T @ slope))
    basis = basis_of_joints(rows, root)
    return coloured_noise_of_basis([(basis, left)], 1, root.shape[1]).density


def _taken(count: int, rough: bool) -> NDArray[np.int64]:
    """Evenly spread rows for a rough step, else all rows, or contiguous stretches of a long log."""
    if rough:
        return np.arange(0, count, max(1, count // ROUGH_ROWS))
    if count <= MOST_ROWS:
        return np.arange(count)
    length = MOST_ROWS // STRETCHES
    starts = np.linspace(0, count - length, STRETCHES).astype(int)
    return np.concatenate([np.arange(start, start + length) for start in starts])
