"""A table of numbers, in which each corrupt row is NaN and keeps the number of its line."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Columns = tuple[str | int, ...]
MAX_CORRUPT = 0.2
"""Largest share of corrupt rows of a log that is read."""
EXPANSION, SLACK = 200, 2**26
"""Decompression limit: a file may decode to at most EXPANSION · size + SLACK bytes."""


@dataclass(frozen=True, slots=True, eq=False)
class LogTable:
    """Rows of numbers and where they come from.

    Attributes:
        values: (N, m) numbers; a corrupt row is NaN.
        lines: (N,) line of the file, or index, of each row.
        remarks: sentences about the form of the file.
    """

    values: FloatArray
    lines: NDArray[np.int64]
    remarks: tuple[str, ...] = ()
