"""Discrete cosine transform (type II), `scipy.fft.dct`."""

import numpy as np

from runtime.numerics import Array
from runtime.numerics.extension import extension

_compiled = extension("scipy.fft._pocketfft.pypocketfft", ("dct",))


def cosines(values: Array) -> Array:
    """Orthonormal cosine transform along the first axis."""
    if _compiled is None:
        from scipy.fft import dct

        return np.asarray(dct(values, axis=0, norm="ortho"))
    contiguous = np.ascontiguousarray(values, dtype=np.float64)
    return np.asarray(_compiled.dct(contiguous, 2, (0,), 1, None, 1))


def is_fast_length(count: int) -> bool:
    """Whether a length has no prime factors but 2, 3 and 5, for which a transform is fast."""
    for factor in (2, 3, 5):
        while count % factor == 0:
            count //= factor
    return count == 1
