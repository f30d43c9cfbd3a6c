"""The emitter on toys: every operation, every constant, every file; never a robot."""

import ctypes
import json
import math
import re
import struct
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from symgen.emit.files import emit
from symgen.emit.sample import SHORT, c_body, reference_code
from symgen.emit.ssa import EXPRESSIONS, c_constant
from symgen.errors import BuildError
from symgen.kernel import Argument, Kernel, make_kernel
from tests.symgen.builds import compile_library
from tests.symgen.compiled_toys import FACTS, VERSIONS, assert_accepted, write_toy

x_, y_ = Argument("x", (1,), "1"), Argument("y", (1,), "1")

UNARY = {
    ca.OP_NEG: lambda x: -x,
    ca.OP_SQ: lambda x: x * x,
    ca.OP_TWICE: lambda x: x + x,
    ca.OP_INV: lambda x: 1 / x,
    ca.OP_SQRT: ca.sqrt,
    ca.OP_EXP: ca.exp,
    ca.OP_LOG: ca.log,
    ca.OP_SIN: ca.sin,
    ca.OP_COS: ca.cos,
    ca.OP_TANH: ca.tanh,
    ca.OP_FABS: ca.fabs,
    ca.OP_NOT: ca.logic_not,
}
BINARY = {
    ca.OP_ADD: lambda x, y: x + y,
    ca.OP_SUB: lambda x, y: x - y,
    ca.OP_MUL: lambda x, y: x * y,
    ca.OP_DIV: lambda x, y: x / y,
    ca.OP_ATAN2: ca.atan2,
    ca.OP_FMIN: ca.fmin,
    ca.OP_FMAX: ca.fmax,
    ca.OP_LT: lambda x, y: x < y,
    ca.OP_LE: lambda x, y: x <= y,
    ca.OP_EQ: lambda x, y: x == y,
    ca.OP_NE: lambda x, y: x != y,
    ca.OP_AND: ca.logic_and,
    ca.OP_OR: ca.logic_or,
    ca.OP_IF_ELSE_ZERO: lambda x, y: ca.if_else(x, y, 0),
}
TRANSCENDENTAL = {ca.OP_EXP, ca.OP_LOG, ca.OP_SIN, ca.OP_COS, ca.OP_TANH, ca.OP_ATAN2}

VALUES = [0.0, -0.0, 1.0, -1.0, 0.5, -0.3, 1e-8, 3.0, -3.0, 40.0, 1e300, -1e300, math.pi, 2.0]


def toy(name: str, expression: ca.SX, x: ca.SX, y: ca.SX) -> Kernel:
    return make_kernel(name, {x_: x, y_: y}, {Argument("out", (1,), "1"): expression}, "toy")


def toys() -> dict[int, Kernel]:
    """One kernel per operation that the emitter supports."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    kernels = {op: toy(f"op_{op}", function(x), x, y) for op, function in UNARY.items()}
    kernels |= {op: toy(f"op_{op}", function(x, y), x, y) for op, function in BINARY.items()}
    return kernels


def compiled(kernels: tuple[Kernel, ...], folder: Path, name: str = "toy") -> ctypes.CDLL:
    for file, text in emit(name, kernels, FACTS, VERSIONS).items():
        (folder / file).write_text(text)
    target = folder / f"lib{name}.so"
    compile_library([folder / "kernels.c", folder / "reference.c"], target)
    return ctypes.CDLL(str(target))


# What the README's template wants to know of a robot.
def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """The caller keeps the array."""
    return ctypes.c_void_p(array.ctypes.data)


def evaluate(dll: ctypes.CDLL, name: str, x: float, y: float) -> float:
    a, b, out = np.array([x]), np.array([y]), np.array([np.nan])
    dll[f"toy_{name}"](pointer(a), pointer(b), pointer(out))
    return float(out[0])


def test_every_operation_has_a_toy() -> None:
    """Property: the table of the emitter and the toys of this file cover each other."""
    assert set(UNARY) | set(BINARY) | {ca.OP_ASSIGN} == set(EXPRESSIONS)
    for op, kernel in toys().items():
        assert op in {step.op for step in kernel.instructions}, op


def test_every_operation_equals_casadi(tmp_path: Path) -> None:
    """Oracle: CasADi's own virtual machine, at signs, zeros, huge numbers and ±inf results."""
    kernels = toys()
    dll = compiled(tuple(kernels.values()), tmp_path)
    for op, kernel in kernels.items():
        for x in VALUES:
            for y in VALUES if op in BINARY else VALUES[:1]:
                ours = evaluate(dll, kernel.name, x, y)
                expected = float(kernel.function(x, y))
                # libm's own functions may be a vectorised or older twin: 2 ulp apart at most.
                rel = 2.0**-51 if op in TRANSCENDENTAL else 0.0
                assert ours == pytest.approx(expected, rel=rel, abs=0.0, nan_ok=True), (op, x, y)


