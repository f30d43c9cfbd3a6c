"""Cross-validation on contiguous blocks, shared by the choices of cut-off and friction model.

Each block b is compressed to a triangular factor. An estimate x_b from the factors of all other
blocks predicts block b. Contiguous blocks keep the correlation of neighbouring rows within a block.
"""

import numpy as np

from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

BLOCKS = 5
LEAST_GAIN = 0.005
"""Share of the mean square error that a candidate must save to count as better than another."""
_RANK = 1e-9


def solved(stats: list[Statistics]) -> tuple[Array, int]:
    """Least squares on several factors with normalised columns: x of least length, and the rank."""
    factor = np.concatenate([s.factor for s in stats])
    target = np.concatenate([s.target for s in stats])
    lengths = np.linalg.norm(factor, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    x, _, rank, _ = np.linalg.lstsq(factor / lengths, target, rcond=_RANK)
    return x / lengths, int(rank)


def predicted(lib: Library, block: Samples, x: Array) -> Array:
    """Torque of x = [β; φ] on the rows of a block, (N, n) [N·m, N]."""
    n_base = len(lib.base_columns)
    rigid = block.base_rigid(lib, x[:n_base])
    phi = x[n_base:].reshape(block.columns.shape[1:])
    return np.asarray(rigid + block.friction(phi) if phi.size else rigid)


def misfit(block: Statistics, x: Array) -> float:
    """Weighted sum of squared residuals of x on one block."""
    rest = block.factor @ x - block.target
    return float(rest @ rest + block.rest)
