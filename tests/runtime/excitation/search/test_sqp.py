"""runtime.excitation.search.conic and .sqp on toys with known optima; no robot."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import minimize, rosen, rosen_der

from runtime.excitation.search import conic
from runtime.excitation.search.conic import SLACK, ConeBlock, LinearRows, solve
from runtime.excitation.search.sqp import QuadraticProgramme, descend


def rosenbrock(x: np.ndarray) -> tuple[float, np.ndarray]:
    return float(rosen(x)), rosen_der(x)


def box(n: int, size: float) -> LinearRows:
    return LinearRows(np.vstack([np.eye(n), -np.eye(n)]), np.full(2 * n, size))


def disc(count: int, radius: float = 1.0) -> LinearRows:
    """A regular polygon around a disc; neighbouring rows are neighbours on it."""
    angle = 2 * np.pi * np.arange(count) / count
    return LinearRows(np.stack([np.cos(angle), np.sin(angle)], axis=1), np.full(count, radius))


def test_an_optimum_inside() -> None:
    """Oracle: Rosenbrock's function is least at (1, …, 1)."""
    result = descend(rosenbrock, np.full(4, -0.5), box(4, 2.0), 300, tolerance=1e-14)
    # Newton's step of a value within 1e-14, curvature at least 0.4 (in the valley).
    assert result.x == pytest.approx(np.ones(4), abs=1e-6)
    assert result.value <= 1e-12
    assert 10 < result.iterations < 100  # plain descent needs thousands


def test_an_optimum_on_a_bound() -> None:
    """Oracle: in |x| ≤ ½ the least Rosenbrock lies at (½, ¼) with the value ¼."""
    result = descend(rosenbrock, np.array([-0.3, 0.4]), box(2, 0.5), 200, tolerance=1e-12)
    # The bound is kept to SLACK.
    assert result.x == pytest.approx([0.5, 0.25], abs=2 * SLACK)
    assert result.value == pytest.approx(0.25, abs=2 * SLACK)


def test_an_optimum_in_a_corner_of_many_rows() -> None:
    """Oracle: a linear function on a polygon of 1000 sides, whose corners are known."""
    rows, corner = disc(1000), np.pi * 0.501
    want = np.array([np.cos(corner), np.sin(corner)]) / np.cos(np.pi / 1000)
    result = descend(lambda x: (float(-want @ x), -want), np.zeros(2), rows, tolerance=1e-12)
    # Nearly flat corner: the place is only as good as SLACK over its angle of 6e-3.
    assert -result.value == pytest.approx(want @ want, rel=2 * SLACK)
    assert result.x == pytest.approx(want, abs=1e-3)
    # Of a thousand rows a handful were ever looked at.
    assert rows._used.sum() < 30


def test_against_scipy_on_random_problems() -> None:
    """Oracle: SLSQP on convex quartics in random polytopes, whose optimum is one."""
    rng = np.random.default_rng(0)
    for _ in range(10):
        matrix, target = rng.normal(size=(40, 6)), 3 * rng.normal(size=6)
        skew = rng.normal(size=(6, 6))

        def objective(
            x: np.ndarray, skew: np.ndarray = skew, target: np.ndarray = target
        ) -> tuple[float, np.ndarray]:
            away = skew @ (x - target)
            return float(np.sum(away**4 + away**2)), skew.T @ (4 * away**3 + 2 * away)

        scale = objective(np.zeros(6))[0]

        def scaled(x: np.ndarray, of=objective, scale: float = scale) -> tuple[float, np.ndarray]:
            value, gradient = of(x)
            return value / scale, gradient / scale

        result = descend(scaled, np.zeros(6), LinearRows(matrix, np.ones(40)), 300, tolerance=1e-10)
        keep = {"type": "ineq", "fun": lambda x, m=matrix: 1 - m @ x, "jac": lambda _, m=matrix: -m}
        oracle = minimize(
            scaled,
            np.zeros(6),
            jac=True,
            constraints=[keep],
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 500},
        )
        assert (matrix @ result.x).max() <= 1 + 2 * SLACK
        # SLACK on bounds times multipliers of at most a few times the value.
        assert result.value == pytest.approx(oracle.fun, rel=20 * SLACK)


