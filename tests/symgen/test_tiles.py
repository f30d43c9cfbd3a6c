"""Tiles of W samples: every level gives what the scalar reference gives, on toys and on robots."""

import ctypes
import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from runtime.errors import LibraryError
from runtime.library import Library, load
from symgen.compiler import LEVELS, compile_library, find_compiler, machine
from symgen.emit import emit, tile_program
from symgen.emit.ssa import _TILE_EXPRESSIONS, EXPRESSIONS
from symgen.errors import BuildError
from symgen.kernel import Argument, Kernel, make_kernel

# Kernels of 1000 operations on numbers of order one: rounding grows to a few hundred units in the
# last place of the largest entry; measured 6e-16.
SAME = 1e-13


def levels_here(lib: Library) -> tuple[str, ...]:
    """Levels of the library that this processor can run: all up to its best one."""
    return lib.levels[: lib.levels.index(load(lib.folder).level) + 1]


def test_every_operation_has_a_tile_form():
    """Property: what the scalar emitter can write, the tile emitter can; trigonometry is paired."""
    assert set(EXPRESSIONS) - set(_TILE_EXPRESSIONS) == {ca.OP_SIN, ca.OP_COS}


def test_shared_inputs_are_worked_off_once():
    """Property: what depends on shared inputs only stands in prepare, the rest in the body."""
    x, k = ca.SX.sym("x", 2), ca.SX.sym("k", 1)
    kernel = make_kernel(
        "toy",
        {Argument("x", (2,), "1"): x, Argument("k", (1,), "1", shared=True): k},
        {Argument("y", (3,), "1"): ca.vertcat(x[0] * ca.exp(k), ca.sin(x[1]), ca.exp(k))},
        "toy",
    )
    program = tile_program(kernel)
    assert any("exp(k[0])" in line for line in program.prepare)
    assert not any("exp" in line for line in program.body)
    assert program.uniform == 1
    assert any("vd_sincos(x[1]" in line for line in program.body)


def test_unknown_operation_is_named():
    """Property: an operation without C text is refused with its number and where to add it."""
    x = ca.SX.sym("x", 1)
    kernel = make_kernel(
        "toy", {Argument("x", (1,), "1"): x}, {Argument("y", (1,), "1"): ca.erf(x)}, ""
    )
    with pytest.raises(
        BuildError, match=r"kernel 'toy' uses the CasADi instruction \d+ per sample"
    ):
        tile_program(kernel)


def all_operations() -> Kernel:
    """A toy with every operation on per-sample values."""
    x = ca.SX.sym("x", 3)
    a, b, c = x[0], x[1], x[2]
    rows = [
        a + b, a - b, a * b, a / c, -a, a * a, a + a, 1 / c, ca.sqrt(c), ca.exp(a), ca.log(c),
        ca.sin(a), ca.cos(a), ca.tanh(a), ca.atan2(a, b), ca.fabs(a), ca.fmin(a, b), ca.fmax(a, b),
        ca.if_else(a < b, a, b), ca.if_else(a <= b, 1.0, b), ca.if_else(a == b, a, 2.0),
        ca.if_else(a != b, a, 3.0), ca.if_else(ca.logic_and(a < 0, b < 0), a, b),
        ca.if_else(ca.logic_or(a < 0, b < 0), a, b), ca.if_else(ca.logic_not(a < 0), a, b),
    ]  # fmt: skip
    return make_kernel(
        "toy",
        {Argument("x", (3,), "1"): x},
        {Argument("y", (len(rows),), "1"): ca.vertcat(*rows)},
        "every operation",
    )


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> tuple[ctypes.CDLL, Kernel]:
    """The toy with every operation, compiled at all levels, and a kernel of sine and cosine."""
    folder = tmp_path_factory.mktemp("toy")
    x = ca.SX.sym("x", 1)
    pair = make_kernel(
        "pair",
        {Argument("x", (1,), "1"): x},
        {Argument("y", (2,), "1"): ca.vertcat(ca.sin(x), ca.cos(x))},
        "sine and cosine",
    )
    kernel = all_operations()
    facts = {
        "gravity": [0, 0, 0], "base": "", "tip": "", "base_parameters": {"columns": []}, "pi0": [],
        "joints": [], "pi_names": [], "lam_names": [],
    }  # fmt: skip
    files = emit("toy", (kernel, pair), facts, {"symgen": "0", "casadi": "0"}).files
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    target = folder / "libtoy.so"
    compile_library([folder / "kernels.c", folder / "batch.c"], target, [folder / "tiles.c"])
    return ctypes.CDLL(str(target)), kernel


