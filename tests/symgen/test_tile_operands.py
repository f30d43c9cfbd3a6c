"""Operations of tiles on every kind of operand, against CasADi's C."""

import ctypes

import casadi as ca
import numpy as np

from symgen.emit.ssa import _TILE_EXPRESSIONS
from symgen.kernel import Argument, Kernel, make_kernel
from tests.symgen.compiled_toys import compiled_toy, run, runnable

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
    # Places that held a constant are taken by a result and divided by.
    again = [ca.atan2(x[0], 1.1), x[2] / x[1], 2.2 + x[0], x[2] / (x[0] * x[1] + 1.7), x[1] / x[0]]
    reused = make_kernel(
        "reused",
        {Argument("x", (3,), "1"): x},
        {Argument("y", (len(again),), "1"): ca.vertcat(*again)},
        "places used again",
    )
    assert _divides_by_a_place_of_a_constant(reused)
    dll = compiled_toy(tmp_path, (kernel, reused))
    rng = np.random.default_rng(3)
    states = rng.uniform(0.2, 2.0, (13, 3))
    states[4, 0] = 0.75  # equality with a constant, and with a shared value
    shared = np.array([1.25, 0.3])
    states[5, 0] = shared[0]
    plain = ca.Function("toy", [x, k], [ca.densify(ca.vertcat(*rows))])
    wanted = np.array([np.asarray(plain(state, shared)).ravel() for state in states])
    for level in ("casadi", *runnable(dll, "toy")):
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
