"""The compiled descent in λ against its step-by-step reference in NumPy."""

import dataclasses

import numpy as np
import pytest

from runtime.errors import LibraryError
from runtime.estimators.descent.descent import Descent, levenberg_descend
from runtime.estimators.descent.fit import (
    CHUNK,
    Preset,
    Watch,
    descend,
    descend_by_steps,
    descend_many,
    fit_adam,
    fit_levenberg,
    fit_many,
)
from runtime.estimators.optimizers import AdamOptions, LevenbergOptions, Status, StoppingRule
from runtime.estimators.problem import Problem
from runtime.estimators.regression.factor import TorqueObjective, compress
from runtime.estimators.regression.samples import Samples, thesis_weights
from runtime.library import Library, load
from runtime.library.compiled_descent import CompiledAdam, CompiledLevenberg
from runtime.recording.friction.coupled_motors import Coupling
from tests.robots import levels_here
from tests.runtime.estimators.descent.levenberg import levenberg_of

NEVER = 10**9


def samples(lib: Library, count: int, columns: int, seed: int) -> Samples:
    """Random motion of a robot that differs from the URDF, with noise and friction columns."""
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.normal(size=(3, count, lib.n_joints))
    pi = lib.pi_from_lam(lib.lam0 * (1 + 0.1 * rng.normal(size=lib.lam0.size)))
    f = rng.normal(size=(count, lib.n_joints, columns))
    tau = lib.inverse_dynamics(q, dq, ddq, pi) + 0.3 * f.sum(axis=2)
    return Samples(q, dq, ddq, tau + 0.05 * rng.normal(size=tau.shape), f)


def problem(lib: Library, columns: int = 2, **changes: object) -> Problem:
    """A small identification problem."""
    train = samples(lib, 300, columns, 0)
    made = Problem(lib, train, samples(lib, 100, columns, 0), thesis_weights(train.tau), lib.lam0)
    return dataclasses.replace(made, **changes)  # type: ignore[arg-type]


def descent(p: Problem) -> Descent:
    """From the problem's start without friction."""
    objective = TorqueObjective(p.lib, p.train, p.weights)
    held = compress(p.lib, p.validation, p.weights)
    x0 = objective.join(p.start, np.zeros(p.train.columns.shape[1:]))
    return Descent(p, objective, p.statistics(), held, x0)


def both(p: Problem, preset: Preset):
    """Outcomes of the compiled loop and of the reference from the same start."""
    return [f(descent(p), preset) for f in (descend, descend_by_steps)]


@pytest.fixture(params=["fr3", "double"])
def arm(any_robot, request):
    """The FR3, and an arm of two joints, whose vectors are mostly their remainders."""
    return any_robot(request.param)


@pytest.mark.parametrize("columns", [0, 2])
@pytest.mark.parametrize("batch", [None, 64])
@pytest.mark.parametrize("name", ["fr3", "tree", "gantry", "double"])
def test_same_answers_as_the_reference(any_robot, name, batch, columns):
    """Oracle: the NumPy loop; 100 steps on every level, same draws, same validations."""
    lib = any_robot(name)
    preset = Preset(AdamOptions(1e-3), StoppingRule(100, NEVER), batch)
    for level in levels_here(lib):
        compiled, reference = both(problem(load(lib.folder, level), columns), preset)
        assert (compiled.iterations, compiled.status) == (100, Status.MAX_ITERATIONS)
        assert compiled.trace.iteration == reference.trace.iteration
        # Adam divides by the size of the gradient, so rounding grows from step to step; measured
        # 1e-12 after 100 of them.
        for ours, theirs in (
            (compiled.trace.training, reference.trace.training),
            (compiled.trace.validation, reference.trace.validation),
            (compiled.x, reference.x),
        ):
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("batch", [None, 64])
def test_patience_is_counted_like_the_reference(arm, batch):
    """Oracle: the NumPy loop; same last iteration where the threshold is far above rounding."""
    preset = Preset(AdamOptions(1e-2), StoppingRule(5000, 20, 5, 1e-3), batch)
    compiled, reference = both(problem(arm), preset)
    assert compiled.status is reference.status is Status.PATIENCE
    assert compiled.iterations == reference.iterations < 5000
    assert compiled.validation == pytest.approx(reference.validation, rel=1e-9)


def test_pieces_make_the_whole(arm, monkeypatch):
    """Property: cutting a run into pieces changes nothing, to the bit."""
    preset = Preset(AdamOptions(1e-3), StoppingRule(200, NEVER), 32)
    whole = both(problem(arm), preset)[0]
    monkeypatch.setattr("runtime.estimators.descent.fit.CHUNK", 7)
    pieces = both(problem(arm), preset)[0]
    np.testing.assert_array_equal(whole.x, pieces.x)
    assert whole.trace == pieces.trace


