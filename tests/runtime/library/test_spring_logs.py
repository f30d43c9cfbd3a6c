"""Logs of a robot with springs: what `identify` and `inspect` do where nobody names the springs."""

from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime import Recording, write_recording
from runtime.inspection import inspect_log
from runtime.library import Library
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
    result = runtime.identify(log, wrist, friction_columns=terms, certify=False)
    rest = result.predict(log.q, log.dq, log.required("ddq")) - log.required("tau")
    assert rest.std(axis=0).max() < 1.1 * NOISE
    places = [terms.columns.index(f"spring:{name}") for name in ("back", "strut")]
    np.testing.assert_allclose(result.phi[0, places], STIFFNESS, rtol=0.03)


def test_springs_are_no_fault_of_a_log(wrist: Library, log: Recording, tmp_path: Path) -> None:
    """Property: the checks compare the torque without springs and curves with the links."""
    path = tmp_path / "sprung.npz"
    write_recording(log, path)
    found = [f.kind for f in inspect_log(path, wrist).findings if f.level != "info"]
    assert found == []
