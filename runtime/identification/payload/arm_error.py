"""Error of the arm's model in the covariance of a payload.

    δπ_load = −C Σ Y_kᵀ W Y δπ_arm,   δπ_arm ~ N(0, s² R Rᵀ),   C = (Σ Y_kᵀ W Y_k)⁻¹

with the offsets taken out of both Y. R Rᵀ is the spread of the inertial prior, 25 % of every
direction, and s ≤ 1 is the scale of it that the residual supports: an arm that fits to a percent is
not 25 % off. Against an empty run of the same motion the errors of the arm cancel.
Source: linear propagation of fixed parameters; the scale by the method of moments is ours.
"""

import numpy as np

from runtime.estimators.convex import CAD, bodies_of, prior_of
from runtime.identification.payload.reading import ArmModel
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Recording

_BLOCK = 4096
_RANK = 1e-10
"""Eigenvalue relative to the largest below which an error of the arm has no effect on torques."""
_FEW = 2.0
"""Factor on s² for the few directions, about twenty, that dominate its estimate."""


def arm_covariance(
    lib: Library, model: ArmModel, run: Recording, columns: Array, noise: Array, errors: Array,
    payload: Array,
) -> Array:  # fmt: skip
    """Covariance of a payload's π that comes from the arm's model.

    columns (N, n, 10), noise (n,) [N·m, N], errors (N, n) [N·m, N], payload (10, 10) → (10, 10).
    """
    # R of the arm: block-diagonal root of the prior's spread at its parameters.
    spread = bodies_of(lib).spread(prior_of(lib, model.pi).centre) / np.sqrt(CAD)
    motion = (run.q, run.required("dq"), run.required("ddq"))
    rows = (columns - columns.mean(axis=0)) / noise[:, None]
    width = lib.n_links * N_PARAMETERS
    mean, cross = np.zeros((len(noise), width)), np.zeros((N_PARAMETERS, width))
    gram, slope = np.zeros((width, width)), np.zeros(width)
    for i in range(0, len(run), _BLOCK):
        part = slice(i, i + _BLOCK)
        y = lib.regressor(*(each[part] for each in motion)) / noise[:, None]
        links = y.reshape(*y.shape[:2], lib.n_links, N_PARAMETERS)
        arm = np.einsum("ijkl,klm->ijkm", links, spread).reshape(y.shape)
        flat = arm.reshape(-1, width)
        cross += rows[part].reshape(-1, N_PARAMETERS).T @ flat
        gram += flat.T @ flat
        slope += (errors[part] / noise).ravel() @ flat
        mean += arm.sum(axis=0)
    # The offsets take the means; the payload takes what its columns explain of the rest.
    gain = payload @ cross
    arm_rows = rows.reshape(-1, N_PARAMETERS)
    taken = np.linalg.pinv(arm_rows.T @ arm_rows, rcond=_RANK, hermitian=True) @ cross
    left = gram - mean.T @ mean / len(run) - cross.T @ taken
    # Energy of the residual in the span of the arm's columns, over that of the whole prior: noise
    # enters it by a few dozen of N n equations only.
    energy = float(slope @ np.linalg.pinv(left, rcond=_RANK, hermitian=True) @ slope)
    scale = min(1.0, _FEW * energy / max(float(np.trace(left)), 1e-300))
    return np.asarray(scale * gain @ gain.T)
