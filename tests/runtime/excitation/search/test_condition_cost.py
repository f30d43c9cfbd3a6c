"""The compiled excitation cost: against LAPACK on every level, by Taylor, at its edges."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from runtime import load
from runtime.excitation import ConditionCost, Trajectory, log_condition
from runtime.excitation.motion.trajectory import fourier_basis
from runtime.library import Library
from runtime.library.compiled_programs import CompiledExcitation
from tests.robots import levels_here
from tests.taylor import assert_second_order, taylor_slope

DURATION, HARMONICS = 10.0, 5
EPS = np.finfo(float).eps
SCALE = np.array([1.0, 0.25, 0.1, 0.06, 0.04])
"""Of the coefficients, so that every harmonic moves the joints about as fast."""


def at_every_level(lib: Library) -> list[Library]:
    return [load(lib.folder, level) for level in levels_here(lib)]


def by_numpy(lib: Library, basis: np.ndarray, a: np.ndarray) -> tuple[float, np.ndarray]:
    """Kernels one by one, matrices by LAPACK."""
    motion = np.einsum("jm,tmd->dtj", a, basis)
    q, dq, ddq = motion[0] + lib.home, motion[1], motion[2]
    y = lib.base_regressor(q, dq, ddq)
    value, slope = log_condition(y.reshape(-1, y.shape[-1]))
    adjoint = lib.regressor_adjoint(q, dq, ddq, y @ slope)
    return value, np.einsum("tdj,tmd->jm", adjoint, basis)


def assert_same(got: tuple[float, np.ndarray], wanted: tuple[float, np.ndarray]) -> None:
    # Both work on the Gram matrix, where rounding counts cond² times; the vectors feel it divided
    # by the gap of the eigenvalues, for which a hundred is enough on all these robots.
    rounding = EPS * np.exp(2 * wanted[0])
    assert abs(got[0] - wanted[0]) <= 2e-15 + 4 * rounding
    assert np.abs(got[1] - wanted[1]).max() <= (1e-12 + 400 * rounding) * np.abs(wanted[1]).max()


@pytest.mark.parametrize("name", ["fr3", "ur5", "tree", "gantry", "double"])
def test_the_cost_is_that_of_lapack_on_all_levels(any_robot, name: str) -> None:
    """Oracle: numpy.linalg.eigh on the regressor of the portable kernels."""
    lib = any_robot(name)
    levels = at_every_level(lib)
    rng = np.random.default_rng(0)
    for duration, size in ((10.0, 0.2), (10.0, 0.5), (4.0, 0.2)):
        costs = [ConditionCost(one, lib.home, HARMONICS, duration) for one in levels]
        for _ in range(10):
            a = size * SCALE * rng.normal(size=(lib.n_joints, HARMONICS))
            wanted = costs[0].by_numpy(a)
            for cost in costs:
                got = cost.value_gradient(a)
                assert_same(got, wanted)
                assert cost.compiled is not None
                assert cost.compiled.value(a) == got[0]
                assert not cost.compiled._local.place.job.deficient


def test_gradient_by_taylor_on_all_levels(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Derivative: the compiled gradient along coefficients that move in proportion to their size.

    The direction is one that keeps to the quadratic for long; by LAPACK it is as many decades.
    """
    a = 0.8 * trajectories[1].coefficients
    direction = a * np.random.default_rng(1).normal(size=a.shape)
    for one in at_every_level(lib):
        cost = ConditionCost(one, lib.home, HARMONICS, DURATION).compiled
        assert cost is not None
        slope = float(np.sum(cost.value_gradient(a)[1] * direction))
        measured = taylor_slope(
            lambda x, cost=cost: cost.value(x.reshape(a.shape)), a.ravel(), direction.ravel(), slope
        )
        assert_second_order(measured)


@pytest.mark.parametrize("samples", [13, 16, 33, 39, 41])
def test_samples_that_fill_no_tile(lib: Library, samples: int) -> None:
    """Oracle: as above; lanes beyond the last sample must not count."""
    basis = fourier_basis(lib, 3, np.linspace(0.1, 7.0, samples), DURATION)[..., :3]
    a = 0.3 * SCALE[:3] * np.random.default_rng(samples).normal(size=(7, 3))
    wanted = by_numpy(lib, basis, a)
    for one in at_every_level(lib):
        cost = CompiledExcitation.of(one.binding, lib.home, basis)
        assert cost is not None
        for _ in range(2):  # what the first call leaves behind must not count, either
            assert_same(cost.value_gradient(a), wanted)


@pytest.mark.parametrize("case", ["rest", "one joint", "few samples"])
def test_a_regressor_without_full_rank(lib: Library, case: str) -> None:
    """Property: the cost is that of cond = (n_b ε)^-½, finite with its gradient, and flagged."""
    samples = 3 if case == "few samples" else 40
    basis = fourier_basis(lib, 3, np.linspace(0.1, 4.9, samples), DURATION)[..., :3]
    a = 0.3 * SCALE[:3] * np.random.default_rng(0).normal(size=(7, 3))
    if case != "few samples":
        a[0 if case == "rest" else 1 :] = 0.0
    columns = len(lib.base_columns)
    for one in at_every_level(lib):
        cost = CompiledExcitation.of(one.binding, lib.home, basis)
        assert cost is not None
        value, gradient = cost.value_gradient(a)
        assert cost._local.place.job.deficient
        # λ₊ cancels; rounding of a logarithm of 15.
        assert value == pytest.approx(-np.log(columns * EPS) / 2, rel=1e-14)
        assert by_numpy(lib, basis, a)[0] == pytest.approx(value, rel=1e-14)
        assert np.isfinite(gradient).all()


def test_a_pendulum(tiny_built) -> None:
    """Oracle: as above, for the fewest columns a robot can have."""
    pendulum = load(tiny_built)
    cost = ConditionCost(pendulum, pendulum.home, 2, 4.0)
    a = np.array([[0.4, -0.1]])
    assert_same(cost.value_gradient(a), cost.by_numpy(a))


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_numbers_that_are_none(lib: Library, bad: float) -> None:
    """Property: NaN in the coefficients is NaN in the cost, and it leaves no trace."""
    cost = ConditionCost(lib, lib.home, HARMONICS, DURATION)
    good = 0.3 * SCALE * np.random.default_rng(0).normal(size=(7, HARMONICS))
    before = cost.value_gradient(good)
    spoilt = good.copy()
    spoilt[3, 2] = bad
    assert np.isnan(cost.value_gradient(spoilt)[0])
    after = cost.value_gradient(good)
    assert after[0] == before[0]
    assert np.array_equal(after[1], before[1])


def test_threads_share_one_cost(lib: Library) -> None:
    """Property: two threads at once give to the bit what one gives."""
    cost = ConditionCost(lib, lib.home, HARMONICS, DURATION)
    points = 0.3 * SCALE * np.random.default_rng(0).normal(size=(400, 7, HARMONICS))
    alone = [cost.value_gradient(a) for a in points]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(cost.value_gradient, points))
    for one, other in zip(alone, together, strict=True):
        assert one[0] == other[0]
        assert np.array_equal(one[1], other[1])
