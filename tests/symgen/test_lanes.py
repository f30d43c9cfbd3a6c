"""Functions of lanes.h that no kernel shows by itself, on every level that runs here."""

import ctypes
from pathlib import Path

import numpy as np
import pytest

from runtime.library import Library
from tests.robots import levels_here
from tests.symgen.builds import with_headers

DRIVER = """
#include "lanes.h"
#define JOIN(level) quotients_##level
#define NAME(level) JOIN(level)
void NAME(LEVEL)(long n, const double *a, const double *b, double *out);
void NAME(LEVEL)(long n, const double *a, const double *b, double *out)
{
    for (long i = 0; i < n; i += W) {
        *(vu *)(out + i) = vd_quotient(*(const vu *)(a + i), *(const vu *)(b + i));
    }
}
"""


@pytest.mark.parametrize("header", ["lanes.h", "sines.h", "eigen.h", "fold.h"])
def test_headers_stand_alone(tmp_path: Path, header: str) -> None:
    """Property: a header includes whatever it uses, whichever file includes it first."""
    needed = {header, "lanes.h"}
    assert with_headers(tmp_path, f'#include "{header}"\n', *needed)


def test_quotients(tmp_path: Path, fr3: Library) -> None:
    """Oracle: the processor's own division, which rounds correctly."""
    dll = with_headers(tmp_path, DRIVER, "lanes.h")
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 80_000)) * 10.0 ** rng.uniform(-70, 70, (2, 80_000))
    a[:8] = 0.0
    a[8:16], b[8:16] = 1.0, 1.0
    for level in levels_here(fr3):
        quotients = np.empty_like(a)
        pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (a, b, quotients)]
        dll[f"quotients_{level}"](ctypes.c_long(a.size), *pointers)
        # The function is accurate to one unit in the last place.
        np.testing.assert_array_max_ulp(quotients, a / b, maxulp=1)
        assert not quotients[:8].any()
        np.testing.assert_array_equal(quotients[8:16], 1.0)