def test_a_watch_sees_the_iterates_and_changes_nothing(arm):
    """Oracle: the point after k steps of the NumPy loop that ends there; ended descents stay."""
    seen: dict[int, list[np.ndarray]] = {}
    preset = Preset(AdamOptions(1e-3), StoppingRule(30, NEVER), 32)
    pair = [descent(problem(arm)), descent(problem(arm, seed=5))]
    watched = descend_many(pair, preset, watch=Watch(10, lambda k, x: seen.update({k: x})))
    plain = descend_many(pair, preset)
    assert [outcome.trace for outcome in watched] == [outcome.trace for outcome in plain]
    assert sorted(seen) == [10, 20, 30]
    for one, x in zip(pair, seen[20], strict=True):
        # Validated at its last step only, so that the best point is the last one.
        rule = StoppingRule(20, NEVER, validate_every=20, threshold=-np.inf)
        np.testing.assert_allclose(
            x,
            descend_by_steps(one, dataclasses.replace(preset, rule=rule)).x,
            rtol=1e-9,
            atol=1e-12,
        )


def test_motors_of_several_joints_descend_by_steps(arm, monkeypatch):
    """Property: one coupled problem among several is enough; compiled columns are of one joint."""
    monkeypatch.setattr("runtime.estimators.descent.fit.descend_by_steps", lambda d, _: id(d))
    pair = [descent(problem(arm)), descent(problem(arm))]
    coupled = dataclasses.replace(
        pair[1].problem.train, coupling=Coupling(np.eye(arm.n_joints), (False,) * 2, (False,) * 2)
    )
    pair[1] = dataclasses.replace(
        pair[1], problem=dataclasses.replace(pair[1].problem, train=coupled)
    )
    preset = Preset(AdamOptions(1e-3), StoppingRule(10, NEVER), 32)
    assert descend_many(pair, preset) == [id(d) for d in pair]


def test_interruption_keeps_the_best(arm, monkeypatch):
    """Property: Ctrl-C between two pieces returns what was reached."""
    monkeypatch.setattr("runtime.estimators.descent.fit.CHUNK", 50)

    def stop(iteration: int, _: float) -> None:
        if iteration >= 100:
            raise KeyboardInterrupt

    preset = Preset(AdamOptions(1e-3), StoppingRule(5000, NEVER), None)
    outcome = both(problem(arm, progress=stop), preset)[0]
    assert outcome.status is Status.INTERRUPTED
    assert outcome.iterations == 100
    assert outcome.validation == min(outcome.trace.validation)


