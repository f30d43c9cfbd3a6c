"""Every operation on tiles of toys against CasADi's C; sin, cos and exp to the last place."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from symgen.kernel import Argument, Kernel, make_kernel
from tests.symgen.compiled_toys import compiled_toy, run, runnable


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
    pairs = (
        of_x("pair", ca.sin(x), ca.cos(x)),  # by way of `sines`
        of_x("doubled", ca.sin(x + x), ca.cos(x + x)),  # by way of `vd_sincos`
        of_x("power", ca.exp(x)),
    )
    return compiled_toy(folder, (kernel, *pairs)), kernel


@pytest.mark.parametrize("n", [1, 7, 8, 9, 64])
def test_every_operation_equals_casadi(toy, n):
    """Oracle: CasADi's C; also where the last tile is not full."""
    dll, kernel = toy
    rng = np.random.default_rng(n)
    x = np.column_stack([rng.normal(size=n), rng.normal(size=n), rng.uniform(0.1, 3, n)])
    x[0, 1] = x[0, 0]  # equality is hit
    wanted = run(dll, "casadi", "toy", x, kernel.outputs[0].size)
    for level in runnable(dll, "pair"):
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
    for level in runnable(dll, "pair"):
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
    for level in runnable(dll, "pair"):
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
    for level in runnable(dll, "pair"):
        error = units_off(run(dll, level, "power", x, 1)[:, 0], exact)
        assert error.max() <= 2.0, (level, x[np.argmax(error)])


def test_exp_at_its_ends(toy):
    """Oracle: the definition at infinity and beyond the largest and smallest number; NaN stays."""
    dll, _ = toy
    x = np.array([np.inf, -np.inf, np.nan, 710.0, 1e300, -746.0, -1e300, -740.0, 0.0, 1.0])
    wanted = np.array([np.inf, 0, np.nan, np.inf, np.inf, 0, 0, np.exp(-740.0), 1, np.e])
    for level in runnable(dll, "pair"):
        got = run(dll, level, "power", x[:, None], 1)[:, 0]
        np.testing.assert_allclose(got, wanted, rtol=2.0**-51, atol=0, err_msg=level)
