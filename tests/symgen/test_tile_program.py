"""Tiles of toys: what is written, every operation; sin, cos and exp to the last place."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from runtime.library.binding import LEVELS
from symgen.build.compiler import compile_library
from symgen.emit import emit, tile_program
from symgen.emit.ssa import _TILE_EXPRESSIONS, EXPRESSIONS
from symgen.errors import BuildError
from symgen.kernel import Argument, Kernel, make_kernel


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


def test_equal_divisors_are_inverted_once():
    """Property: per-sample divisors by one division in the body, shared ones ahead of it."""
    x, k = ca.SX.sym("x", 3), ca.SX.sym("k", 1)
    kernel = make_kernel(
        "toy",
        {Argument("x", (3,), "1"): x, Argument("k", (1,), "1", shared=True): k},
        {Argument("out", (4,), "1"): ca.vertcat(x[0] / x[2], x[1] / x[2], x[0] / k, x[1] / k)},
        "toy",
    )
    program = tile_program(kernel)
    assert sum(" / " in line for line in program.body) == 1
    assert sum(" / " in line for line in program.prepare) == 1
    assert program.uniform == 1


def test_an_input_in_the_place_of_a_constant_is_divided_by():
    """Oracle: (x0 − 3.5) / x1, where x1 takes the place that held 3.5 in CasADi's work vector."""
    x = ca.SX.sym("x", 2)
    kernel = make_kernel(
        "toy", {Argument("x", (2,), "1"): x}, {Argument("y", (1,), "1"): (x[0] - 3.5) / x[1]}, ""
    )
    (_, _, held, _), (_, _, last, _) = kernel.instructions[1], kernel.instructions[3]
    assert held == last, "CasADi orders the work vector in another way; find another expression"
    body = "".join(tile_program(kernel).body)
    assert "/ x[1 * VS]" in body
    assert "0.2857" not in body


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
    nodes = np.arange(-256, 257) * (np.pi / 128)  # of the table, and halfway between them
    x = np.concatenate(
        [
            rng.uniform(-10, 10, 40000),
            rng.uniform(-1e5, 1e5, 40000),
            near,
            near + rng.normal(0, 1e-8, near.size),
            (nodes + rng.normal(0, 1e-4, (50, 1))).ravel(),
            rng.uniform(51471.0, 51473.0, 2000),  # where the C library takes over
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
    """Oracle: the C library, which takes over beyond 5e4; NaN and infinity give NaN alone."""
    dll, _ = toy
    x = np.array([5.2e4, 1e6, -3e8, 1e22, 2.0, np.inf, -np.inf, np.nan, 0.5, 1e300])[:, None]
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


BINARY = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "atan2": ca.atan2,
    "fmin": ca.fmin,
    "fmax": ca.fmax,
    "lt": lambda a, b: ca.if_else(a < b, 1.5, -2.0),
    "le": lambda a, b: ca.if_else(a <= b, a, 2.5),
    "eq": lambda a, b: ca.if_else(a == b, a, 3.5),
    "ne": lambda a, b: ca.if_else(a != b, a, 4.5),
    "and": lambda a, b: ca.if_else(ca.logic_and(a > 1, b > 1), a, b),
    "or": lambda a, b: ca.if_else(ca.logic_or(a > 1, b > 1), a, b),
    "pair": lambda a, b: ca.sin(a + b) * ca.cos(a + b) - ca.cos(b),
}


def test_every_operation_on_every_kind_of_operand(tmp_path):
    """Oracle: CasADi's C. Operands: of a sample, shared, computed of shared ones, constant.

    Outputs too: shared values, constants and zero are written as well; places of the work vector
    are used again, so that a value once constant must not stay one.
    """
    x, k = ca.SX.sym("x", 3), ca.SX.sym("k", 2)
    operands = [x[0], x[1] * x[2], k[0], ca.exp(k[1]), ca.SX(0.75), ca.SX(-3.0)]
    rows = [op(a, b) for op in BINARY.values() for a in operands for b in operands]
    rows += [k[0], ca.exp(k[0]), ca.SX(2.0), ca.SX(0.0), x[0], -k[1], x[1] / k[0] / x[2] / k[0]]
    kernel = make_kernel(
        "toy",
        {Argument("x", (3,), "1"): x, Argument("k", (2,), "1", shared=True): k},
        {Argument("y", (len(rows),), "1"): ca.densify(ca.vertcat(*rows))},
        "operands",
    )
    facts = {
        "gravity": [0, 0, 0], "base": "", "tip": "", "base_parameters": {"columns": []}, "pi0": [],
        "joints": [], "pi_names": [], "lam_names": [], "torque_rate": None, "tip_speed": None,
        "braking": None, "proxy": [], "pair": [], "moving_proxies": [],
    }  # fmt: skip
    # Places that held a constant are taken by a result and divided by.
    again = [ca.atan2(x[0], 1.1), x[2] / x[1], 2.2 + x[0], x[2] / (x[0] * x[1] + 1.7), x[1] / x[0]]
    reused = make_kernel(
        "reused",
        {Argument("x", (3,), "1"): x},
        {Argument("y", (len(again),), "1"): ca.vertcat(*again)},
        "places used again",
    )
    assert _divides_by_a_place_of_a_constant(reused)
    files = emit("toy", (kernel, reused), facts, {"symgen": "0", "casadi": "0"}).files
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    paths = [[tmp_path / name] for name in ("kernels.c", "tiles.c", "reference.c")]
    compile_library(paths[0], tmp_path / "libtoy.so", *paths[1:])
    dll = ctypes.CDLL(str(tmp_path / "libtoy.so"))
    rng = np.random.default_rng(3)
    states = rng.uniform(0.2, 2.0, (13, 3))
    states[4, 0] = 0.75  # equality with a constant, and with a shared value
    shared = np.array([1.25, 0.3])
    states[5, 0] = shared[0]
    plain = ca.Function("toy", [x, k], [ca.densify(ca.vertcat(*rows))])
    wanted = np.array([np.asarray(plain(state, shared)).ravel() for state in states])
    levels = [level for level in LEVELS if hasattr(dll, f"toy_{level}_toy_batch")]
    answer = dll["toy_level"]
    answer.restype = ctypes.c_char_p
    best = LEVELS.index(answer().decode())
    assert "portable" in levels
    for level in levels:
        if LEVELS.index(level) > best:
            continue
        out = np.full((len(states), len(rows)), -7.0)
        dll[f"toy_{level}_toy_batch"](
            ctypes.c_long(len(states)),
            ctypes.c_void_p(states.ctypes.data),
            ctypes.c_long(3),
            ctypes.c_void_p(shared.ctypes.data),
            ctypes.c_long(0),
            ctypes.c_void_p(out.ctypes.data),
        )
        # A product by an inverse and our sine and arc tangent: some units in the last place.
        np.testing.assert_allclose(out, wanted, rtol=4e-15, atol=4e-15, err_msg=level)
        others = np.array(
            [
                np.asarray(ca.Function("toy", [x], [ca.vertcat(*again)])(state)).ravel()
                for state in states
            ]
        )
        np.testing.assert_allclose(
            run(dll, level, "reused", states, len(again)), others, rtol=4e-15, err_msg=level
        )


def _divides_by_a_place_of_a_constant(kernel: Kernel) -> bool:
    """Whether a divisor stands where a constant stood before a result replaced it."""
    constants, replaced = set(), set()
    for op, ins, outs, _ in kernel.instructions:
        if op == ca.OP_DIV and ins[1] in replaced:
            return True
        if op == ca.OP_CONST:
            constants.add(outs[0])
            replaced.discard(outs[0])
        elif op in _TILE_EXPRESSIONS and outs[0] in constants:
            replaced.add(outs[0])
    return False