def run(dll: ctypes.CDLL, level: str, kernel: str, x: np.ndarray, width: int) -> np.ndarray:
    """One batch through a compiled toy."""
    prefix = "toy" if level == "portable" else f"toy_{level}"
    out = np.full((len(x), width), -7.0)
    dll[f"{prefix}_{kernel}_batch"](
        ctypes.c_long(len(x)),
        ctypes.c_void_p(x.ctypes.data),
        ctypes.c_long(x.shape[1]),
        ctypes.c_void_p(out.ctypes.data),
    )
    return out


def runnable(dll: ctypes.CDLL) -> list[str]:
    """Levels that this processor can run."""
    answer = dll["toy_level"]
    answer.restype = ctypes.c_char_p
    best = answer().decode()
    names = sorted(LEVELS.get(machine(), {}))
    return names[: names.index(best) + 1] if best in names else []


@pytest.mark.parametrize("n", [1, 7, 8, 9, 64])
def test_every_operation_equals_the_scalar_code(toy, n):
    """Oracle: the scalar C; also where the last tile is not full."""
    dll, kernel = toy
    rng = np.random.default_rng(n)
    x = np.column_stack([rng.normal(size=n), rng.normal(size=n), rng.uniform(0.1, 3, n)])
    x[0, 1] = x[0, 0]  # equality is hit
    wanted = run(dll, "portable", "toy", x, kernel.outputs[0].size)
    for level in runnable(dll):
        # Fused multiply-add and our sine differ from libm by single units in the last place.
        np.testing.assert_allclose(
            run(dll, level, "toy", x, kernel.outputs[0].size), wanted, rtol=1e-15, atol=1e-15
        )


def test_sincos_within_two_units_in_the_last_place(toy):
    """Oracle: the C library in long double, over many turns and near multiples of π/2."""
    dll, _ = toy
    if np.finfo(np.longdouble).nmant <= np.finfo(float).nmant:
        pytest.skip("long double has no extra digits on this machine, so it cannot judge an ulp")
    rng = np.random.default_rng(0)
    near = np.arange(-200, 201) * (np.pi / 2)
    x = np.concatenate(
        [
            rng.uniform(-10, 10, 40000),
            rng.uniform(-1e5, 1e5, 40000),
            near,
            near + rng.normal(0, 1e-8, near.size),
            [0.0, 1e-300, -1e-20, 99999.9, -99999.9],
        ]
    )[:, None]
    exact = np.column_stack(
        [np.sin(x[:, 0].astype(np.longdouble)), np.cos(x[:, 0].astype(np.longdouble))]
    )
    unit = np.spacing(np.abs(exact.astype(float)))
    for level in runnable(dll):
        error = np.abs(run(dll, level, "pair", x, 2).astype(np.longdouble) - exact) / unit
        assert error.max() <= 2.0, (level, x[int(np.argmax(error.max(axis=1)))])


def test_sincos_of_huge_and_impossible_arguments(toy):
    """Oracle: the C library, which takes over beyond 1e5; NaN and infinity give NaN."""
    dll, _ = toy
    x = np.array([1e5, 1e6, -3e8, 1e22, 2.0, np.inf, -np.inf, np.nan, 0.5])[:, None]
    wanted = run(dll, "portable", "pair", x, 2)
    assert np.isnan(wanted[5:8]).all()
    for level in runnable(dll):
        # The two ordinary arguments may differ by 2 ulp of numbers below one.
        np.testing.assert_allclose(run(dll, level, "pair", x, 2), wanted, rtol=0, atol=4.5e-16)


