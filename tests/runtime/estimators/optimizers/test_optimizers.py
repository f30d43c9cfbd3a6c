"""optimizers: Adam step by step, and the loop that stops in time and keeps the best."""

from collections.abc import Callable

import numpy as np
import pytest

from runtime.estimators.optimizers import (
    AdamOptions,
    LevenbergOptions,
    Outcome,
    Status,
    StoppingRule,
    adam,
)
from tests.runtime.estimators.descent.levenberg import levenberg

Loss = Callable[[np.ndarray], tuple[float, np.ndarray]]


def quadratic(x: np.ndarray) -> tuple[float, np.ndarray]:
    return float(x @ x) / 2, x.copy()


def rosenbrock(x: np.ndarray) -> tuple[float, np.ndarray]:
    a, b = 1 - x[0], x[1] - x[0] ** 2
    return float(a * a + 100 * b * b), np.array([-2 * a - 400 * x[0] * b, 200 * b])


def run(
    loss: Loss,
    start: list[float],
    rule: StoppingRule,
    options: AdamOptions | None = None,
    validation: Callable[[np.ndarray], float] | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """The loop with the loss as its own validation."""
    validated = validation or (lambda x: loss(x)[0])
    return adam(loss, options or AdamOptions(), np.array(start), validated, rule, progress)


def points_of(gradients: np.ndarray, start: np.ndarray, options: AdamOptions) -> np.ndarray:
    """The points (K + 1, size) of as many steps with given gradients, (K, size)."""
    points, rows = [], iter(gradients)

    def validation(x: np.ndarray) -> float:
        points.append(x.copy())
        return 0.0

    rule = StoppingRule(len(gradients), len(gradients) + 1, validate_every=1)
    adam(lambda _: (0.0, next(rows)), options, start, validation, rule)
    return np.array(points)


def test_two_steps_by_hand() -> None:
    """Oracle: g = 1, then g = −2 with η = 0.1, β = ½, ¾, ε = 1, worked out on paper.

    m̂₁ = 1, v̂₁ = 1: x = −0.1 · 1/(1 + 1) = −0.05.
    m₂ = ½·½ − 1 = −¾, m̂₂ = −1; v₂ = ¾·¼ + 1 = 19/16, v̂₂ = 19/7: x = −0.05 + 0.1/(√(19/7) + 1).
    """
    options = AdamOptions(0.1, 0.5, 0.75, 1.0)
    _, first, second = points_of(np.array([[1.0], [-2.0]]), np.zeros(1), options)
    # A handful of roundings.
    assert first == pytest.approx([-0.05], rel=1e-15)
    assert second == pytest.approx([-0.05 + 0.1 / (np.sqrt(19 / 7) + 1)], rel=1e-14)


def test_epsilon_stands_outside_the_root() -> None:
    """Oracle: for g = ε = 1e-8 the first step is η/2 outside the root, η/10⁴ inside."""
    x = points_of(np.array([[1e-8]]), np.zeros(1), AdamOptions(1e-3))[-1]
    # g² = 1e-16 is exact enough for twelve digits of its root.
    assert x == pytest.approx([-0.5e-3], rel=1e-12)


def test_sequence_against_the_textbook() -> None:
    """Oracle: 300 steps of Kingma & Ba's recursion in its sum form, m_t = (1−β) Σ β^(t−i) g_i."""
    rng = np.random.default_rng(0)
    gradients = rng.normal(size=(300, 3))
    options = AdamOptions(0.01, 0.9, 0.99, 1e-8)
    x, expected = points_of(gradients, np.ones(3), options)[-1], np.ones(3)
    for t in range(1, 301):
        age = np.arange(t - 1, -1, -1)
        m = 0.1 * (0.9**age) @ gradients[:t] / (1 - 0.9**t)
        v = 0.01 * (0.99**age) @ gradients[:t] ** 2 / (1 - 0.99**t)
        expected = expected - 0.01 * m / (np.sqrt(v) + 1e-8)
    # Rounding accumulated over 300 steps.
    assert x == pytest.approx(expected, rel=1e-11)


def test_steps_do_not_change_their_arguments() -> None:
    """Property: pure; the start, the gradients and the points given stay what they were."""
    start, gradients = np.ones(2), np.ones((2, 2))
    points = points_of(gradients, start, AdamOptions(0.1))
    assert start.tolist() == points[0].tolist() == [1.0, 1.0]
    assert (gradients == 1.0).all()
    assert (np.diff(points, axis=0) < 0).all()


@pytest.mark.parametrize(
    ("loss", "start", "optimum", "rate"),
    [
        (quadratic, [3.0, -1.0, 0.5], [0.0, 0.0, 0.0], 0.05),
        (rosenbrock, [-1.2, 1.0], [1.0, 1.0], 0.02),
    ],
    ids=["quadratic", "rosenbrock"],
)
def test_toys_are_solved(loss: Loss, start: list[float], optimum: list[float], rate: float) -> None:
    """Oracle: the known minima of a quadratic and of Rosenbrock's valley."""
    outcome = run(loss, start, StoppingRule(50_000, 2000, threshold=1e-12), AdamOptions(rate))
    assert outcome.status is Status.PATIENCE
    # A valley of curvature 0.4 at a loss of about 1e-10.
    assert outcome.x == pytest.approx(optimum, abs=1e-4)


def test_patience_counts_iterations_not_validations() -> None:
    """Property: a flat loss ends after exactly `patience` iterations, whatever `validate_every`."""

    def flat(x: np.ndarray) -> tuple[float, np.ndarray]:
        return 1.0, np.ones_like(x)

    for every in (1, 5, 7, 100):
        outcome = run(flat, [0.0], StoppingRule(1000, 25, validate_every=every))
        assert outcome.status is Status.PATIENCE
        assert outcome.iterations == 25
        # Nothing improved, so the start is the answer.
        assert outcome.x.tolist() == [0.0]
        assert outcome.trace.iteration == tuple(range(every, 26, every))


def test_an_improvement_counts_only_beyond_the_threshold() -> None:
    """Property: one fall by exactly `threshold` is none; by more, it restarts the patience."""
    for threshold, iterations in ((0.25, 20), (0.2, 25)):
        losses = iter([10.0, *[9.75] * 100])
        outcome = run(
            quadratic,
            [1.0],
            StoppingRule(60, 20, validate_every=5, threshold=threshold),
            validation=lambda _, losses=losses: next(losses),
        )
        assert (outcome.status, outcome.iterations) == (Status.PATIENCE, iterations)


def test_the_threshold_accumulates_against_the_best() -> None:
    """Property: small falls add up; the improvement is held against the best that counted."""
    losses = iter([10.0, 9.75, 9.5, 9.25, 9.0, *[9.0] * 100])
    outcome = run(
        quadratic,
        [1.0],
        StoppingRule(1000, 10, validate_every=1, threshold=0.5),
        validation=lambda _: next(losses),
    )
    # 9.25 beats 10 − 0.5 at iteration 3; 9.0 does not beat 9.25 − 0.5; 3 + 10 ends.
    assert (outcome.validation, outcome.iterations) == (9.25, 13)


def test_the_best_point_is_returned_not_the_last() -> None:
    """Property: with a step that overshoots, the answer is the lowest validated loss."""
    seen: list[tuple[float, np.ndarray]] = []

    def validation(x: np.ndarray) -> float:
        seen.append((quadratic(x)[0], x.copy()))
        return seen[-1][0]

    rule = StoppingRule(200, 1000, validate_every=3, threshold=0.0)
    outcome = run(quadratic, [1.0], rule, AdamOptions(0.3), validation)
    best = min(seen, key=lambda pair: pair[0])
    assert outcome.validation == best[0]
    assert outcome.x.tolist() == best[1].tolist()
    assert best[0] < seen[-1][0]
    assert outcome.status is Status.MAX_ITERATIONS
    assert outcome.trace.validation == tuple(loss for loss, _ in seen[1:])


@pytest.mark.parametrize("poison", [np.nan, np.inf])
def test_divergence_keeps_the_best_before(poison: float) -> None:
    """Property: NaN or an infinite loss ends the loop; the answer is finite."""

    def broken(x: np.ndarray) -> tuple[float, np.ndarray]:
        return (poison, x) if abs(x[0]) < 0.5 else quadratic(x)

    outcome = run(broken, [1.0], StoppingRule(1000, 500, validate_every=1), AdamOptions(0.01))
    assert outcome.status is Status.DIVERGED
    assert 0.5 <= outcome.x[0] < 0.52
    assert np.isfinite(outcome.validation)


def test_a_start_without_a_loss_is_no_descent() -> None:
    """Property: NaN at the start comes back at once as DIVERGED."""
    outcome = run(quadratic, [np.nan], StoppingRule(10, 10))
    assert (outcome.status, outcome.iterations) == (Status.DIVERGED, 0)


def test_max_iterations_is_a_limit() -> None:
    """Property: a loss that keeps falling ends at the limit."""
    outcome = run(quadratic, [100.0], StoppingRule(17, 25))
    assert (outcome.status, outcome.iterations) == (Status.MAX_ITERATIONS, 17)


def test_interrupting_keeps_the_best() -> None:
    """Property: Ctrl-C inside the gradient returns the best validated point."""
    calls = 0

    def interrupted(x: np.ndarray) -> tuple[float, np.ndarray]:
        nonlocal calls
        calls += 1
        if calls == 42:
            raise KeyboardInterrupt
        return quadratic(x)

    reports: list[tuple[int, float]] = []
    rule = StoppingRule(1000, 1000)
    outcome = run(
        interrupted,
        [3.0],
        rule,
        AdamOptions(0.01),
        lambda x: quadratic(x)[0],
        lambda iteration, best: reports.append((iteration, best)),
    )
    assert outcome.status is Status.INTERRUPTED
    assert outcome.iterations == 42
    assert reports == [(5 * (k + 1), loss) for k, loss in enumerate(outcome.trace.validation)]
    assert len(reports) == 8
    assert outcome.validation == reports[-1][1] == quadratic(outcome.x)[0] < 4.5


def test_the_oracle_of_levenberg_marquardt_solves_rosenbrock_in_residuals() -> None:
    """Oracle: the minimum of r = (1 − a, 10 (b − a²)); each accepted step lowers the loss."""

    def residual_jacobian(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, b = x
        return np.array([1 - a, 10 * (b - a * a)]), np.array([[-1.0, 0.0], [-20 * a, 10.0]])

    outcome = levenberg(residual_jacobian, np.array([-1.2, 1.0]), LevenbergOptions())
    assert outcome.status is Status.CONVERGED
    # Quadratic convergence to a zero residual leaves rounding.
    assert outcome.x == pytest.approx([1.0, 1.0], abs=1e-10)
    assert np.all(np.diff(outcome.trace.training) < 0)
    assert outcome.iterations < 40
