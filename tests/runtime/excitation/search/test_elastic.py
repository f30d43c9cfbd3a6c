"""Rows that are not linear in sqp and polish: toys with known optima; no robot."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize, rosen, rosen_der

from runtime.excitation.search.conic import Curved, LinearRows, corrected
from runtime.excitation.search.semidefinite_polish import polish
from runtime.excitation.search.sqp import descend


class Discs:
    """|x − centre_k|² ≤ r_k²: numbers are not neighbours unless `joined`."""

    def __init__(self, centres: np.ndarray, radii: np.ndarray, near: float = -1e9) -> None:
        self.centres, self.radii, self._near = centres, radii, near

    def values(self, x: np.ndarray, numbers: NDArray[np.intp] | slice = slice(None)) -> np.ndarray:
        all_values = ((x - self.centres) ** 2).sum(axis=1) / self.radii**2 - 1
        return np.asarray(all_values[numbers])

    def violation(self, x: np.ndarray) -> float:
        return max(0.0, float(self.values(x).max()))

    def near(self, x: np.ndarray) -> tuple[NDArray[np.intp], np.ndarray, np.ndarray]:
        values = self.values(x)
        numbers = np.flatnonzero(values > self._near)
        return numbers, values[numbers], self.jacobian(x, numbers)

    def jacobian(self, x: np.ndarray, numbers: NDArray[np.intp]) -> np.ndarray:
        return 2 * (x - self.centres[numbers]) / self.radii[numbers, None] ** 2


def box(n: int, size: float) -> LinearRows:
    return LinearRows(np.vstack([np.eye(n), -np.eye(n)]), np.full(2 * n, size))


def rosenbrock(x: np.ndarray) -> tuple[float, np.ndarray]:
    return float(rosen(x)), rosen_der(x)


def test_the_least_rosenbrock_in_a_disc() -> None:
    """Oracle: SLSQP; the optimum lies on the circle, its multiplier is 0.15."""
    disc = Discs(np.zeros((1, 2)), np.array([0.9]))
    result = descend(
        rosenbrock, np.array([-0.4, 0.3]), box(2, 2.0), 200, tolerance=1e-12, nonlinear=disc
    )
    rule = {"type": "ineq", "fun": lambda x: -disc.values(x)}
    oracle = minimize(rosen, [0.1, 0.1], jac=rosen_der, constraints=rule, options={"ftol": 1e-14})
    # SLSQP stops at 1e-14 of f; curvature 0.4 and more.
    assert result.x == pytest.approx(oracle.x, abs=2e-6)
    assert disc.violation(result.x) <= 1e-9


def test_many_discs_against_slsqp() -> None:
    """Oracle: convex quadratics in intersections of discs in four dimensions have one optimum."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        discs = Discs(0.2 * rng.normal(size=(200, 4)), rng.uniform(1.1, 1.4, 200), near=-0.5)
        root, want = rng.normal(size=(4, 4)), rng.normal(size=4)
        hessian = root @ root.T + 0.1 * np.eye(4)

        def objective(
            x: np.ndarray, hessian: np.ndarray = hessian, want: np.ndarray = want
        ) -> tuple[float, np.ndarray]:
            return float(0.5 * x @ hessian @ x - want @ x), hessian @ x - want

        result = descend(objective, np.zeros(4), box(4, 3.0), 200, tolerance=1e-11, nonlinear=discs)
        rule = {"type": "ineq", "fun": lambda x, d=discs: -d.values(x)}
        oracle = minimize(
            lambda x, f=objective: f(x)[0],
            np.zeros(4),
            jac=lambda x, f=objective: f(x)[1],
            constraints=rule,
            options={"ftol": 1e-13, "maxiter": 500},
        )
        assert (oracle.success, discs.values(oracle.x).max() > -1e-6) == (True, True)
        # Ends when a step is expected to gain less than 1e-11, three of which may be missed.
        assert result.value == pytest.approx(oracle.fun, abs=1e-8)
        assert discs.violation(result.x) <= 1e-9