def test_assignment() -> None:
    """Oracle: CasADi's copy instruction, which its simplifier rarely leaves behind."""
    assert EXPRESSIONS[ca.OP_ASSIGN].format("a") == "a"


def test_precedence(tmp_path: Path) -> None:
    """Oracle: CasADi's machine on expressions that nest, negate and branch."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    expressions = {
        "nested": 1 / (-x - (y - x) * -2.5) - (-(x * y)) / (x - y),
        "branch": ca.if_else(ca.logic_or(x < -y, ca.logic_not(y == 2)), -x / y, x - -y),
        "constants": -1e-300 + x * -3.0 - (-7.0) / y + 5e300 * 0.0 * x,
    }
    kernels = tuple(toy(name, expression, x, y) for name, expression in expressions.items())
    dll = compiled(kernels, tmp_path)
    for kernel in kernels:
        for a, b in [(0.3, 2.0), (-4.0, 0.7), (1.0, -1.0)]:
            ours, expected = evaluate(dll, kernel.name, a, b), float(kernel.function(a, b))
            # Where the machine has fused multiply-add, each of the few products may skip one
            # rounding.
            assert ours == pytest.approx(expected, rel=16 * 2.0**-52), kernel.name


def test_shapes_and_batches(tmp_path: Path) -> None:
    """Oracle: a 2×3 output is dense and row-major, batches step, and `summed` adds up in order."""
    v_, s_ = Argument("v", (3,), "1"), Argument("s", (1,), "1")
    v, s = v_.symbol(), s_.symbol()
    rows = ca.vertcat(ca.horzcat(v[0], 0, v[1]), ca.horzcat(s * v[2], 7, 0))
    outputs = {
        Argument("rows", (2, 3), "1"): rows,
        Argument("total", (3,), "1", summed=True): s * v,
    }
    kernel = make_kernel("grid", {v_: v, s_: s}, outputs, "toy")
    function = compiled((kernel,), tmp_path).toy_casadi_grid_batch
    vs, ss = np.arange(12.0).reshape(4, 3), np.array([10.0])
    out, total = np.full((4, 2, 3), np.nan), np.full(3, np.nan)
    step = ctypes.c_long
    function(step(4), pointer(vs), step(3), pointer(ss), step(0), pointer(out), pointer(total))
    for k in range(4):
        np.testing.assert_array_equal(out[k], [[vs[k, 0], 0, vs[k, 1]], [10 * vs[k, 2], 7, 0]])
    np.testing.assert_array_equal(total, (10 * vs).sum(axis=0))
    function(step(0), pointer(vs), step(3), pointer(ss), step(0), pointer(out), pointer(total))
    np.testing.assert_array_equal(total, np.zeros(3))


def test_declared_shape_is_checked() -> None:
    """Property: an expression of another shape than declared is refused by name."""
    x = ca.SX.sym("x")
    with pytest.raises(BuildError, match=r"kernel 'k': output 'out' is declared \(2, 1\)"):
        make_kernel("k", {x_: x}, {Argument("out", (2,), "1"): x}, "toy")


def test_values_that_are_read_once_have_no_name() -> None:
    """Property: a name for what is read twice, squared or long; the order of rounding is kept."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    assert c_body(toy("once", (x - y) * x - 1, x, y)) == ["out[0] = ((x[0] - y[0]) * x[0]) - 1.0;"]
    squared = c_body(toy("squared", (x - y) ** 2, x, y))
    assert [line.startswith("const double") for line in squared] == [True, False]
    chain = x
    for k in range(40):
        chain = ca.sin(chain + k * y)
    lines = c_body(toy("long", chain, x, y))
    assert 1 < len(lines) < 40
    assert max(map(len, lines)) < 2 * SHORT


