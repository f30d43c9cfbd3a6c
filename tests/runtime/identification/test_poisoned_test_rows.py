"""Test rows take part in no choice: poisoned ones change the test error alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.estimators.choice.default_friction import choose_default_friction
from runtime.estimators.choice.friction_choice import choose_friction
from runtime.estimators.choice.regressor_choice import choose_cutoff
from runtime.identification.identified import Identification
from runtime.identification.several_logs import NamedLog
from runtime.identification.single_log import identify_recording
from runtime.inspection.torque_checks import proposed_preparation
from runtime.library import Library
from runtime.recording import Friction, Preparation, Split, write_recording
from runtime.recording.streamed import open_streamed

SLOW = Preparation(filter="butterworth", cutoff_hz=1.0, max_gap_s=0.1)
"""Filter whose time constant is a twentieth of the log."""
PARTS = Split((0.0, 0.6), (0.6, 0.8), (0.8, 1.0))
EARLY = Split((0.0, 0.8), (0.8, 0.95), (0.95, 1.0))
"""Parts whose validation rows are test rows of the others."""


def poisoned(log: Recording) -> Recording:
    """The same log with 1 kN·m of noise on the torque of its test rows."""
    tau = log.tau.copy()
    test = log.t >= log.t[0] + 0.8 * log.duration
    tau[test] += 1e3 * np.random.default_rng(0).normal(size=(int(test.sum()), tau.shape[1]))
    return log.replace(tau=tau)


def shaken(log: Recording) -> Recording:
    """The same log with 0.01 rad of noise on the positions of its test rows."""
    q = log.q.copy()
    test = log.t >= log.t[0] + 0.8 * log.duration
    q[test] += 1e-2 * np.random.default_rng(0).normal(size=(int(test.sum()), q.shape[1]))
    return log.replace(q=q)


@pytest.mark.parametrize("columns", [(), ("viscous", "coulomb")])
@pytest.mark.parametrize("method", ["map", "ols", "wls", "pc-ols", "lm", "adam"])
def test_a_fit_has_not_seen_the_test_rows(
    lib: Library, noisy: Recording, method: str, columns: tuple[str, ...]
) -> None:
    """Property: π, φ and their uncertainty are equal to the bit."""
    terms = Friction(columns)
    clean, dirty = (
        identify_recording(log, lib, method, friction=terms, split=PARTS, certify=False)
        for log in (noisy, poisoned(noisy))
    )
    np.testing.assert_array_equal(clean.pi, dirty.pi)
    np.testing.assert_array_equal(clean.phi, dirty.phi)
    np.testing.assert_array_equal(clean.weights, dirty.weights)
    errors = [np.abs(r.test.tau - r.predict_recording(r.test)).max() for r in (clean, dirty)]
    assert errors[0] < 10
    assert errors[1] > 1e3


def test_the_friction_model_has_not_seen_the_test_rows(lib: Library, noisy: Recording) -> None:
    """Property: scores, widths and the choice are equal to the bit."""
    names = ("none", "viscous", "coulomb")
    clean, dirty = (
        choose_friction(log, lib, split=PARTS, names=names) for log in (noisy, poisoned(noisy))
    )
    assert clean == dirty


@pytest.mark.parametrize("regressor", ["acceleration", "momentum", "energy"])
@pytest.mark.parametrize("trim_s", [None, 0.5])
@pytest.mark.parametrize("method", ["map", "adam"])
def test_a_filter_has_not_seen_the_test_rows(
    lib: Library, noisy: Recording, method: str, trim_s: float | None, regressor: str
) -> None:
    """Property: a zero-phase filter carries no test row into the rows of the other parts."""
    steps = replace(SLOW, trim_s=trim_s, regressor=regressor)
    clean, dirty = (
        identify_recording(log, lib, method, preparation=steps, split=PARTS, certify=False)
        for log in (noisy, poisoned(noisy))
    )
    assert_equal_models(clean, dirty)
    for one, two in ((clean.train, dirty.train), (clean.validation, dirty.validation)):
        np.testing.assert_array_equal(one.tau, two.tau)


def test_several_logs_have_not_seen_their_test_rows(lib: Library, noisy: Recording) -> None:
    """Property: the joint model of two logs is equal to the bit."""
    clean, dirty = (
        identify_recording([NamedLog("a", log, SLOW), NamedLog("b", other, SLOW)], lib, split=PARTS)
        for log, other in ((noisy, noisy), (poisoned(noisy), poisoned(noisy)))
    )
    assert_equal_models(clean, dirty)


def test_a_streamed_log_has_not_seen_its_test_rows(
    lib: Library, noisy: Recording, tmp_path: Path
) -> None:
    """Property: blocks of the training part hold no test row in their overlap."""
    results = []
    for name, log in (("clean", noisy), ("dirty", poisoned(noisy))):
        write_recording(log, tmp_path / f"{name}.npz")
        streamed = open_streamed(tmp_path / f"{name}.npz")
        results.append(identify_recording(streamed, lib, preparation=SLOW, split=PARTS))
    assert_equal_models(*results)


@pytest.mark.parametrize("spoil", [poisoned, shaken])
def test_choices_have_not_seen_the_test_rows(lib: Library, noisy: Recording, spoil) -> None:
    """Property: cut-off and default friction are equal to the bit."""
    clean, dirty = (
        (
            choose_cutoff(log, lib, split=PARTS).sentence,
            choose_default_friction(log, lib, SLOW, PARTS),
        )
        for log in (noisy, spoil(noisy))
    )
    assert clean == dirty


def test_the_proposed_filter_has_not_seen_the_test_rows(lib: Library, noisy: Recording) -> None:
    """Property: cut-off, derivative and regressor are equal, and noise in them would change one."""
    steps, terms = Preparation(), Friction(("viscous", "coulomb"))
    clean, dirty, elsewhere = (
        proposed_preparation(log.replace(dq=None, ddq=None), lib, steps, parts, terms)
        for log, parts in ((noisy, PARTS), (shaken(noisy), PARTS), (shaken(noisy), EARLY))
    )
    assert clean == dirty
    assert clean[0] != elsewhere[0]


def test_rows_next_to_another_part_are_dropped(lib: Library, noisy: Recording) -> None:
    """Oracle: 1 / f_c = 0.5 s on the inner side of both parts, nothing at the ends of the log."""
    steps = replace(SLOW, cutoff_hz=2.0)
    result = identify_recording(noisy, lib, preparation=steps, split=PARTS, certify=False)
    first, last = noisy.t[0], noisy.t[-1]
    cut = first + 0.8 * noisy.duration
    step = 1.0 / noisy.rate_hz
    assert result.train.t[[0, -1]] == pytest.approx([first, cut - 0.5], abs=1.01 * step)
    assert result.test.t[[0, -1]] == pytest.approx([cut + 0.5, last], abs=1.01 * step)
    assert "next to another part" in result.train.history[-1]


def assert_equal_models(clean: Identification, dirty: Identification) -> None:
    """π, φ and weights are equal to the bit, and only the test error differs."""
    np.testing.assert_array_equal(clean.pi, dirty.pi)
    np.testing.assert_array_equal(clean.phi, dirty.phi)
    np.testing.assert_array_equal(clean.weights, dirty.weights)
    assert np.abs(clean.test.tau - dirty.test.tau).max() > 100.0
