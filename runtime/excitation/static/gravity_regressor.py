"""Gravity regressor of base parameters: g(q) = Y_g(q) β_g with Y_g(q) = Y_b(q, 0, 0) columns.

β_g are those base parameters whose columns are independent at rest. They are chosen by QR with
column pivoting over random poses. A pivot that rounding alone explains ends the choice: the columns
of exact functions of q are either independent by far or not at all.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from runtime.errors import IdentificationError
from runtime.library import Array, Library

ROUNDING = 1e-10
"""Pivot, over the largest, that counts as zero: 1e-16 of rounding times a condition of 1e6."""


def gravity_columns(lib: Library, q: Array) -> NDArray[np.intp]:
    """Indices of the base parameters that gravity determines.

    q (N, n) → (r,).
    """
    rest = np.zeros_like(q)
    stacked = lib.base_regressor(q, rest, rest).reshape(q.size, -1)
    triangle, pivots = qr(stacked, mode="economic", pivoting=True)[1:]
    size = np.abs(np.diag(triangle))
    if not size.size or size[0] < ROUNDING:
        raise IdentificationError(
            f"gravity causes no torque on any joint of '{lib.name}', so poses at rest determine no "
            "parameter; design a motion instead: python -m runtime excite without --static"
        )
    rank = int((size > ROUNDING * size[0]).sum())
    return np.sort(pivots[:rank])


def gravity_regressor(lib: Library, q: Array, columns: NDArray[np.intp]) -> Array:
    """Regressor Y_g of the torques at rest.

    q (N, n), columns (r,) → (N, n, r) [N·m per unit of the parameters].
    """
    rest = np.zeros_like(q)
    return lib.base_regressor(q, rest, rest)[..., columns]
