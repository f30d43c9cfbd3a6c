"""What the emitter writes for tiles of toys."""

import casadi as ca
import pytest

from symgen.emit.ssa import _TILE_EXPRESSIONS, EXPRESSIONS, tile_program
from symgen.errors import BuildError
from symgen.kernel import Argument, make_kernel


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
