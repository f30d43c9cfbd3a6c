"""Design of K poses at rest for gravity parameters, compared with random feasible poses.

A torque of noise σ_j is read once after each of two approaches; the mean of both has σ_j/√2. The
covariance of β_g is then (2 Σ_k Y_gᵀ diag(σ⁻²) Y_g)⁻¹.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.safety import Safety
from runtime.excitation.static.exchange import a_optimal
from runtime.excitation.static.feasible_poses import feasible_poses, pose_range
from runtime.excitation.static.gravity_regressor import gravity_columns, gravity_regressor
from runtime.library import Array, Library

CANDIDATES = 1000
"""Number of feasible poses among which the design chooses."""
RANDOM_SETS = 50
"""Number of random sets of as many poses, to which the design is compared."""
MOST_POSES = 500
"""Largest number of poses; a person or a servo arm needs hours for as many."""
VISITS = 2


@dataclass(frozen=True, slots=True)
class PoseDesign:
    """Poses at rest and their accuracy.

    Attributes:
        poses: (K, n) rad or m.
        approach: (n,) distance s from which every joint arrives, from below and from above.
        columns: indices of the gravity parameters among the base parameters.
        sigma: RMS standard deviation of the gravity parameters [kg·m].
        sigma_random: mean of the same over random sets.
        torque: RMS standard deviation of the gravity torque over feasible poses [N·m].
        torque_random: mean of the same over random sets.
        assumptions: sentences on limits that the robot does not state.
    """

    poses: Array
    approach: Array
    columns: tuple[int, ...]
    sigma: float
    sigma_random: float
    torque: float
    torque_random: float
    assumptions: tuple[str, ...]


def design_poses(
    lib: Library,
    count: int,
    safety: Safety,
    noise: Array,
    margin: float = 1.0,
    starts: int = 5,
    seed: int = 0,
) -> PoseDesign:
    """Choose poses for A-optimal gravity parameters."""
    if not 1 <= count <= MOST_POSES or starts < 1:
        raise IdentificationError(
            f"expected 1 to {MOST_POSES} poses and at least one start, got {count} and {starts}; "
            "12 poses are usual"
        )
    rng = np.random.default_rng(seed)
    where = pose_range(lib, margin)
    q = feasible_poses(lib, max(CANDIDATES, 2 * count), safety, where, rng)
    columns = gravity_columns(lib, q)
    y = gravity_regressor(lib, q, columns)
    scaled = np.sqrt(VISITS) * y / noise[:, None]
    grams = np.swapaxes(scaled, 1, 2) @ scaled
    least = -(-len(columns) // int(np.linalg.matrix_rank(grams).max()))
    if count < least:
        raise IdentificationError(
            f"expected at least {least} poses for the {len(columns)} gravity parameters of "
            f"'{lib.name}', got {count}; give --poses {2 * least} or more"
        )
    chosen, _ = a_optimal(grams, count, starts, rng)
    mean = (np.swapaxes(y, 1, 2) @ y).mean(axis=0) / lib.n_joints
    sigma, torque = _accuracy(grams[chosen].sum(axis=0), mean)
    sets = [rng.choice(len(q), count, replace=False) for _ in range(RANDOM_SETS)]
    of_sets = np.mean([_accuracy(grams[each].sum(axis=0), mean) for each in sets], axis=0)
    return PoseDesign(
        q[chosen],
        where.approach,
        tuple(columns.tolist()),
        sigma,
        float(of_sets[0]),
        torque,
        float(of_sets[1]),
        where.assumptions,
    )


def _accuracy(gram: Array, mean: Array) -> tuple[float, float]:
    """RMS σ of the parameters, and RMS σ of the torque at poses with mean YᵀY per joint."""
    covariance = np.linalg.pinv(gram, hermitian=True)
    if np.linalg.matrix_rank(gram, hermitian=True) < len(gram):
        return np.inf, np.inf
    parameters = float(np.sqrt(np.trace(covariance) / len(gram)))
    return parameters, float(np.sqrt(np.sum(mean * covariance)))
