"""Tiles of the generated C: rows of `LANES` samples, at every instruction set."""

import numpy as np
from numpy.typing import NDArray

LANES = 8


def padded_size(size: int) -> int:
    """The least multiple of `LANES` that holds `size`."""
    return -(-size // LANES) * LANES


def padded(array: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """The array with zeros behind its last axis; `np.pad` costs more than a MAP."""
    whole = np.zeros((*array.shape[:-1], size))
    whole[..., : array.shape[-1]] = array
    return whole
