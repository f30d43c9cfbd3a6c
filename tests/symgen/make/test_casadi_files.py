"""Functions for CasADi: values and Jacobians of both files against the compiled kernels."""

import sys
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from runtime.common.compiler import find_compiler
from runtime.library import Library, load
from runtime.outputs.model_files.export import export_model
from runtime.recording import Friction
from runtime.recording.friction.model import columns
from runtime.recording.settings import JointMotion
from symgen.cli import main
from symgen.make.casadi_files import EXPORTED
from tests.compiling import compile_program
from tests.robots import DATA

NAMES = {*EXPORTED, "gravity"}
KEPT = ("viscous", "coulomb", "asymmetric")
"""Friction columns of the exported functions, beside that of the rotors."""


def test_both_files_equal_the_kernels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: values to 1e-12, Jacobians to 1e-10; a later build without them drops them."""
    options = ["--urdf", str(DATA / "gantry.urdf"), "--name", "gantry", "--out", str(tmp_path)]
    command = ["build", *options, "--settings", "level=portable"]
    monkeypatch.setattr(sys, "argv", ["symgen", *command, "--settings", "casadi=true"])
    with pytest.raises(SystemExit, match="0"):
        main()
    folder, shown = tmp_path / "gantry", capsys.readouterr().out
    assert "gantry.casadi: written" in shown.replace("\n", "")
    file = ca.FileDeserializer(str(folder / "gantry.casadi"))
    functions = {f.name(): f for f in (file.unpack() for _ in NAMES)}
    assert functions.keys() == NAMES
    assert ca.Function.load(str(folder / "gantry.casadi")).name() == "inverse_dynamics"
    code, shared = folder / "gantry_casadi.c", tmp_path / "functions.so"
    compiled_to(shared, code)
    lib, rng = load(folder), np.random.default_rng(2)
    q, dq, ddq = rng.uniform(-1, 1, (3, lib.n_joints))
    pi, rotor = lib.pi0, rng.uniform(0, 1, lib.n_joints)
    tau = lib.inverse_dynamics(q, dq, ddq, pi)
    cases = {
        "inverse_dynamics": ((q, dq, ddq, pi), tau),
        "mass_matrix": ((q, pi), lib.mass_matrix(q, pi)),
        "bias_forces": ((q, dq, pi), lib.bias_forces(q, dq, pi)),
        "gravity": ((q, pi), lib.bias_forces(q, 0 * dq, pi)),
        "forward_dynamics": ((q, dq, tau, pi, rotor), lib.forward_dynamics(q, dq, tau, pi, rotor)),
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
    _exported_functions(lib, tmp_path)
    monkeypatch.setattr(sys, "argv", ["symgen", *command, "--settings", "force=true"])
    with pytest.raises(SystemExit, match="0"):
        main()
    assert not list(folder.glob("*casadi*"))


def compiled_to(library: Path, *sources: Path) -> None:
    words = ("-O0", "-shared", "-fPIC", *sources, "-o", library, "-lm")
    compile_program([*find_compiler(), *words], library.parent)


def _exported_functions(lib: Library, folder: Path) -> None:
    """Oracle: the library at identified π with friction; an OCP in C that calls the exported C.

    acados writes the functions of an optimal control problem in the same way: f(x, u) and its
    sensitivities as C code by CasADi, linked to the C code of the functions that the model calls.
    """
    n, rng = lib.n_joints, np.random.default_rng(4)
    pi, terms = 1.1 * lib.pi0, Friction(("viscous", "coulomb", "rotor", "asymmetric", "load"))
    phi = rng.uniform(0.1, 1, (n, 5))
    (done,) = export_model(lib, pi, ["casadi"], folder, terms=terms, phi=phi)
    assert done.path is not None, done.sentence
    code, shared = done.path / f"{lib.name}_identified.c", folder / "identified.so"
    assert "Friction columns left out: load." in code.read_text(encoding="utf-8")
    compiled_to(shared, code)
    q, dq, ddq = rng.uniform(-1, 1, (3, n))
    forward = ca.external("forward_dynamics", str(shared))
    x, u = ca.MX.sym("x", 2 * n), ca.MX.sym("u", n)
    rate = ca.vertcat(x[n:], forward(x[:n], x[n:], u))
    sensitivity = ca.jacobian(rate, ca.vertcat(x, u))
    ode = ca.Function("expl_ode_fun", [x, u], [rate])
    vde = ca.Function("expl_vde_forw", [x, u], [rate, sensitivity])
    generator = ca.CodeGenerator("ocp.c", {"with_header": False})
    generator.add(ode)
    generator.add(vde)
    (folder / "ocp.c").write_text(generator.dump(), encoding="utf-8")
    compiled_to(folder / "ocp.so", folder / "ocp.c", shared)
    tau, state = lib.inverse_dynamics(q, dq, ddq, pi) + phi[:, 2] * ddq, np.concatenate([q, dq])
    result, slope = ca.external("expl_vde_forw", str(folder / "ocp.so"))(state, tau)
    np.testing.assert_allclose(np.ravel(np.asarray(result)), np.concatenate([dq, ddq]), rtol=1e-12)
    mass = lib.mass_matrix(q, pi) + np.diag(phi[:, 2])
    _, by_q, by_dq, _ = lib.torque_derivatives(q, dq, ddq, pi)
    parts = [by_q, by_dq, -np.eye(n)]
    expected = np.hstack([-np.linalg.solve(mass, part) for part in parts])
    np.testing.assert_allclose(np.asarray(slope)[n:], expected, rtol=1e-10, atol=1e-10)
    C = columns(JointMotion(dq[None], q[None], ddq[None], lib), replace(terms, columns=KEPT))[0]
    read = ca.external("torque", str(shared))(q, dq, ddq)
    friction = np.sum(C * phi[:, [0, 1, 3]], axis=1)
    np.testing.assert_allclose(np.ravel(np.asarray(read)), tau + friction, rtol=1e-12)