def test_unknown_operation_is_named() -> None:
    """Property: an instruction without C text is a BuildError, never wrong code."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    with pytest.raises(BuildError, match=rf"kernel 'gauss' uses .* {ca.OP_ERF}, .* symgen\.emit"):
        c_body(toy("gauss", ca.erf(x), x, y))


def test_reference_is_casadi_to_the_letter() -> None:
    """Oracle: CasADi's own file; all bodies are there, unchanged, and nothing else is visible."""
    kernels = tuple(toys().values())
    text = emit("toy", kernels, FACTS, VERSIONS)["reference.c"]
    generator = ca.CodeGenerator("other", {"casadi_int": "long"})
    for kernel in kernels:
        generator.add(kernel.function)
    dumped = generator.dump()
    bodies = re.findall(r"^static int casadi_f\d+\(.*?\n}\n", dumped, re.MULTILINE | re.DOTALL)
    assert len(bodies) == len(kernels)
    for body in bodies:
        assert body in text
    heads = re.findall(r"^[a-z].*\)(?: \{.*)?$", text, re.MULTILINE)
    assert all(line.startswith(("static ", "void toy_casadi_")) for line in heads)


def test_casadi_that_writes_otherwise_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: a file laid out in another way is one sentence, never half a reference."""

    class Other:
        def __init__(self, *_: object) -> None: ...

        def add(self, _: object) -> None: ...

        def dump(self) -> str:
            return "int f(void) { return 0; }"

    monkeypatch.setattr(ca, "CodeGenerator", Other)
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    with pytest.raises(BuildError, match=r"laid out differently .* install the version"):
        reference_code((toy("sum", x + y, x, y),))


@given(st.floats(allow_nan=False, allow_infinity=False))
@example(0.1)
@example(-0.0)
@example(5e-324)
@example(1e22)
@example(-3.0)
def test_constants_keep_all_digits(value: float) -> None:
    """Property: the C text reads back as the same 64 bits and is never an integer literal."""
    text = c_constant(value)
    assert struct.pack("d", float(text.strip("()"))) == struct.pack("d", value)
    assert any(mark in text for mark in ".e")
    # Parentheses keep a minus sign from meeting the operator before it.
    assert text.startswith("(-") == (math.copysign(1.0, value) < 0)


def test_strictest_c99(tmp_path: Path) -> None:
    """Oracle: the compiler, with every warning an error, C99 and no extension."""
    write_toy(tmp_path, tuple(toys().values()))
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion"]
    assert_accepted(tmp_path, [*flags, "kernels.c", "reference.c"])


def test_header_tells_order_units_and_stack(tiny_built: Path) -> None:
    """Property: the header alone documents every argument."""
    header = (tiny_built / "tiny.h").read_text()
    facts = json.loads((tiny_built / "manifest.json").read_text())
    assert ", ".join(joint["name"] for joint in facts["joints"]) in header
    assert ", ".join(facts["pi_names"]) in header
    mass = header[: header.index("void tiny_mass_matrix")].splitlines()[-2:]
    assert "bytes of stack" in mass[0]
    assert mass[1].startswith(" * q [")
    assert "-> M" in mass[1]


def test_robot_code_is_strict_c99_and_its_header_cpp(tiny_built: Path) -> None:
    """Oracle: the compilers, on the pendulum's real kernels and on its header as C++."""
    for tool, words in {
        "gcc": ["-std=c99", "-pedantic", "-Wconversion", "kernels.c", "reference.c"],
        "g++": ["-std=c++11", "-pedantic", "-x", "c++", "tiny.h"],
    }.items():
        assert_accepted(tiny_built, ["-Wall", "-Wextra", "-Werror", *words], (tool,))


def test_equal_input_gives_equal_bytes() -> None:
    """Property: emitting twice, from symbols made twice, gives the same bytes and hash."""
    first, second = (emit("toy", tuple(toys().values()), FACTS, VERSIONS) for _ in range(2))
    assert first == second
    other = emit("toy", tuple(toys().values()), FACTS | {"pi0": [2.0]}, VERSIONS)
    known, model_hash = (json.loads(one["manifest.json"])["model_hash"] for one in (other, first))
    assert known != model_hash
    assert model_hash in first["kernels.c"]


def test_names_are_not_a_robot_s(tmp_path: Path) -> None:
    """Oracle: y = x² by any name, through ctypes; the hash function answers."""
    x = ca.SX.sym("x")
    kernel = make_kernel("square", {x_: x}, {y_: x * x}, "y = x^2")
    dll = compiled((kernel,), tmp_path, "parabola")
    x_in, out = np.array([-3.0]), np.empty(1)
    dll.parabola_square(pointer(x_in), pointer(out))
    assert out[0] == 9.0
    dll.parabola_model_hash.restype = ctypes.c_char_p
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert dll.parabola_model_hash().decode() == manifest["model_hash"]
    assert manifest["kernels"][0]["operations"] == 1
