"""Nonnegative least squares: min |A u − b| over u ≥ 0 (Lawson and Hanson 1974, ch. 23)."""

from importlib import import_module

import numpy as np

from runtime.numerics import Array
from runtime.numerics.extension import extension

_compiled = extension("scipy.optimize._slsqplib", ("nnls",))


def nonnegative_least_squares(matrix: Array, right: Array) -> Array | None:
    """Solve min |A u − b| over u ≥ 0, by active sets.

    matrix (m, n), right (m,) → (n,).
    """
    if _compiled is None:
        try:
            return np.asarray(import_module("scipy.optimize").nnls(matrix, right)[0])
        except RuntimeError:
            return None
    solution, _, status = _compiled.nnls(np.ascontiguousarray(matrix), right, 3 * matrix.shape[1])
    return None if status == 3 else np.asarray(solution)
