"""Known model of the arm, from the URDF or a result of identify, and its error in a payload.

    δπ_load = −C Σ Y_kᵀ W Y δπ_arm,   δπ_arm ~ N(0, s² R Rᵀ),   C = (Σ Y_kᵀ W Y_k)⁻¹

with the offsets taken out of both Y. R Rᵀ is the spread of the inertial prior, 25 % of every
direction, and s ≤ 1 is the scale of it that the residual supports: an arm that fits to a percent is
not 25 % off. Against an empty run of the same motion the errors of the arm cancel.
The gains of the torque sensors are a fixed error too:

    τ_measured,j = (1 + g_j) τ_j,   g_j ~ N(0, s²)
    cov π = s² Σ_j v_j v_jᵀ,   v_j = C Σ Y_kjᵀ τ_j / σ_j²,   C = (Σ Y_kᵀ W Y_k)⁻¹

with the offsets taken out of Y and τ. Against an empty run the gains act on the difference of both
torques, which is that of the payload. A wrong gain does not average out in a longer log.
Source: linear propagation of fixed parameters; the scale by the method of moments is ours.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_of
from runtime.identification.saved_result import read_result, require_model
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Friction, Recording

_BLOCK = 4096
_RANK = 1e-10
"""Eigenvalue relative to the largest below which an error of the arm has no effect on torques."""
_FEW = 2.0
"""Factor on s² for the few directions, about twenty, that dominate its estimate."""


@dataclass(frozen=True, slots=True)
class ArmModel:
    """Parameters and friction of the arm, fixed while the payload is identified."""

    pi: Array  # standard parameters, (10 n,)
    friction: Friction  # friction columns and widths
    phi: Array  # friction coefficients, (n, k)
    origin: str  # source of the model, for the report
    # no error of the model enters the intervals of a payload; for simulated arms
    is_exact: bool = False


def arm_model(lib: Library) -> ArmModel:
    """The URDF's parameters without friction."""
    return ArmModel(lib.pi0, Friction(()), np.zeros((lib.n_joints, 0)), "the URDF, no friction")


def read_arm_model(path: Path, lib: Library) -> ArmModel:
    """Read the arm from a result of identify."""
    saved = read_result(path)
    notes = require_model(saved.record, lib, path)
    origin = "; ".join((f"identified, '{path}'", *notes))
    return ArmModel(saved.pi, saved.friction, saved.phi, origin)


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


def gain_covariance(
    columns: Array, torque: Array, noise: Array, shape: Array, gain_error: float
) -> Array:
    """Covariance of a payload's π by independent errors of the joints' torque gains.

    columns (N, n, 10), torque (N, n) [N·m, N], noise (n,) [N·m, N], shape (10, 10) → (10, 10).
    """
    rows = (columns - columns.mean(axis=0)) / noise[:, None]
    varying = (torque - torque.mean(axis=0)) / noise
    slopes = np.einsum("ijk,ij->jk", rows, varying) @ shape  # v_j, one row per joint
    return np.asarray(gain_error**2 * slopes.T @ slopes)
