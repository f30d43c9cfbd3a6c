"""Memory of freed arrays: the kernel need not fill it again."""

import platform
import subprocess
import sys

import pytest

from tests.conftest import REPOSITORY

GROWING = """
import resource
import numpy as np
from runtime.startup.memory import keep_memory
keep_memory()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for k in range(1, 40):
    np.ones(k * 2**14)
print((resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before) * resource.getpagesize())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="limits of glibc")
def test_larger_and_larger_arrays_take_the_memory_of_those_before() -> None:
    """Property: 100 MB of arrays, one after another, the last of 5 MB, touch 10 MB at most."""
    run = subprocess.run(
        [sys.executable, "-c", GROWING], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert int(run.stdout) < 10e6
