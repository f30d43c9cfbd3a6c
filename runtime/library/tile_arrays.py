"""Tiles of the generated C: rows of `LANES` samples, at every instruction set."""

import math

import numpy as np
from numpy.typing import NDArray

LANES = 8


def padded_size(size: int) -> int:
    """The least multiple of `LANES` that holds `size`."""
    return -(-size // LANES) * LANES


def zeros(*shape: int) -> NDArray[np.float64]:
    """Zeros from a cache line on: a vector that lies across two lines is loaded as two."""
    size = math.prod(shape)
    room = np.zeros(size + LANES)
    first = -(room.ctypes.data // room.itemsize) % LANES
    return room[first : first + size].reshape(shape)


def padded(array: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """The array with zeros behind its last axis; `np.pad` takes longer than a MAP estimate."""
    whole = zeros(*array.shape[:-1], size)
    whole[..., : array.shape[-1]] = array
    return whole
