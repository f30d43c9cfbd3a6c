"""Logs of a robot with springs: what `identify` and `inspect` do where nobody names the springs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime import Recording, write_recording
from runtime.identification.posterior_file import determined, spring_lines
from runtime.identification.result_file import record_of
from runtime.identification.single_log import identify_recording
from runtime.inspection import inspect_log
from runtime.library import Library
from runtime.recording import Friction
from tests.runtime.library.test_coupled_library import motion

STIFFNESS = np.array([30.0, 400.0])
NOISE = 0.05
"""N·m."""


@pytest.fixture(scope="module")
def log(wrist: Library) -> Recording:
    """Torque of the URDF's links, curves, strong springs, friction and white noise."""
    t, q, dq, ddq = motion(800)
    tau = wrist.inverse_dynamics(q, dq, ddq, wrist.pi0) + wrist.known_torque(q)
    tau += wrist.spring_columns(q) @ STIFFNESS + 0.4 * dq + 0.3 * np.tanh(dq / 0.02)
    tau += np.random.default_rng(3).normal(0, NOISE, tau.shape)
    return Recording(t, q, dq, ddq, tau, name="sprung")


def test_springs_are_columns_of_the_default_friction(wrist: Library, log: Recording) -> None:
    """Recovery: the choice has a column per spring of unknown stiffness; the torque is predicted to
    the noise, and both constants to 3 %, some standard deviations of 480 rows.
    """
    terms = runtime.choose_default_friction(log, wrist).terms
    assert {"spring:back", "spring:strut"} <= set(terms.columns)
    result = identify_recording(log, wrist, friction=terms, certify=False)
    rest = result.predict(log.q, log.dq, log.required("ddq")) - log.required("tau")
    assert rest.std(axis=0).max() < 1.1 * NOISE
    places = [terms.columns.index(f"spring:{name}") for name in ("back", "strut")]
    np.testing.assert_allclose(result.phi[0, places], STIFFNESS, rtol=0.03)


def test_intervals_of_springs_hold(wrist: Library, log: Recording) -> None:
    """Recovery: 95 % intervals of stiffness and friction contain the truth.

    Of 12 logs with other noise, 6 coefficients each: 72 intervals, of which 68.4 hold in the mean;
    fewer than 62 hold in 0.3 % of cases. Errors in units of σ are normal: their RMS over 72 is
    within 1 ± 0.25 (three of its standard deviations). The gains of the sensors are exact.
    """
    terms = Friction(("viscous", "coulomb", "spring:back", "spring:strut"), coulomb_speed=0.02)
    truth = np.array([[0.4, 0.3, *STIFFNESS], [0.4, 0.3, 0, 0]])
    exact = log.required("tau") - np.random.default_rng(3).normal(0, NOISE, (len(log), 2))
    errors, inside = [], []
    for seed in range(100, 112):
        noise = np.random.default_rng(seed).normal(0, NOISE, exact.shape)
        noisy = replace(log, tau=exact + noise)
        result = identify_recording(noisy, wrist, friction=terms, gain_sigma=0)
        facts = record_of(result, "").friction
        known = np.array(facts.sigma, dtype=float)  # null becomes NaN
        assert (np.isnan(known) == [[0, 0, 0, 0], [0, 0, 1, 1]]).all()  # a spring has one entry
        assert facts.interval_95[1][2:] == (None, None)
        kept = np.isfinite(known)
        errors += list(((np.array(facts.values) - truth) / known)[kept])
        ends = np.array([pair for row in facts.interval_95 for pair in row if pair])
        inside += list((ends[:, 0] < truth[kept]) & (truth[kept] < ends[:, 1]))
    assert len(inside) == 72
    assert sum(inside) >= 62
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1, abs=0.25)
    line = spring_lines(facts)[0]
    assert line.startswith("spring back: stiffness ")
    assert "95 % interval" in line


def test_coefficients_without_information_have_no_interval(wrist: Library, log: Recording) -> None:
    """Property: null where a coefficient ended at its bound, or its column copies another one."""
    driving = replace(log, tau=log.required("tau") - 0.8 * log.dq * [1, 0])  # −0.4 dq at the first
    terms = Friction(("viscous", "spring:back", "spring:strut"))
    facts = record_of(identify_recording(driving, wrist, friction=terms), "").friction
    assert facts.values[0][0] == 0
    assert facts.interval_95[0][0] is None
    assert facts.sigma[0][0] is None
    assert facts.sigma[1][0] > 0
    columns = np.random.default_rng(0).standard_normal((9, 4))
    columns = np.column_stack([columns, 3 * columns[:, 1], np.zeros(9)])
    assert determined(columns).tolist() == [True, False, True, True, False, False]
    assert determined(columns[:2]).tolist() == [False] * 6  # more columns than rows


def test_springs_are_no_fault_of_a_log(wrist: Library, log: Recording, tmp_path: Path) -> None:
    """Property: the checks compare the torque without springs and curves with the links."""
    path = tmp_path / "sprung.npz"
    write_recording(log, path)
    found = [f.kind for f in inspect_log(path, wrist).findings if f.level != "info"]
    assert found == []
