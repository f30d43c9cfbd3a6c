"""Tiles of eight samples: every level gives what CasADi's own C gives, on toys and on robots."""

import ctypes
import shutil
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest

from runtime.errors import LibraryError
from runtime.library import Library, load
from runtime.library.binding import LEVELS
from symgen.compiler import compile_library
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
    assert (program.turned, program.turns) == ("x", [1])  # its sine is row 2 of sc
    assert any("sc[2 * VS]" in line for line in program.body)
    assert not any("vd_sincos" in line for line in program.body)


def test_sines_of_expressions_are_paired_in_the_body():
    """Property: sin and cos of a computed angle are one call; those of a second input too."""
    x, y = ca.SX.sym("x", 1), ca.SX.sym("y", 1)
    rows = ca.vertcat(ca.sin(x), ca.sin(2 * x), ca.cos(2 * x), ca.cos(y))
    kernel = make_kernel(
        "toy",
        {Argument("x", (1,), "1"): x, Argument("y", (1,), "1"): y},
        {Argument("out", (4,), "1"): rows},
        "toy",
    )
    program = tile_program(kernel)
    assert (program.turned, program.turns) == ("x", [0])
    assert sum("vd_sincos" in line for line in program.body) == 2


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
    """Compiled at all levels: every operation, sine and cosine of an input and of a sum, exp."""
    folder = tmp_path_factory.mktemp("toy")
    x = ca.SX.sym("x", 1)

    def of_x(name: str, *rows: ca.SX) -> Kernel:
        outputs = {Argument("y", (len(rows),), "1"): ca.vertcat(*rows)}
        return make_kernel(name, {Argument("x", (1,), "1"): x}, outputs, name)

    kernel = all_operations()
    facts = {
        "gravity": [0, 0, 0], "base": "", "tip": "", "base_parameters": {"columns": []}, "pi0": [],
        "joints": [], "pi_names": [], "lam_names": [], "torque_rate": None, "tip_speed": None,
        "braking": None, "proxy": [], "pair": [], "moving_proxies": [],
    }  # fmt: skip
    pairs = (
        of_x("pair", ca.sin(x), ca.cos(x)),  # by way of `sines`
        of_x("doubled", ca.sin(x + x), ca.cos(x + x)),  # by way of `vd_sincos`
        of_x("power", ca.exp(x)),
    )
    files = emit("toy", (kernel, *pairs), facts, {"symgen": "0", "casadi": "0"}).files
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    target = folder / "libtoy.so"
    paths = [[folder / name] for name in ("kernels.c", "tiles.c", "reference.c")]
    compile_library(paths[0], target, *paths[1:])
    return ctypes.CDLL(str(target)), kernel


def run(dll: ctypes.CDLL, level: str, kernel: str, x: np.ndarray, width: int) -> np.ndarray:
    """One batch through a compiled toy."""
    out = np.full((len(x), width), -7.0)
    dll[f"toy_{level}_{kernel}_batch"](
        ctypes.c_long(len(x)),
        ctypes.c_void_p(x.ctypes.data),
        ctypes.c_long(x.shape[1]),
        ctypes.c_void_p(out.ctypes.data),
    )
    return out


def runnable(dll: ctypes.CDLL) -> list[str]:
    """Levels on tiles that this processor can run."""
    answer = dll["toy_level"]
    answer.restype = ctypes.c_char_p
    best = LEVELS.index(answer().decode())
    here = [level for level in LEVELS[1 : best + 1] if hasattr(dll, f"toy_{level}_pair_batch")]
    assert "portable" in here
    return here


@pytest.mark.parametrize("n", [1, 7, 8, 9, 64])
def test_every_operation_equals_casadi(toy, n):
    """Oracle: CasADi's C; also where the last tile is not full."""
    dll, kernel = toy
    rng = np.random.default_rng(n)
    x = np.column_stack([rng.normal(size=n), rng.normal(size=n), rng.uniform(0.1, 3, n)])
    x[0, 1] = x[0, 0]  # equality is hit
    wanted = run(dll, "casadi", "toy", x, kernel.outputs[0].size)
    for level in runnable(dll):
        # Fused multiply-add and our sine differ from libm by single units in the last place.
        np.testing.assert_allclose(
            run(dll, level, "toy", x, kernel.outputs[0].size), wanted, rtol=1e-15, atol=1e-15
        )


