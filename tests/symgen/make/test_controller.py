"""Kernels for microcontrollers: one C file in either precision, with the digits of the library."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from runtime.library import load
from symgen.emit.files import controller_files
from symgen.errors import BuildError
from symgen.make.pipeline import write_controller
from symgen.make.request import BuildRequest

STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wdouble-promotion", "-Wfloat-conversion", "-Werror")


@pytest.mark.parametrize(("precision", "number"), [("double", "f8"), ("single", "f4")])
def test_the_file_has_the_digits_of_the_library(
    precision: str, number: str, tiny_request: BuildRequest, tiny_built: Path, tmp_path: Path
) -> None:
    """Oracle: the compiled library; in single precision no number is a double, or GCC warns."""
    if (compiler := shutil.which("gcc")) is None:
        pytest.skip("SKIPPED LOUDLY: no gcc on this machine")
    names = ["bias_forces", "forward_dynamics"]
    folder = write_controller(tiny_request, tmp_path, names, precision, False)
    text = (folder / "tiny.c").read_text()
    assert "static void tiny_base_parameters(" in text  # called by bias_forces
    assert "tiny_regressor" not in text
    flags = ("-std=c99", "-O0", *STRICT, "-shared", "-fPIC")
    subprocess.run([compiler, *flags, "tiny.c", "-o", "tiny.so", "-lm"], cwd=folder, check=True)
    code, lib = ctypes.CDLL(str(folder / "tiny.so")), load(tiny_built)
    given = {"q": [0.7], "dq": [-0.4], "tau": [0.3], "pi": lib.pi0, "rotor": [0.01]}
    for name in names:
        inputs = [given[a.name] for a in lib.manifest.kernels[name].inputs]
        exact = getattr(lib, name)(*inputs)
        arrays = [np.array(values, number) for values in (*inputs, [0.0])]
        getattr(code, f"tiny_{name}")(*(a.ctypes.data_as(ctypes.c_void_p) for a in arrays))
        bound = {"f8": 1e-13, "f4": 1e-6}[number]  # rounding of some dozen operations
        np.testing.assert_allclose(arrays[-1], exact, rtol=bound)


def test_refusals_name_what_there_is(tiny_request: BuildRequest, tmp_path: Path) -> None:
    """Property: an unknown kernel, a precision and a file that exists are one sentence each."""
    with pytest.raises(BuildError, match=r"the setting kernels of .* got 'double' and 'no_such'"):
        controller_files("tiny", (), ["no_such"], "double", {})
    with pytest.raises(BuildError, match=r"the setting precision single or double .* got 'half'"):
        controller_files("tiny", (), [], "half", {})
    (tmp_path / "tiny/controller").mkdir(parents=True)
    (tmp_path / "tiny/controller/tiny.c").touch()
    with pytest.raises(BuildError, match="exists; choose another --out or give --overwrite"):
        write_controller(tiny_request, tmp_path, ["end_effector"], "double", False)
