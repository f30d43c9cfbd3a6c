"""The compiled descent in λ against its step-by-step reference in NumPy."""

import dataclasses

import numpy as np
import pytest

from runtime.descent import Preset, descend, descend_by_steps
from runtime.errors import LibraryError
from runtime.library import Library, load
from runtime.objective import Samples, TorqueObjective, thesis_weights
from runtime.optimizers import AdamOptions, Status, StoppingRule
from runtime.problem import Problem
from runtime.statistics import compress

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


def both(p: Problem, preset: Preset):
    """Outcomes of the compiled loop and of the reference from the same start."""
    objective = TorqueObjective(p.lib, p.train, p.weights)
    statistics = compress(p.lib, p.train, p.weights)
    x0 = objective.join(p.start, np.zeros(p.train.columns.shape[1:]))
    return [f(p, objective, statistics, x0, preset) for f in (descend, descend_by_steps)]


def levels(lib: Library) -> tuple[str, ...]:
    return tuple(lib.levels[1 : lib.levels.index(lib.level) + 1])


@pytest.mark.parametrize("columns", [0, 2])
@pytest.mark.parametrize("batch", [None, 64])
@pytest.mark.parametrize("name", ["fr3", "tree"])
def test_same_answers_as_the_reference(robot, name, batch, columns):
    """Oracle: the NumPy loop; 100 steps on every level, same draws, same validations."""
    lib = robot(name)
    preset = Preset(AdamOptions(1e-3), StoppingRule(100, NEVER), batch)
    for level in levels(lib):
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
def test_patience_is_counted_like_the_reference(fr3, batch):
    """Oracle: the NumPy loop; same last iteration where the threshold is far above rounding."""
    preset = Preset(AdamOptions(1e-2), StoppingRule(5000, 20, 5, 1e-3), batch)
    compiled, reference = both(problem(fr3), preset)
    assert compiled.status is reference.status is Status.PATIENCE
    assert compiled.iterations == reference.iterations < 5000
    assert compiled.validation == pytest.approx(reference.validation, rel=1e-9)


def test_pieces_make_the_whole(fr3, monkeypatch):
    """Property: cutting a run into pieces changes nothing, to the bit."""
    preset = Preset(AdamOptions(1e-3), StoppingRule(200, NEVER), 32)
    whole = both(problem(fr3), preset)[0]
    monkeypatch.setattr("runtime.descent.CHUNK", 7)
    pieces = both(problem(fr3), preset)[0]
    np.testing.assert_array_equal(whole.x, pieces.x)
    assert whole.trace == pieces.trace


def test_interruption_keeps_the_best(fr3, monkeypatch):
    """Property: Ctrl-C between two pieces returns what was reached."""
    monkeypatch.setattr("runtime.descent.CHUNK", 50)

    def stop(iteration: int, _: float) -> None:
        if iteration >= 100:
            raise KeyboardInterrupt

    preset = Preset(AdamOptions(1e-3), StoppingRule(5000, NEVER), None)
    outcome = both(problem(fr3, progress=stop), preset)[0]
    assert outcome.status is Status.INTERRUPTED
    assert outcome.iterations == 100
    assert outcome.validation == min(outcome.trace.validation)


def test_divergence_is_said(fr3):
    """Property: a step that leaves the numbers ends the run; the best point is finite."""
    preset = Preset(AdamOptions(1e4), StoppingRule(100, NEVER), None)
    p = problem(fr3)
    objective, statistics = (
        TorqueObjective(fr3, p.train, p.weights),
        compress(fr3, p.train, p.weights),
    )
    x0 = objective.join(p.start, np.zeros(p.train.columns.shape[1:]))
    outcome = descend(p, objective, statistics, x0, preset)
    assert outcome.status is Status.DIVERGED
    assert np.isfinite(outcome.x).all()


def test_portable_level_takes_the_reference(fr3):
    """Property: without a compiled loop the door is the same; asking for one is refused."""
    lib = load(fr3.folder, "portable")
    preset = Preset(AdamOptions(1e-3), StoppingRule(20, NEVER), None)
    first, second = both(problem(lib), preset)
    np.testing.assert_array_equal(first.x, second.x)
    with pytest.raises(LibraryError, match="no compiled descent"):
        lib.adam(lib.lam0, None, None, {}, 1)