@pytest.mark.parametrize("name", ["fr3", "ur5", "tree", "gantry"])
def test_all_kernels_agree_on_all_levels(robot, name):
    """Oracle: the portable level, itself tested against Pinocchio; N is no multiple of W."""
    lib = robot(name)
    rng = np.random.default_rng(1)
    n, count = lib.n_joints, 37
    q, dq, ddq, tau = rng.normal(size=(4, count, n))
    lam = lib.lam0 * (1 + 0.05 * rng.normal(size=(count, lib.lam0.size)))
    weight, seed = rng.uniform(0.5, 2, n), rng.normal(size=(count, n, len(lib.base_columns)))
    calls = {
        "inverse_dynamics": (q, dq, ddq, lib.pi0),
        "torque": (q, dq, ddq, lam),  # one λ per sample
        "torque_jacobian": (q, dq, ddq, lib.lam0),
        "regressor": (q, dq, ddq),
        "base_regressor": (q, dq, ddq),
        "mass_matrix": (q, lib.pi0),
        "bias_forces": (q, dq, lib.pi0),
        "forward_dynamics": (q, dq, tau, lib.pi0),
        "end_effector": (q,),
        "regressor_adjoint": (q, dq, ddq, seed),
        "pi_from_lam": (lam,),
        "pi_jacobian": (lam,),
        "pi_adjoint": (lam, rng.normal(size=lam.shape)),
        "lam_from_pi": (lib.pi_from_lam(lam),),
        "inertia_matrix": (lam,),
        "nearest_realisable": (lib.pi_from_lam(lam),),
        "harmonic_basis": (np.arange(5) + 1, np.linspace(0, 1, 5), 2.0),
    }
    reference = load(lib.folder, "portable")
    for level in levels_here(lib)[1:]:
        own = load(lib.folder, level)
        for kernel, arguments in calls.items():
            wanted = getattr(reference, kernel)(*arguments)
            got = getattr(own, kernel)(*arguments)
            # forward dynamics divides by M: its rounding is multiplied by the condition of M
            scale = np.abs(wanted).max() * (1e4 if kernel == "forward_dynamics" else 1.0)
            assert np.abs(got - wanted).max() <= SAME * scale, (level, kernel)
        loss = [x.loss_gradient(q, dq, ddq, tau, weight, lib.pi0) for x in (reference, own)]
        assert loss[1][0] == pytest.approx(loss[0][0], rel=SAME)
        np.testing.assert_allclose(loss[1][1], loss[0][1], atol=SAME * np.abs(loss[0][1]).max())


def test_unknown_level_is_refused(fr3):
    """Property: the message lists the levels that there are."""
    with pytest.raises(LibraryError, match=r"no level 'v9', it has portable"):
        load(fr3.folder, "v9")


def test_tiles_compile_for_arm(fr3, tmp_path):
    """Oracle: zig's cross compiler for 64-bit Arm; the code cannot run here."""
    pytest.importorskip("ziglang", reason="the ziglang wheel is the cross compiler")
    for file in ("tiles.c", "lanes.h"):
        shutil.copy(fr3.folder / file, tmp_path)
    command = [sys.executable, "-m", "ziglang", "cc", "-target", "aarch64-linux-gnu", "-O1", "-c"]
    subprocess.run(
        [*command, "-std=c99", "-DLEVEL=neon", "-DW=2", "tiles.c", "-o", "tiles.o"],
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )
    head = (tmp_path / "tiles.o").read_bytes()[:20]
    assert head[:4] == b"\x7fELF"
    assert head[18] == 0xB7  # EM_AARCH64


def test_tiles_are_clean_under_strict_warnings(fr3, tmp_path):
    """Property: the compiler has nothing to say, conversions between signs and widths included."""
    for file in ("tiles.c", "lanes.h", "kernels.c", "batch.c", "fr3.h"):
        shutil.copy(Path(fr3.folder) / file, tmp_path)
    strict = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-Wconversion"]
    strict.append("-Wno-unused-parameter")
    widths = ["-DLEVEL=v2", "-DW=2"] if machine() == "x86_64" else ["-DLEVEL=neon", "-DW=2"]
    for source in ("tiles.c", "kernels.c", "batch.c"):
        run = subprocess.run(
            [*find_compiler(), *strict, *widths, "-c", source, "-o", "x.o"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert run.returncode == 0, run.stderr[:2000]
