"""Newton steps in θ: Levenberg–Marquardt ends at optima on the boundary of consistency."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.estimators.classical.pc_ols import convex_optimum
from runtime.estimators.descent.descent import Descent, _Loss, _step, newton_descend
from runtime.estimators.descent.fit import fit_levenberg, start_of
from runtime.estimators.methods import METHODS
from runtime.estimators.optimizers import Outcome, Status, Trace
from runtime.estimators.problem import Problem
from runtime.estimators.regression.samples import samples_of, thesis_weights
from runtime.library import Library
from runtime.recording import Recording


def noisy_problem(lib: Library, run: Recording, seed: int) -> Problem:
    """10 s of the document's robot with 0.05 N·m of noise and a first guess 15 % off."""
    rng = np.random.default_rng(seed)
    s = samples_of(run.replace(tau=run.tau + 0.05 * rng.normal(size=run.tau.shape)), lib)
    start = lib.lam0 * (1 + 0.15 * rng.normal(size=lib.lam0.size))
    return Problem(lib, s, s, thesis_weights(s.tau), start)


@pytest.mark.parametrize("cholesky", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_noisy_descents_converge(lib, ideal_runs, seed, cholesky):
    """Oracle: PC-OLS. Without these steps 10 of 10 stopped at the limit, 5e-5 to 4e-3 off."""
    problem = noisy_problem(lib, ideal_runs[0], seed)
    optimum = convex_optimum(lib, problem.statistics(), lib.pi_from_lam(problem.start)).loss
    fit = fit_levenberg(problem, cholesky)
    assert fit.status.startswith("converged")
    # Links on the boundary are thickened by 1e-6 of their size, which costs up to some 1e-5.
    assert -1e-6 < problem.statistics().value(fit.pi, fit.phi) / optimum - 1 < 1e-4


def test_slopes_are_those_of_the_loss(lib, ideal_runs):
    """Derivative: gradient and Hessian against central differences along random directions."""
    descent: Descent = start_of(noisy_problem(lib, ideal_runs[0], 0), cholesky=True)
    loss, rng = _Loss(descent), np.random.default_rng(1)
    gradient, hessian = loss.slope(descent.x0)
    for _ in range(3):
        move = rng.normal(size=gradient.size)
        h = 1e-5
        ends = [loss.slope(descent.x0 + sign * h * move)[0] for sign in (1, -1)]
        values = [loss.value(descent.x0 + sign * h * move) for sign in (1, -1)]
        assert (values[0] - values[1]) / (2 * h) == pytest.approx(gradient @ move, rel=1e-6)
        # Differences of differences: 1e-5² of the third derivative and rounding over 1e-5.
        np.testing.assert_allclose(
            (ends[0] - ends[1]) / (2 * h), hessian @ move, atol=1e-5 * np.abs(hessian @ move).max()
        )


def test_the_curvature_takes_one_batch_of_jacobians(lib, ideal_runs, monkeypatch):
    """Property: a call costs 30 µs and a link 0.1 µs, so that all differences are one call."""
    descent = start_of(noisy_problem(lib, ideal_runs[0], 0), cholesky=True)
    shapes = []
    plain = type(lib).cholesky_jacobian
    monkeypatch.setattr(
        type(lib), "cholesky_jacobian", lambda *a: (shapes.append(np.shape(a[1])), plain(*a))[1]
    )
    _Loss(descent).slope(descent.x0)
    size = 10 * lib.n_links
    assert shapes == [(size,), (20, size)]


def test_a_step_that_does_not_lower_the_loss_is_halved(lib, ideal_runs, monkeypatch):
    """Oracle: L = x², whose slope states half the curvature: a whole step ends at −x, a half at 0.

    Reports go on with the iterations of the descent before.
    """

    class Parabola:
        def __init__(self, _: Descent) -> None: ...

        def value(self, x: np.ndarray) -> float:
            return float(x[0] ** 2)

        def slope(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return 2 * x[:1], np.ones((1, 1))

    monkeypatch.setattr("runtime.estimators.descent.descent._Loss", Parabola)
    seen: list[tuple[int, float]] = []
    problem = noisy_problem(lib, ideal_runs[0], 0)
    problem = replace(problem, progress=lambda step, loss: seen.append((step, loss)))
    before = Outcome(np.ones(1), 1.0, 10, Status.STALLED, Trace((), (), ()))
    descent = start_of(problem, cholesky=True)
    monkeypatch.setattr(Descent, "validation_loss", lambda _, x: float(abs(x[0])))
    end = newton_descend(descent, before)
    assert (end.status, end.x.tolist(), end.iterations) == (Status.CONVERGED, [0.0], 11)
    assert seen == [(11, 0.0)]


def test_a_direction_without_curvature_is_bounded_by_the_largest_curvature():
    """Oracle: |H|⁻¹ g by hand with eigenvalues 4, −1 and 0, which counts as 1e-14 of 4."""
    step, decrease = _step(np.array([4.0, 2.0, 4e-14]), np.diag([4.0, -1.0, 0.0]))
    np.testing.assert_allclose(step, [-1.0, -2.0, -1.0], rtol=1e-12)
    assert decrease == pytest.approx((4 + 4 + 4e-14) / 2, rel=1e-15)


def test_two_methods_descend_in_two_kinds_of_coordinates(lib, ideal_runs):
    """Property: lm descends in λ and log-cholesky in its own coordinates, so that traces differ."""
    problem = noisy_problem(lib, ideal_runs[0], 0)
    for name, cholesky in (("lm", False), ("log-cholesky", True)):
        here, other = (fit_levenberg(problem, kind) for kind in (cholesky, not cholesky))
        trace = METHODS[name].fit(problem).trace
        assert trace == here.trace
        assert trace != other.trace