@pytest.mark.parametrize("rounds", [1, 30])
def test_every_iterate_is_admissible_and_no_step_goes_up(
    rounds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: the objective is only asked inside, and accepted values fall.

    Also where rows that a programme has not looked at cut its step.
    """
    monkeypatch.setattr(conic, "_ROUNDS", rounds)
    rows = disc(200)
    requested: list[np.ndarray] = []

    def objective(x: np.ndarray) -> tuple[float, np.ndarray]:
        requested.append(x)
        return rosenbrock(x)

    values = [descend(objective, np.zeros(2), rows, k).value for k in range(1, 12)]
    assert all((rows.matrix @ x).max() <= 1 + 2 * SLACK for x in requested)
    assert all(after <= before for before, after in pairwise(values))
    assert values[-1] < values[0] < 1.0


def test_a_curvature_that_is_known_is_used() -> None:
    """Oracle: with its Hessian a quadratic of condition 1e4 is solved by one step."""
    hessian = np.diag([1.0, 1e4])
    result = descend(
        lambda x: (float(x @ hessian @ x) / 2, hessian @ x),
        np.array([0.7, 0.3]),
        box(2, 1.0),
        iterations=1,
        curvature=hessian,
    )
    # Clarabel's tolerance and the shift of 1e-9, on a value of 450.
    assert result.value < 1e-5


def test_a_programme_that_fails_ends_the_descent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: without a direction the start is what is returned."""
    monkeypatch.setattr(QuadraticProgramme, "solve", lambda *_: None)
    result = descend(rosenbrock, np.zeros(2), box(2, 0.5), curvature=2 * np.eye(2))
    assert (result.iterations, result.value) == (0, 1.0)


def test_a_quadratic_programme() -> None:
    """Oracle: the projection of (3, 0) on a disc of many sides is (1, 0); its dual is 2."""
    rows = disc(8)
    x, (dual,) = solve(np.eye(2), np.array([-3.0, 0.0]), [ConeBlock(rows.matrix, rows.bound)])
    # Clarabel's tolerance times a few.
    assert x == pytest.approx([1.0, 0.0], abs=1e-7)
    assert dual == pytest.approx([2.0, *[0.0] * 7], abs=1e-7)


def test_a_semidefinite_programme() -> None:
    """Oracle: the smallest t with t I − M ⪰ 0 is the largest eigenvalue; its dual is v vᵀ."""
    matrix = np.array([[2.0, 1.0], [1.0, -1.0]])
    values, vectors = np.linalg.eigh(matrix)
    triangle = np.array([2.0, np.sqrt(2.0), -1.0])
    block = ConeBlock(np.array([[-1.0], [0.0], [-1.0]]), -triangle, order=2)
    x, (dual,) = solve(np.zeros((1, 1)), np.ones(1), [block])
    assert x == pytest.approx(values[-1:], abs=1e-7)
    top = np.outer(vectors[:, 1], vectors[:, 1])
    assert dual == pytest.approx([top[0, 0], np.sqrt(2) * top[0, 1], top[1, 1]], abs=1e-6)


def test_an_infeasible_programme_is_none() -> None:
    """Property: x ≤ −1 and x ≥ 1 have no solution."""
    block = ConeBlock(np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0]))
    assert solve(np.eye(1), np.ones(1), [block]) is None


def test_rows_are_added_until_all_are_kept() -> None:
    """Property: a step past rows that were not looked at comes back inside, or is cut."""
    rows = disc(500)
    result = rows.solve(
        np.zeros(2), lambda a, b: solve(np.eye(2), np.array([-2.0, -3.0]), [ConeBlock(a, b)])
    )
    assert result is not None
    assert (rows.matrix @ result[0]).max() <= 1 + SLACK
    assert rows.reach(np.zeros(2), 4 * result[0]) == pytest.approx(0.25, rel=1e-5)
    assert rows.reach(np.zeros(2), 0.5 * result[0]) == 1.0
    # A quarter of the five hundred is violated by the first step; only peaks are taken in.
    assert rows._used.sum() < 15


def test_rounding_at_a_bound_stops_nothing() -> None:
    """Property: on a bound, or past it by rounding, one may still move along it."""
    for over in (0.0, 1e-9):
        x = np.array([1.0 + over, 0.0])
        assert box(2, 1.0).reach(x, np.array([1e-10, 0.5])) == 1.0
        assert (box(2, 1.0).slack(x) >= 0).all()


def test_rounds_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: with one round only, `reach` cuts what the rows not looked at would not allow."""
    monkeypatch.setattr(conic, "_ROUNDS", 1)
    rows = disc(500)
    result = rows.solve(
        np.zeros(2), lambda a, b: solve(np.eye(2), np.array([-2.0, -3.0]), [ConeBlock(a, b)])
    )
    assert result is not None
    assert (rows.matrix @ result[0]).max() > 1.01
    assert (rows.matrix @ (rows.reach(np.zeros(2), result[0]) * result[0])).max() <= 1 + 2 * SLACK


def test_products_joint_by_joint_are_those_of_the_matrix() -> None:
    """Oracle: A x, for rows of two joints in turn, dense rows and an empty one."""
    rng = np.random.default_rng(4)
    joints = np.kron(np.eye(2), rng.normal(size=(6, 3)))[rng.permutation(12)]
    for matrix in (joints, rng.normal(size=(9, 6)), np.vstack([joints, np.zeros(6)])):
        x = rng.normal(size=6)
        product = LinearRows(matrix, np.ones(len(matrix))).times(x)
        assert product == pytest.approx(matrix @ x, abs=1e-14)  # rounding of six products