def units_off(got: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Errors in units in the last place of the exact value, given in long double."""
    return np.abs(got.astype(np.longdouble) - exact) / np.spacing(np.abs(exact.astype(float)))


NEEDS_LONG_DOUBLE = pytest.mark.skipif(
    np.finfo(np.longdouble).nmant <= np.finfo(float).nmant,
    reason="long double has no extra digits on this machine, so it cannot judge an ulp",
)


@NEEDS_LONG_DOUBLE
@pytest.mark.parametrize("kernel", ["pair", "doubled"])
def test_sincos_within_two_units_in_the_last_place(toy, kernel):
    """Oracle: the C library in long double, over many turns and near multiples of π/2.

    `pair` takes the way of `sines`, `doubled` that of `vd_sincos` on x + x, which is exact.
    """
    dll, _ = toy
    rng = np.random.default_rng(0)
    near = np.arange(-200, 201) * (np.pi / 2)
    x = np.concatenate(
        [
            rng.uniform(-10, 10, 40000),
            rng.uniform(-1e5, 1e5, 40000),
            near,
            near + rng.normal(0, 1e-8, near.size),
            rng.choice([-1, 1], 2000) * 10.0 ** rng.uniform(5, 300, 2000),
            [0.0, 1e-300, -1e-20, 99999.9, -99999.9, 1e5, -1e5, 1e22, 1e300, -1e300],
        ]
    )[:, None]
    angle = (x[:, 0] if kernel == "pair" else 2 * x[:, 0]).astype(np.longdouble)
    exact = np.column_stack([np.sin(angle), np.cos(angle)])
    for level in runnable(dll):
        error = units_off(run(dll, level, kernel, x, 2), exact)
        assert error.max() <= 2.0, (level, x[int(np.argmax(error.max(axis=1)))])


@pytest.mark.parametrize("kernel", ["pair", "doubled"])
def test_sincos_of_huge_and_impossible_arguments(toy, kernel):
    """Oracle: the C library, which takes over beyond 1e5; NaN and infinity give NaN alone."""
    dll, _ = toy
    x = np.array([1e5, 1e6, -3e8, 1e22, 2.0, np.inf, -np.inf, np.nan, 0.5, 1e300])[:, None]
    wanted = run(dll, "casadi", kernel, x, 2)
    assert np.isnan(wanted[5:8]).all()
    assert not np.isnan(wanted[[0, 1, 2, 3, 4, 8, 9]]).any()
    for level in runnable(dll):
        # The ordinary arguments may differ by 2 ulp of numbers below one.
        np.testing.assert_allclose(run(dll, level, kernel, x, 2), wanted, rtol=0, atol=4.5e-16)


@NEEDS_LONG_DOUBLE
def test_exp_within_two_units_in_the_last_place(toy):
    """Oracle: exp in long double, over the whole range where the result is a normal number."""
    dll, _ = toy
    rng = np.random.default_rng(0)
    near = np.arange(-1000, 1001) * (np.log(2) / 2)  # where k changes
    x = np.concatenate(
        [
            rng.uniform(-708, 709, 40000),
            rng.uniform(-1, 1, 40000),
            near + rng.normal(0, 1e-9, near.size),
            rng.normal(0, 1, 1000) * 10.0 ** rng.uniform(-300, -1, 1000),
            [0.0, -0.0, 5e-324, 700.0, -700.0, 699.9999, 709.7, -708.3],
        ]
    )[:, None]
    exact = np.exp(x[:, 0].astype(np.longdouble))
    for level in runnable(dll):
        error = units_off(run(dll, level, "power", x, 1)[:, 0], exact)
        assert error.max() <= 2.0, (level, x[np.argmax(error)])


def test_exp_at_its_ends(toy):
    """Oracle: the definition at infinity and beyond the largest and smallest number; NaN stays."""
    dll, _ = toy
    x = np.array([np.inf, -np.inf, np.nan, 710.0, 1e300, -746.0, -1e300, -740.0, 0.0, 1.0])
    wanted = np.array([np.inf, 0, np.nan, np.inf, np.inf, 0, 0, np.exp(-740.0), 1, np.e])
    for level in runnable(dll):
        got = run(dll, level, "power", x[:, None], 1)[:, 0]
        np.testing.assert_allclose(got, wanted, rtol=2.0**-51, atol=0, err_msg=level)


def arguments_of(lib: Library, count: int, seed: int = 1) -> dict[str, list[np.ndarray]]:
    """Inputs of every kernel, one row per sample, as a robot may see them."""
    rng = np.random.default_rng(seed)
    lam = lib.lam0 * (1 + 0.05 * rng.normal(size=(count, lib.lam0.size)))
    pi = lib.pi_from_lam(lam)

    def numbers(kernel: str, name: str, size: int) -> np.ndarray:
        if name in {"lam", "pi"}:
            return np.ascontiguousarray({"lam": lam, "pi": pi}[name][:, :size])
        if name in {"weight", "rotor", "t_f", "floor"}:
            return rng.uniform(0.01, 0.02, (count, size)) * (100 if name == "t_f" else 1)
        return rng.normal(size=(count, size))

    return {
        kernel.name: [numbers(kernel.name, a.name, a.size) for a in kernel.inputs]
        for kernel in lib.manifest.kernels.values()
    }


def batch(
    lib: Library, level: str, kernel: str, inputs: list[np.ndarray], steps: list[int], n: int
) -> list[np.ndarray]:
    """The C function itself; what it leaves alone stays -7."""
    outputs = lib.manifest.kernels[kernel].outputs
    out = [np.full(a.size if a.summed else (n, a.size), -7.0) for a in outputs]
    dll = lib._binding._dll
    pairs = [
        item
        for x, step in zip(inputs, steps, strict=True)
        for item in (ctypes.c_void_p(x.ctypes.data), ctypes.c_long(step))
    ]
    own = ctypes.CDLL(dll._name)
    name = f"{lib.name}_{level}_{kernel}_batch"
    rare = f"{lib.name}_{kernel}_batch"  # of kernels without a vector form
    function = own[name if hasattr(own, name) else rare]
    function(ctypes.c_long(n), *pairs, *(ctypes.c_void_p(x.ctypes.data) for x in out))
    return out


def assert_same(got: list[np.ndarray], wanted: list[np.ndarray], kernel: str, where: object):
    for one, other in zip(got, wanted, strict=True):
        if not other.size:
            continue
        np.testing.assert_array_equal(np.isnan(one), np.isnan(other), err_msg=f"{where} {kernel}")
        # forward dynamics divides by M: its rounding is multiplied by the condition of M
        slack = 1e4 if kernel == "forward_dynamics" else 1.0
        scale = np.nanmax(np.abs(other), initial=0.0) * slack
        assert np.nanmax(np.abs(one - other), initial=0.0) <= SAME * scale, (where, kernel)


ROBOTS = ["fr3", "ur5", "tree", "gantry"]
"""One branches (tree), one slides (gantry)."""


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("n", [0, 1, 8, 37])
def test_all_kernels_equal_casadi_on_all_levels(robot, name, n):
    """Oracle: CasADi's own C; N = 0, one, a full tile, no multiple of a tile; every step.

    Shared inputs once for all (step 0) and one per sample, then every input kept (step 0).
    """
    lib = robot(name)
    levels = levels_here(lib)
    assert levels[:2] == ("casadi", "portable")
    for kernel, inputs in arguments_of(lib, max(n, 1)).items():
        facts = lib.manifest.kernels[kernel].inputs
        every = [a.size for a in facts]
        for steps in (every, [0 if a.shared else a.size for a in facts], [0] * len(every)):
            wanted = batch(lib, "casadi", kernel, inputs, steps, n)
            for level in levels[1:]:
                got = batch(lib, level, kernel, inputs, steps, n)
                assert_same(got, wanted, kernel, (level, n, steps))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["fr3", "gantry"])
def test_what_is_not_a_number_spoils_its_own_sample_only(robot, name, bad):
    """Oracle: CasADi's C; a NaN or infinity comes through, and the other lanes do not see it."""
    lib = robot(name)
    calls = arguments_of(lib, 9)
    for kernel in ("inverse_dynamics", "base_regressor", "mass_matrix", "pi_from_lam"):
        inputs = [x.copy() for x in calls[kernel]]
        for x in inputs:
            x[4, -1] = bad
        steps = [x.shape[1] for x in inputs]
        wanted = batch(lib, "casadi", kernel, inputs, steps, 9)
        assert not np.isfinite(wanted[0][4]).all()
        assert np.isfinite(np.delete(wanted[0], 4, axis=0)).all()
        for level in levels_here(lib)[1:]:
            got = batch(lib, level, kernel, inputs, steps, 9)
            rest = [[np.delete(x, 4, axis=0) for x in side] for side in (got, wanted)]
            assert_same(*rest, kernel, (level, bad))
            # Which of inf and NaN comes out depends on the order of a sum; that it is bad does not.
            finite = np.isfinite(wanted[0][4])
            assert not np.isfinite(got[0][4][~finite]).any(), (level, kernel)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("count", [1, 4, 5])
def test_tiles_in_place_equal_batches(robot, name, count):
    """Property: `_tiles` on 8-sample tiles gives what `_batch` gives, with stored sines or none."""
    lib = robot(name)
    n = 8 * count
    for kernel, inputs in arguments_of(lib, n).items():
        facts = lib.manifest.kernels[kernel]
        tiles_h = (lib.folder / "tiles.h").read_text(encoding="utf-8")
        if any(a.summed for a in facts.outputs) or f"OWN({kernel}_tile)" not in tiles_h:
            continue
        steps = [0 if a.shared else a.size for a in facts.inputs]
        wanted = batch(lib, "casadi", kernel, inputs, steps, n)
        tiled = [
            x[0].copy() if a.shared else in_tiles(x)
            for a, x in zip(facts.inputs, inputs, strict=True)
        ]
        stored = [in_tiles(sines_of(x)) for x in inputs[:1]]
        for level in levels_here(lib)[1:]:
            function = ctypes.CDLL(lib._binding._dll._name)[f"{lib.name}_{level}_{kernel}_tiles"]
            for sc in ([None], [ctypes.c_void_p(stored[0].ctypes.data)]):
                out = [np.zeros((count, a.size, 8)) for a in facts.outputs]
                pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*tiled, *out)]
                function(ctypes.c_long(count), *sc, *pointers)
                got = [x.transpose(0, 2, 1).reshape(n, -1) for x in out]
                assert_same(got, wanted, kernel, (level, "NULL" if sc == [None] else "stored"))


