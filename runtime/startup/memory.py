"""Memory of arrays that are freed, kept for the next ones.

The C library of Linux gives each array of more than 128 kB memory of its own and returns it when
the array is freed; that size grows, up to 32 MB, only when larger arrays are freed. The kernel
fills the memory of each new array with zeros, page by page, which took 4 % of the processor
time of `identify`.
"""

import ctypes
from contextlib import suppress

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # names of malloc.h without M_
KEPT = 2**26
"""Free memory at the end of the heap above which it is returned [bytes]; twice `SINGLE`, as the C
library has it in the end."""
SINGLE = 2**25
"""Size from which an array has memory of its own [bytes]: the largest that the C library takes."""


def keep_memory() -> None:
    """Set both limits for this process; another C library than glibc keeps its own."""
    with suppress(AttributeError, OSError, TypeError):  # no mallopt, no handle of the program
        library = ctypes.CDLL(None)
        library.mallopt(_MMAP_THRESHOLD, SINGLE)
        library.mallopt(_TRIM_THRESHOLD, KEPT)