@pytest.mark.parametrize("patience", [20, NEVER])
def test_interruption_of_the_last_piece_is_reported(arm, patience):
    """Property: Ctrl-C while the last iterations run stops what comes after the descent, too."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    preset = Preset(AdamOptions(1e-3), StoppingRule(400, patience, threshold=1e9), None)
    one = descend(descent(problem(arm, progress=stop)), preset)
    many = descend_many([descent(problem(arm))] * 2, preset, watch=Watch(CHUNK, stop))
    assert one.iterations == min(patience, 400)
    assert [outcome.status for outcome in (one, *many)] == [Status.INTERRUPTED] * 3


def test_divergence_is_said(arm):
    """Property: a step that leaves the numbers ends the run; the best point is finite."""
    preset = Preset(AdamOptions(1e200), StoppingRule(100, NEVER), None)
    outcome = descend(descent(problem(arm)), preset)
    assert outcome.status is Status.DIVERGED
    assert np.isfinite(outcome.x).all()


@pytest.mark.parametrize("cholesky", [False, True])
def test_levels_without_a_loop_descend_in_python(arm, monkeypatch, cholesky):
    """Oracle: the compiled loop's optimum, which Newton's method reaches from the start."""
    usual = fit_levenberg(problem(arm), cholesky)
    lib = load(arm.folder, "portable")
    monkeypatch.setattr(lib.binding, "of_level", lambda _: None)
    preset = Preset(AdamOptions(1e-3), StoppingRule(20, NEVER), None)
    first, second = both(problem(lib), preset)
    np.testing.assert_array_equal(first.x, second.x)
    fit, value = fit_levenberg(problem(lib), cholesky), problem(lib).statistics().value
    # Both end within 1e-6 of the minimum (`DECREASE`), relative.
    assert value(fit.pi, fit.phi) == pytest.approx(value(usual.pi, usual.phi), rel=1e-6)
    lost = problem(lib, start=np.full(lib.lam0.size, 800.0))
    assert levenberg_descend(descent(lost), LevenbergOptions()).status is Status.DIVERGED
    with pytest.raises(LibraryError, match="no compiled descent"):
        CompiledAdam(lib.binding, [], {}, 1, 0)
    with pytest.raises(LibraryError, match="no compiled descent"):
        CompiledLevenberg(lib.binding, [], [], {}, 1)


@pytest.mark.parametrize("columns", [0, 2])
@pytest.mark.parametrize("name", ["fr3", "tree", "double"])
def test_levenberg_gives_the_answers_of_its_reference(any_robot, name, columns):
    """Oracle: the NumPy steps; every level, accepted and rejected steps alike."""
    lib = any_robot(name)
    for level in levels_here(lib):
        d = descent(problem(load(lib.folder, level), columns))
        ours, theirs = (f(d, LevenbergOptions(30)) for f in (levenberg_descend, levenberg_of))
        assert (ours.iterations, ours.status) == (theirs.iterations, theirs.status)
        assert ours.trace.iteration == theirs.trace.iteration
        # Damped systems of condition up to 1e6 = 1 / first_damping: 1e-16 times that, and 30 steps.
        np.testing.assert_allclose(ours.trace.training, theirs.trace.training, rtol=1e-10)
        np.testing.assert_allclose(ours.trace.validation, theirs.trace.validation, rtol=1e-8)
        np.testing.assert_allclose(ours.x, theirs.x, rtol=1e-8, atol=1e-9)


def test_levenberg_finds_the_truth_of_clean_data(arm):
    """Oracle: the robot that made the data, from a start 15 % away."""
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.normal(size=(3, 400, arm.n_joints))
    lam = arm.lam0 * (1 + 0.05 * rng.uniform(-1, 1, arm.lam0.size))
    tau = arm.torque(q, dq, ddq, lam)
    data = Samples(q, dq, ddq, tau, np.zeros((400, arm.n_joints, 0)))
    start = lam * (1 + 0.15 * rng.uniform(-1, 1, lam.size))
    p = Problem(arm, data, data, np.ones(arm.n_joints), start)
    outcome = levenberg_descend(descent(p), LevenbergOptions(200))
    first = descent(p).objective.value(start)
    assert first > 1e-3
    # Thin axes make the last digits slow: measured 6e-11 from 0.1; a wrong block or sign of the
    # Jacobian stops four orders earlier.
    assert outcome.validation < 1e-8 * first
    residual = arm.torque(q, dq, ddq, outcome.x) - tau
    assert np.abs(residual).max() < 1e-3


def test_levenberg_stops_when_the_numbers_end(arm):
    """Property: a start without finite loss is said; nothing moves."""
    p = problem(arm, start=np.full(arm.lam0.size, 800.0))
    outcome = levenberg_descend(descent(p), LevenbergOptions(5))
    assert outcome.status is Status.DIVERGED
    assert outcome.iterations == 0


def test_levenberg_keeps_what_it_has_on_interruption(arm):
    """Property: Ctrl-C after three steps returns the third point."""

    def stop(iteration: int, _: float) -> None:
        if iteration == 3:
            raise KeyboardInterrupt

    outcome = levenberg_descend(descent(problem(arm, progress=stop)), LevenbergOptions(50))
    assert (outcome.status, outcome.iterations) == (Status.INTERRUPTED, 3)
    three = levenberg_descend(descent(problem(arm)), LevenbergOptions(3))
    np.testing.assert_array_equal(outcome.x, three.x)


@pytest.mark.parametrize("batch", [None, 32])
def test_many_at_once_are_the_same_as_one_by_one(arm, batch):
    """Property: trials of one call equal single calls to the bit, for any number of threads."""
    preset = Preset(AdamOptions(1e-2), StoppingRule(700, 20, 5, 1e-4), batch)
    rng = np.random.default_rng(0)
    trials = [
        problem(arm, start=arm.lam0 * (1 + 0.1 * rng.normal(size=arm.lam0.size)), seed=k)
        for k in range(5)
    ]
    alone = [descend(descent(p), preset) for p in trials]
    assert len({outcome.iterations for outcome in alone}) > 1
    for threads in (1, 2, 3, 9):
        together = descend_many([descent(p) for p in trials], preset, threads)
        for one, other in zip(alone, together, strict=True):
            np.testing.assert_array_equal(one.x, other.x)
            assert (one.iterations, one.status, one.trace) == (
                other.iterations,
                other.status,
                other.trace,
            )


def test_fit_many_equals_fit_adam(arm):
    """Property: the door for many problems gives each one its own answer."""
    preset = Preset(AdamOptions(1e-3), StoppingRule(100, NEVER), None)
    trials = [problem(arm, start=arm.lam0 * k) for k in (0.9, 1.0, 1.1)]
    fits = fit_many(trials, preset)
    for trial, fit in zip(trials, fits, strict=True):
        np.testing.assert_array_equal(fit.pi, fit_adam(trial, preset).pi)
    assert fit_many([], preset) == []
