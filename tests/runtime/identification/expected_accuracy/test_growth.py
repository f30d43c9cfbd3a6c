"""Expected accuracy over the length of a log, its verdict, and errors of the model."""

from dataclasses import replace

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.excitation.search.information import FRICTION
from runtime.identification.expected_accuracy.expected import (
    GainOfRecording,
    Knowledge,
    error_of_fit,
    expected,
    gained,
    growth,
    verdict,
)
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    motion_samples_of,
    noise_of,
    repetition,
)
from runtime.library import Library
from runtime.recording import Friction
from tests.runtime.trials import SIGMA


def test_verdicts() -> None:
    """Property: the shortest that helps; the mass of a payload first; nothing is 'stop'."""
    few = GainOfRecording(10.0, "m", {"a": 0.04, "b": 0.0})
    many = GainOfRecording(
        30.0, "m", {"a": 0.5, "b": 0.4, "c": 0.3, "payload mass": 0.12, "d": 0.0}
    )
    text = (
        "30 s more of m improve payload mass by 12 %, a by 50 %, b by 40 % and 1 more of 5 numbers"
    )
    assert verdict([many, few]) == f"{text} by over 10 %: go on"
    assert verdict([few]) == "10 s more of m improve no value by 10 % (most: a by 4 %): stop"
    assert gained({"a": 2.0}, {"a": 1.0, "new": 3.0}, 1.0, "m").gains == {"new": 1.0, "a": 0.5}


def test_growth_ends_where_the_prediction_is(lib: Library, moved: MotionSamples) -> None:
    """Property: σ only falls, and at the end it is that of the whole motion and of what follows."""
    known = Knowledge.of(lib)
    seconds, sigmas = growth(lib, moved, SIGMA, known, 1.0, until=10.01)
    whole = moved.statistics(lib, SIGMA)
    last = int(np.flatnonzero(seconds == moved.seconds)[0])
    masses = np.array([each.pi[::10] for each in sigmas])
    for index, facts in ((last, whole), (-1, whole.merged(whole))):
        one = expected(lib, facts, known, 1.0, FRICTION)
        assert one.payload is not None
        at = sigmas[index]
        assert at.payload is not None
        assert masses[index] == pytest.approx(one.pi[::10], rel=1e-9)
        assert at.relative.max() == pytest.approx(one.relative.max(), rel=1e-9)
        assert at.payload.pi[0] == pytest.approx(one.payload.pi[0], rel=1e-6)
    assert (np.diff(masses, axis=0) <= 1e-9 * masses[:-1]).all()
    assert not any(np.isnan(each.payload.pi[0]) for each in sigmas if each.payload is not None)


def test_motions_with_other_friction_are_not_joined(moved: MotionSamples) -> None:
    """Property: one sentence that names both."""
    with pytest.raises(IdentificationError, match="'train' has the friction columns viscous, "):
        moved.require_columns(("rotor",))


def test_model_error_repeats_on_the_way_back(lib: Library, noisy: Recording) -> None:
    """Closed form: r is 0 of noise and 1 of a torque that depends on the place."""
    rest = np.random.default_rng(0).normal(size=noisy.q.shape)
    # Five standard deviations of a correlation of 7007 numbers, of which half are pairs.
    assert repetition(noisy.q, rest) < 5 * np.sqrt(2 / rest.size)
    assert repetition(noisy.q, np.sin(8 * noisy.q)) == pytest.approx(1.0, abs=1e-9)
    # Friction that the columns miss has the opposite sign on the way back.
    assert repetition(noisy.q, noisy.dq) == 0.0
    drifting = noisy.q + 0.1 * np.ptp(noisy.q, axis=0) * noisy.t[:, None] / noisy.t[-1]
    assert repetition(drifting, np.sin(8 * noisy.q)) == 0.0
    assert repetition(noisy.q, np.zeros_like(rest)) == 0.0


def test_model_error_of_a_log_widens_its_prediction(lib: Library, noisy: Recording) -> None:
    """Closed form: the distance of the estimate from its data adds to the variance."""
    rippled = noisy.replace(tau=noisy.tau + 0.3 * np.sin(8 * noisy.q))
    samples = motion_samples_of(rippled, lib, None, Friction(FRICTION))
    noise = noise_of(lib, samples)
    assert noise is not None
    statistics = samples.statistics(lib, noise.sigma)
    known = replace(Knowledge.of(lib), pi=noise.fit.pi)
    error = error_of_fit(lib, samples.samples, noise.fit)
    alone, whole = (
        expected(lib, statistics, each, noise.inflation)
        for each in (known, replace(known, error=error))
    )
    squares = alone.base_map**2 + (lib.base_matrix @ error) ** 2
    assert whole.base_map == pytest.approx(np.sqrt(squares), rel=1e-12)
