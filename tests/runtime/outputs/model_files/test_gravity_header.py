"""`export --to gravity`: the C header of g(q)."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from runtime.library import Library
from runtime.outputs.model_files.export import export_model
from tests.compiling import compile_program

MAIN = """#include <stdio.h>
#include "arm_gravity.h"
int main(void)
{
    const double q[] = {%s};
    double tau[sizeof(q) / sizeof(q[0])];
    unsigned i;
    arm_gravity(q, tau);
    for (i = 0; i < sizeof(q) / sizeof(q[0]); ++i) printf("%%a\\n", tau[i]);
    return 0;
}
"""


def test_the_gravity_header_computes_the_gravity_torque(arm: Library, tmp_path: Path) -> None:
    """Oracle: the library's inverse dynamics at rest, against a C program with the header."""
    if shutil.which("cc") is None:
        pytest.skip("SKIPPED LOUDLY: no C compiler called cc on this machine")
    pi = arm.pi0 * 1.1
    (done,) = export_model(arm, pi, ["gravity"], tmp_path)
    assert done.path == tmp_path / "arm_gravity.h"
    assert done.sentence.startswith("verified")
    q = np.random.default_rng(0).uniform(-1, 1, arm.n_joints)
    (tmp_path / "main.c").write_text(MAIN % ", ".join(map(repr, q.tolist())))
    sources = [str(tmp_path / "main.c"), str(Path(arm.folder) / "kernels.c")]
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter"]
    command = ["cc", *flags, *sources, "-o", str(tmp_path / "main"), "-lm"]
    compile_program(command, tmp_path)
    out = subprocess.run([str(tmp_path / "main")], check=True, capture_output=True, text=True)
    tau = np.array([float.fromhex(line) for line in out.stdout.splitlines()])
    expected = arm.inverse_dynamics(q, 0 * q, 0 * q, pi)
    assert np.abs(expected).max() > 0.1
    # Rounding: the compilers may contract multiplications and additions differently.
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
