"""Cross-validation of friction columns on the compressed blocks of a prepared log.

A candidate is a choice of the columns of the factors; its estimate is

    x_b = argmin ‖R x − r‖² + (N/N_eff) ‖L⁻¹ (β − β₀)‖²,   L Lᵀ = K Σ_π Kᵀ,  x = [β; φ]

over the blocks other than b, with the spread Σ_π of the inertial prior of `map` about the URDF.
Without it a slow log, one block of which moves as no other does, counts against every friction
model.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD, bodies_of, prior_of
from runtime.estimators.regression import Statistics, compress
from runtime.estimators.regression.residuals import inflation
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.estimators.robust import explicit, scaled, weights_of_rows
from runtime.inspection.candidate_columns import DEFAULT_COLUMNS
from runtime.inspection.column_solver import ColumnSolver, column_solver
from runtime.inspection.cross_validation import BLOCKS, solved
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Recording
from runtime.recording.friction import unresolved, without_columns

UNKNOWN = 1e3
"""Factor on the spread of the prior of robots whose URDF states no masses."""
ROWS = 4000
"""Rows that the choice uses, evenly spread."""
_PASSES = 2
"""Passes in which the noise of the joints is estimated from the residuals."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Factors of the blocks with all columns.

    Attributes:
        blocks: statistics of every block.
        others: statistics of all other blocks together, with the prior, for each block.
        joints: number n of joints.
    """

    blocks: tuple[Statistics, ...]
    others: tuple[ColumnSolver, ...]
    joints: int

    def scores(self, columns: tuple[int, ...]) -> Array:
        """Mean square error of every block, predicted by the others with some of the columns."""
        count = (self.blocks[0].factor.shape[1] - self.blocks[0].n_base) // self.joints
        left_out = np.tile(~np.isin(np.arange(count), columns), self.joints)
        return np.array([
            _error(block, rest, left_out) / (block.n_samples * self.joints)
            for block, rest in zip(self.blocks, self.others, strict=True)
        ])  # fmt: skip


def _error(block: Statistics, others: ColumnSolver, left_out: NDArray[np.bool_]) -> float:
    """Weighted sum of squared residuals on a block of the estimate from the others."""
    rest = block.factor @ others.solution(left_out) - block.target
    return float(rest @ rest + block.rest)


def trial_on(done: Recording, lib: Library, robust: bool) -> Trial:
    """Compressed blocks of a prepared recording, weighted by the noise of the joints."""
    if done.columns is not None and done.tau is not None:
        done = without_columns(done, unresolved(done.columns, done.tau))
    whole = samples_of(done, lib)
    taken = np.arange(0, len(whole), max(1, len(whole) // ROWS))
    cuts = [cut for cut in np.array_split(taken, BLOCKS) if cut.size]
    blocks = [whole.rows(cut) for cut in cuts]
    equations = sum(map(len, blocks[:-1])) * lib.n_joints
    unknowns = len(lib.base_columns) + lib.n_joints * len(DEFAULT_COLUMNS)
    if len(blocks) < BLOCKS or equations < 2 * unknowns:
        raise IdentificationError(
            f"{len(whole)} training rows are too few to choose a model; name one with --friction"
        )
    if robust:
        rows = explicit(lib, whole)
        whole = scaled(rows, weights_of_rows(lib, rows).weights)
        blocks = [whole.rows(cut) for cut in cuts]
    weights = thesis_weights(whole.tau)
    for _ in range(_PASSES):
        stats = [compress(lib, block, weights) for block in blocks]
        x, _rank = solved([stats[0].merged(*stats[1:])])
        rests = _residuals(lib, blocks, x)
        variance = np.mean(np.concatenate(rests) ** 2, axis=0)
        weights = 1.0 / np.maximum(variance, 1e-12 * variance.max() + 1e-30)
    stats = [compress(lib, block, weights) for block in blocks]
    prior = _prior(lib, stats[0], inflation(np.concatenate(rests), weights))
    others = [
        column_solver(rest[0].merged(*rest[1:], prior))
        for k in range(len(stats))
        if (rest := [s for i, s in enumerate(stats) if i != k])
    ]
    return Trial(tuple(stats), tuple(others), lib.n_joints)


def _prior(lib: Library, like: Statistics, samples_per_independent: float) -> Statistics:
    """Rows √(N/N_eff) L⁻¹ (β − β₀) of the inertial prior, of no sample."""
    matrix, pi = lib.base_matrix, lib.pi0
    spread = bodies_of(lib).spread(prior_of(lib, pi).centre) / np.sqrt(CAD)
    links = matrix.reshape(len(matrix), -1, N_PARAMETERS)
    root = np.einsum("bki,kij->bkj", links, spread).reshape(matrix.shape)
    covariance = root @ root.T * (UNKNOWN**2 if lib.placeholders else 1.0)
    values, vectors = np.linalg.eigh(covariance)
    scale = np.sqrt(samples_per_independent / np.maximum(values, 1e-12 * values[-1]))
    rows = scale[:, None] * vectors.T
    whole = np.zeros_like(like.factor)
    target = np.zeros_like(like.target)
    whole[: len(rows), : len(rows)] = rows
    target[: len(rows)] = rows @ (matrix @ pi)
    return replace(like, factor=whole, target=target, rest=0.0, n_samples=0.0)


def _residuals(lib: Library, blocks: list[Samples], x: Array) -> list[Array]:
    """Residuals of [β; φ] on every block."""
    beta, phi = x[: len(lib.base_columns)], x[len(lib.base_columns) :].reshape(lib.n_joints, -1)
    return [b.tau - b.base_rigid(lib, beta) - b.friction(phi) for b in blocks]