def in_tiles(x: np.ndarray) -> np.ndarray:
    """(8 m, k) samples as m tiles of k rows."""
    return np.ascontiguousarray(x.reshape(len(x) // 8, 8, -1).transpose(0, 2, 1))


def sines_of(q: np.ndarray) -> np.ndarray:
    """Two columns per joint: sine, cosine."""
    return np.stack([np.sin(q), np.cos(q)], axis=2).reshape(len(q), -1)


@pytest.mark.parametrize("name", ["fr3", "tree"])
def test_rows_that_are_not_filled_are_not_written(robot, name):
    """Property: `filled` is what the tile form writes; the rest is zero in CasADi's C."""
    lib = robot(name)
    inputs = arguments_of(lib, 8)["base_regressor"]
    (wanted,) = batch(lib, "casadi", "base_regressor", inputs, [lib.n_joints] * 3, 8)
    out = np.full((1, wanted.shape[1], 8), -7.0)
    function = ctypes.CDLL(lib._binding._dll._name)[f"{lib.name}_portable_base_regressor_tiles"]
    tiled = [in_tiles(x) for x in inputs]
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*tiled, out)]
    function(ctypes.c_long(1), None, *pointers)
    left = (out[0] == -7.0).all(axis=1)
    assert left.any()
    assert (wanted[:, left] == 0).all()


def test_casadi_is_never_chosen_where_there_is_another(robot):
    """Property: by name only."""
    lib = robot("gantry")
    assert lib.levels[0] == "casadi"
    assert lib.level != "casadi"
    assert load(lib.folder, "casadi").level == "casadi"


def test_unknown_level_is_refused(fr3):
    """Property: the message lists the levels that there are."""
    with pytest.raises(LibraryError, match=r"no level 'v9', it has casadi, portable"):
        load(fr3.folder, "v9")


def test_tiles_compile_for_arm(fr3, tmp_path):
    """Oracle: zig's cross compiler for 64-bit Arm; the code cannot run here."""
    pytest.importorskip("ziglang", reason="the ziglang wheel is the cross compiler")
    for file in ("tiles.c", "tiles.h", "lanes.h", "fr3.h"):
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