def test_a_start_outside_comes_inside() -> None:
    """Property: the penalty drives an infeasible start to the same optimum."""
    disc = Discs(np.zeros((1, 2)), np.array([0.9]))
    far = descend(
        rosenbrock, np.array([-1.7, 1.9]), box(2, 2.0), 200, tolerance=1e-12, nonlinear=disc
    )
    near = descend(
        rosenbrock, np.array([0.1, 0.1]), box(2, 2.0), 200, tolerance=1e-12, nonlinear=disc
    )
    assert far.x == pytest.approx(near.x, abs=2e-6)  # as above


def test_only_peaks_are_used() -> None:
    """Property: of rows that are neighbours the largest stands for all, until it does not."""
    angle = np.linspace(0, np.pi / 2, 101)
    discs = Discs(-np.stack([np.cos(angle), np.sin(angle)], axis=1), np.full(101, 1.5))
    x = np.array([0.35, 0.35])
    curved = Curved(discs, x)
    assert len(curved.block(3).b) == 1 + 1  # one peak and t ≥ 0
    assert not curved.grow(np.zeros(2))
    assert curved.grow(np.array([0.4, -0.4]))
    assert len(curved.block(3).b) == 2 + 1


def test_a_correction_ends_the_violation() -> None:
    """Property: what is left after it falls with the square of the violation."""
    disc = Discs(np.zeros((1, 2)), np.array([1.0]))
    left = []
    for violation in (1e-2, 1e-3):
        x = np.array([1 + violation, 0.0])
        step = corrected(disc, x)
        assert step is not None
        left.append(disc.violation(x + step))
    assert left[1] == pytest.approx(left[0] / 100, rel=0.05)  # the next term is the violation
    assert corrected(disc, np.zeros(2)) is None


def test_a_bent_step_beside_a_linear_row_is_not_cut_to_nothing() -> None:
    """Oracle: (0.5, √0.75, 0) in few evaluations, along a sphere whose correction meets a row.

    The shortest correction leads to the centre of the sphere, beyond the row x₀ ≤ 0.5: cut there
    it did nothing, and 155 evaluations went into ever shorter steps.
    """
    sphere, count = Discs(np.array([[1.0, 0.0, 0.0]]), np.array([1.0])), 0

    def objective(x: np.ndarray) -> tuple[float, np.ndarray]:
        nonlocal count
        count += 1
        return -2 * x[0] - x[1], np.array([-2.0, -1.0, 0.0])

    rows = LinearRows(np.vstack([np.eye(3), -np.eye(3)]), np.array([0.5, *5 * [3.0]]))
    start = np.array([0.5, -0.6, 0.6])
    result = descend(objective, start, rows, 200, tolerance=1e-8, nonlinear=sphere)
    assert result.value == pytest.approx(-1 - np.sqrt(0.75), abs=1e-6)  # 1e-8 per step, SLACK
    assert count < 40


class Stretched:
    """C = diag(e^x₀, e^x₁, 1) is best conditioned at 0; rows keep x away from there."""

    def at(self, points: np.ndarray) -> np.ndarray:
        return np.stack([np.diag([*np.exp(x), 1.0]) for x in points])

    def slopes(self, points: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.at(points), np.diag(weight)[:2] * np.exp(points)


def test_the_polish_ends_on_a_curved_row() -> None:
    """Oracle: log cond on a fine grid of the circle that keeps the optimum, the origin, out."""
    disc = Discs(np.array([[1.0, 0.3]]), np.array([0.5]))
    result = polish(Stretched(), np.array([1.2, 0.5]), box(2, 3.0), 60, 1e-10, disc)
    grid = np.linspace(0, 2 * np.pi, 200_001)
    circle = np.array([1.0, 0.3]) + 0.5 * np.stack([np.cos(grid), np.sin(grid)], axis=1)
    spread = np.ptp(np.column_stack([circle, np.zeros(len(circle))]), axis=1) / 2
    # The circle's points lie 3e-5 apart; the merit stops at 1e-10, and log cond bends with 1/0.5.
    assert result.value == pytest.approx(spread.min(), abs=1e-8)
    assert disc.violation(result.x) <= 1e-9
    assert (np.diff(result.history) < 0).all()
