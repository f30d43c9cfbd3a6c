"""Sparse matrices for Clarabel, and the BLAS that it takes from SciPy.

Clarabel reads the attributes of a matrix by name, and imports `scipy.linalg.cython_blas` and
`cython_lapack` when it solves a program with semidefinite cones.
"""

from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import NDArray

from runtime.numerics import Array
from runtime.numerics.extension import extension

for _name in ("cython_blas", "cython_lapack"):
    extension(f"scipy.linalg.{_name}", ("__pyx_capi__",))


class Columns(NamedTuple):
    """Matrix in compressed columns.

    Attributes:
        data: entries other than zero, column by column.
        indices: their rows.
        indptr: place of the first entry of every column, and the number of entries.
        shape: rows and columns.
        has_canonical_format: rows ascend within every column, which Clarabel requires.
    """

    data: Array
    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]
    shape: tuple[int, int]
    has_canonical_format: bool = True


def columns_of(matrix: Array, stored: NDArray[np.bool_] | None = None) -> Columns:
    """Compressed columns of a dense matrix."""
    across = np.ascontiguousarray(matrix.T)
    column, row = np.nonzero(across if stored is None else stored.T)
    starts = np.searchsorted(column, np.arange(len(across) + 1))
    rows, columns = matrix.shape
    return Columns(
        across[column, row], row.astype(np.int32), starts.astype(np.int32), (rows, columns)
    )


def solve_conic(
    cost: Array,
    matrix: Array,
    limits: Array,
    cones: list[object],
    settings: object,
    stored: NDArray[np.bool_] | None = None,
) -> clarabel.DefaultSolution:
    """Minimise cᵀ x so that b − A x ∈ K, by Clarabel."""
    nothing = columns_of(np.zeros((cost.size, cost.size)))
    a = columns_of(matrix, stored)
    return clarabel.DefaultSolver(nothing, cost, a, limits, cones, settings).solve()
