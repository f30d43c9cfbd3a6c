"""Quadratic programmes by nonnegative least squares: optimality; Clarabel."""

import numpy as np
import pytest

from runtime.excitation.search.conic import ConeBlock, solve
from runtime.excitation.search.sqp import QuadraticProgramme


def random_programme(
    seed: int, p: int = 20, m: int = 90
) -> tuple[np.ndarray, np.ndarray, ConeBlock]:
    """Convex programme whose rows leave the origin inside."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(p, p))
    rows = ConeBlock(rng.normal(size=(m, p)), rng.uniform(0.0, 1.0, m))
    return root @ root.T + 0.01 * np.eye(p), 10 * rng.normal(size=p), rows


@pytest.mark.parametrize("seed", range(3))
def test_the_solution_is_optimal(seed: int) -> None:
    """Property: rows kept, multipliers of active rows alone, no gradient of the Lagrangian."""
    quadratic, linear, rows = random_programme(seed)
    halves = [ConeBlock(rows.a[:40], rows.b[:40]), ConeBlock(rows.a[40:], rows.b[40:])]
    solution = QuadraticProgramme(quadratic, linear).solve(halves)
    assert solution is not None
    x, duals = solution
    assert [len(dual) for dual in duals] == [40, 50]
    lam, slack = np.concatenate(duals), rows.b - rows.a @ x
    # Rounding of a factor with cond 1e3 on numbers of size 10.
    assert slack.min() > -1e-10
    assert lam.min() >= 0
    assert np.abs(lam * slack).max() < 1e-9
    assert np.abs(quadratic @ x + linear + rows.a.T @ lam).max() < 1e-9
    assert 0 < (lam > 0).sum() <= 20  # some rows are active, never more than unknowns


def test_against_the_interior_point() -> None:
    """Oracle: Clarabel, to its tolerance of 1e-9 over the smallest curvature of 0.01."""
    quadratic, linear, rows = random_programme(7)
    exact, conic = (
        QuadraticProgramme(quadratic, linear).solve([rows]),
        solve(quadratic, linear, [rows]),
    )
    assert exact is not None
    assert conic is not None
    assert exact[0] == pytest.approx(conic[0], abs=1e-6)


def test_without_active_rows_it_is_the_step_of_newton() -> None:
    """Oracle: x = −P⁻¹ q far inside all rows; the multipliers are zero."""
    quadratic, linear, rows = random_programme(1)
    far = ConeBlock(rows.a, rows.b + 1e6)
    x, (lam,) = QuadraticProgramme(quadratic, linear).solve([far])
    assert x == pytest.approx(-np.linalg.solve(quadratic, linear), rel=1e-8)
    assert not lam.any()


def test_what_has_no_solution_is_none() -> None:
    """Property: x ≤ −1 with x ≥ 1, and an indefinite objective, give no numbers."""
    apart = ConeBlock(np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0]))
    assert QuadraticProgramme(np.eye(1), np.ones(1)).solve([apart]) is None
    assert QuadraticProgramme(-np.eye(1), np.ones(1)).solve([apart]) is None
