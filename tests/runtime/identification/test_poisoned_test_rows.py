"""Test rows take part in no choice: with a poisoned torque they change the test error alone."""

import numpy as np
import pytest

from runtime import Recording, identify
from runtime.inspection.friction_choice import choose_friction
from runtime.library import Library
from runtime.recording import Friction, Split

PARTS = Split((0.0, 0.6), (0.6, 0.8), (0.8, 1.0))


def poisoned(log: Recording) -> Recording:
    """The same log with 1 kN·m of noise on the torque of its test rows."""
    tau = log.tau.copy()
    test = log.t >= log.t[0] + 0.8 * log.duration
    tau[test] += 1e3 * np.random.default_rng(0).normal(size=(int(test.sum()), tau.shape[1]))
    return log.replace(tau=tau)


@pytest.mark.parametrize("columns", [(), ("viscous", "coulomb")])
@pytest.mark.parametrize("method", ["map", "ols", "wls", "pc-ols", "lm", "adam"])
def test_a_fit_has_not_seen_the_test_rows(
    lib: Library, noisy: Recording, method: str, columns: tuple[str, ...]
) -> None:
    """Property: π, φ and their uncertainty are equal to the bit."""
    terms = Friction(columns)
    clean, dirty = (
        identify(log, lib, method, friction_columns=terms, splitting=PARTS, certify=False)
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
        choose_friction(log, lib, splitting=PARTS, names=names) for log in (noisy, poisoned(noisy))
    )
    assert clean == dirty
