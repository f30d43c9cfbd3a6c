"""Steps of the SQP: Armijo's rule after the second-order correction, and the damped update."""

from types import SimpleNamespace

import numpy as np
import pytest

from runtime.excitation.motion.trajectory import _supremum
from runtime.excitation.search import sqp


def test_a_correction_that_lowers_nothing_is_not_taken() -> None:
    """Oracle: merit at the correction (1, 1) decides; the arc of a half step is (1/2, 1/4)."""
    rows = SimpleNamespace(reach=lambda _x, _step: 1.0)
    model = SimpleNamespace(corrected=lambda _step: np.array([1.0, 1.0]))
    for merit, taken in ((0.0, [1.0, 1.0]), (1.0, [0.5, 0.25])):

        def at(x: np.ndarray, merit: float = merit) -> SimpleNamespace:
            value = merit if x[1] > 0.9 else 5.0 if x[0] > 0.9 else 0.0
            return SimpleNamespace(x=x, merit=value, violation=max(0.0, value))

        point = SimpleNamespace(x=np.zeros(2), merit=1.0, violation=0.0)
        end = sqp._search(at, point, np.array([1.0, 0.0]), -1.0, rows, model)
        assert end.x.tolist() == taken


def test_a_step_is_shortened_to_the_minimum_of_a_parabola() -> None:
    """Oracle: the merit −t + 2 t² is least at 1/4; a wall shortens to a tenth, not further."""
    rows = SimpleNamespace(reach=lambda _x, _step: 1.0)
    model = SimpleNamespace(corrected=lambda _step: None)
    point = SimpleNamespace(x=np.zeros(1), merit=0.0, violation=0.0)
    for merit, want in ((lambda t: -t + 2 * t**2, 0.25), (lambda t: -t if t < 0.2 else 1e9, 0.1)):

        def at(x: np.ndarray, merit=merit) -> SimpleNamespace:
            return SimpleNamespace(x=x, merit=merit(x[0]), violation=0.0)

        end = sqp._search(at, point, np.ones(1), -1.0, rows, model)
        assert end.x == pytest.approx([want], rel=1e-12)


def test_the_update_has_the_curvature_of_the_step() -> None:
    """Oracle: H⁺ s = y where sᵀ y ≥ 0.2 sᵀ H s, and 0.2 sᵀ H s in its direction elsewhere."""
    hessian, step = 0.1 * np.eye(2), np.array([1.0, 0.0])
    change = np.array([0.3, 0.1])
    np.testing.assert_allclose(sqp._damped(hessian, step, change) @ step, change, rtol=1e-14)
    falls = sqp._damped(hessian, step, -change)
    np.testing.assert_allclose(step @ falls @ step, 0.2 * 0.1, rtol=1e-14)


def test_the_largest_value_of_a_polynomial() -> None:
    """Oracle: a thousandth of the interval apart, which misses a maximum by 1e-6 of it at most."""
    for seed in range(5):
        polynomial = np.polynomial.Polynomial(np.random.default_rng(seed).normal(size=6))
        dense = np.abs(polynomial(np.linspace(0.0, 1.0, 1001))).max()
        assert dense <= _supremum(polynomial) <= dense * (1 + 1e-4)
