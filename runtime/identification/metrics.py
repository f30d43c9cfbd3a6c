"""Measures of a result: torque errors, distances between mass matrices, consistency.

Source: document Eqs. 2.37, 2.39, 5.1–5.4 with the errata to 5.4 and Sec. 3.3.
"""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array, Library
from runtime.library.parameters import links, mass

CONSISTENCY_TOLERANCE = 1e-12  # a link is consistent when P_k ⪰ −1e-12 tr(P_k), to rounding


@dataclass(frozen=True, slots=True, eq=False)
class TorqueError:
    """Torque-prediction error of one model on one set of samples."""

    percent: Array  # 100 ‖τ_j − τ̂_j‖ / ‖τ_j‖ per joint (Eq. 5.1); NaN where τ_j is always 0
    overall: float  # the same over all joints together
    rms: Array  # root mean square of τ_j − τ̂_j per joint, N·m or N


def torque_error(measured: Array, predicted: Array) -> TorqueError:
    """Torque errors per joint and overall of a prediction, of torques (N, n) [N·m, N]."""
    difference = measured - predicted
    size, scale = np.linalg.norm(difference, axis=0), np.linalg.norm(measured, axis=0)
    return torque_error_of(size, scale, len(measured))


def torque_error_of(size: Array, scale: Array, count: int) -> TorqueError:
    """Torque error from norms per joint, (n,), of `count` residuals and of the measured torque."""
    percent = 100 * np.divide(size, scale, out=np.full(size.shape, np.nan), where=scale > 0)
    whole = float(np.linalg.norm(scale))
    overall = 100 * float(np.linalg.norm(size)) / whole if whole else np.nan
    return TorqueError(percent, overall, size / np.sqrt(count))


def is_consistent(lib: Library, pi: Array) -> bool:
    """Whether every link is physically consistent: P_k ⪰ 0 to rounding, and a mass above 0."""
    smallest = lib.relative_eigenvalues(pi).min()
    return bool(smallest >= -CONSISTENCY_TOLERANCE and (mass(links(pi)) > 0).all())


def airm(a: Array, b: Array) -> Array:
    """Affine-invariant distance d(A, B) = √Σ ln² λ_i(A⁻¹B), (...), of A, B ≻ 0 (Eq. 2.39)."""
    lower = np.linalg.cholesky(a)
    half = np.linalg.solve(lower, b)
    whole = np.linalg.solve(lower, np.swapaxes(half, -1, -2))
    eigenvalues = np.linalg.eigvalsh((whole + np.swapaxes(whole, -1, -2)) / 2)
    return np.sqrt(np.sum(np.log(eigenvalues) ** 2, axis=-1))


def frobenius(a: Array, b: Array) -> Array:
    """‖A − B‖_F, (...) (Eq. 2.37); over n it is the RMS per entry (errata to 5.4)."""
    return np.linalg.norm(a - b, axis=(-2, -1))
