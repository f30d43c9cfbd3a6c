"""The header declares every function on many samples, for C and for C++, without warnings."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wstrict-prototypes", "-Werror")
PROGRAM = """#include <stdio.h>
#include "tiny.h"
#include "tiny.h"
TINY_MANY(portable);
int main(void)
{
    const double q[2] = {0.3, -0.2}, dq[2] = {1.0, 2.0}, ddq[2] = {0.5, 0.1};
    double pi[10] = {1.5, 0.1, 0.0, 0.2, 0.02, 0.02, 0.01, 0.0, 0.0, 0.0}, one[2], many[2];
    for (int i = 0; i < 2; ++i) {
        tiny_inverse_dynamics(q + i, dq + i, ddq + i, pi, one + i);
    }
    tiny_portable_inverse_dynamics_batch(2, q, 1, dq, 1, ddq, 1, pi, 0, many);
    printf("%.3g %.3g\\n", one[0] - many[0], one[1] - many[1]);
    return 0;
}
"""


def tool(name: str) -> str:
    """Path of a program; the test is skipped without it."""
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not installed")
    return path


def test_a_program_calls_many_samples(tiny_built: Path, tmp_path: Path) -> None:
    """Property: declarations, not guesses of the compiler; both forms give the same digits."""
    source, program = tmp_path / "many.c", tmp_path / "many"
    source.write_text(PROGRAM)
    library = tiny_built / "libtiny.so"
    subprocess.run(
        [tool("cc"), "-std=c99", *STRICT, "-I", tiny_built, source, library, "-o", program],
        check=True,
    )
    done = subprocess.run([program], check=True, capture_output=True, text=True)
    # rounding of torques of 10 N·m
    assert max(abs(float(word)) for word in done.stdout.split()) < 1e-13


def test_the_header_is_one_of_cpp(tiny_built: Path, tmp_path: Path) -> None:
    """Property: no warning of C++, and C linkage."""
    source = tmp_path / "many.cpp"
    source.write_text(PROGRAM)
    flags = [flag for flag in STRICT if flag != "-Wstrict-prototypes"]
    subprocess.run(
        [tool("g++"), "-std=c++11", *flags, "-fsyntax-only", "-I", tiny_built, source], check=True
    )


def test_every_function_on_many_samples_is_declared(tiny_built: Path) -> None:
    """Property: what the library exports for many samples stands in the header, level for level."""
    header = (tiny_built / "tiny.h").read_text()
    declared = set(re.findall(r"tiny_(?:##level##_)?(\w+_(?:batch|tiles))\(", header))
    symbols = subprocess.run(
        [tool("nm"), "-D", "--defined-only", tiny_built / "libtiny.so"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    exported = set(re.findall(r" tiny_(?:portable_)?(\w+_(?:batch|tiles))\n", symbols))
    names = [
        kernel["name"]
        for kernel in json.loads((tiny_built / "manifest.json").read_text())["kernels"]
    ]
    levels = ("v2_", "v3_", "v4_", "neon_", "casadi_")
    assert {each for each in exported if not each.startswith(levels)} == declared
    assert {f"{name}_batch" for name in names} == {each for each in declared if "_batch" in each}
