"""Functions for CasADi: values and Jacobians of both files against the compiled kernels."""

import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from runtime.common.compiler import find_compiler
from runtime.library import load
from symgen.cli import main
from symgen.make.casadi_files import EXPORTED
from tests.robots import DATA

NAMES = {*EXPORTED, "gravity"}


def test_both_files_equal_the_kernels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: values to 1e-12, Jacobians to 1e-10; a later build without them drops them."""
    options = ["--urdf", str(DATA / "gantry.urdf"), "--name", "gantry", "--out", str(tmp_path)]
    command = ["build", *options, "--level", "portable"]
    monkeypatch.setattr(sys, "argv", ["symgen", *command, "--casadi"])
    with pytest.raises(SystemExit, match="0"):
        main()
    folder, shown = tmp_path / "gantry", capsys.readouterr().out
    assert "gantry.casadi: written" in shown.replace("\n", "")
    file = ca.FileDeserializer(str(folder / "gantry.casadi"))
    functions = {f.name(): f for f in (file.unpack() for _ in NAMES)}
    assert functions.keys() == NAMES
    assert ca.Function.load(str(folder / "gantry.casadi")).name() == "inverse_dynamics"
    code, shared = folder / "gantry_casadi.c", tmp_path / "functions.so"
    words = ("-O1", "-shared", "-fPIC", str(code), "-o", str(shared), "-lm")
    subprocess.run([*find_compiler(), *words], check=True)
    lib, rng = load(folder), np.random.default_rng(2)
    q, dq, ddq = rng.uniform(-1, 1, (3, lib.n_joints))
    pi, rotor = lib.pi0, rng.uniform(0, 1, lib.n_joints)
    tau = lib.inverse_dynamics(q, dq, ddq, pi)
    cases = {
        "inverse_dynamics": ((q, dq, ddq, pi), tau),
        "mass_matrix": ((q, pi), lib.mass_matrix(q, pi)),
        "bias_forces": ((q, dq, pi), lib.bias_forces(q, dq, pi)),
        "gravity": ((q, pi), lib.bias_forces(q, 0 * dq, pi)),
        "forward_dynamics": (
            (q, dq, tau, pi, rotor),
            lib.forward_dynamics(q, dq, tau, pi, rotor),
        ),
        "end_effector": ((q,), lib.end_effector(q)),
    }
    for name, (given, expected) in cases.items():
        for function in (functions[name], ca.external(name, str(shared))):
            result = np.squeeze(np.asarray(function(*given)))
            np.testing.assert_allclose(result, expected, rtol=1e-12, atol=1e-12)
    compiled = ca.external("inverse_dynamics", str(shared))
    by_q, _, _, by_pi = compiled.jacobian()(q, dq, ddq, pi, tau)
    _, expected_q, *_ = lib.torque_derivatives(q, dq, ddq, pi)
    np.testing.assert_allclose(np.asarray(by_q), expected_q, rtol=1e-10, atol=1e-10)
    regressor = lib.regressor(q, dq, ddq)
    np.testing.assert_allclose(np.asarray(by_pi), regressor, rtol=1e-10, atol=1e-10)
    monkeypatch.setattr(sys, "argv", ["symgen", *command, "--force"])
    with pytest.raises(SystemExit, match="0"):
        main()
    assert not list(folder.glob("*casadi*"))
