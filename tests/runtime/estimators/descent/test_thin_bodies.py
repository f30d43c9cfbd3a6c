"""Bodies on the boundary of consistency after a descent: recognised, named and thickened."""

import numpy as np
import pytest

from runtime.estimators.descent.fit import THINNEST_AXIS, fit_of, start_of
from runtime.estimators.optimizers import Outcome, Status, Trace
from runtime.library import Library
from tests.runtime.estimators.descent.test_descent import problem


@pytest.mark.parametrize("thin", [(), (2,), (0, 6)])
def test_a_plate_is_thickened_and_named(fr3: Library, thin: tuple[int, ...]) -> None:
    """Property: c = 0 makes P singular; the fit has every P ≻ 0 and leaves other links alone."""
    descent = start_of(problem(fr3))
    lam, phi = descent.objective.split(descent.x0)
    lam = lam.reshape(7, 10).copy()
    lam[:, 7:] = np.maximum(lam[:, 7:], 0.02)  # link 7 of the URDF is a plate itself
    lam[list(thin), 9] = 0.0
    x = descent.objective.join(lam.ravel(), phi)
    fit = fit_of(descent, outcome(x))
    shares = fr3.relative_eigenvalues(fit.pi)
    # The floor itself, to the rounding of an eigenvalue, relative to the trace.
    assert shares.min() > 0.9 * THINNEST_AXIS
    given = descent.bodies(x).reshape(7, 10)
    changed = np.flatnonzero((fit.pi.reshape(7, 10) != given).any(axis=1))
    assert tuple(changed) == thin
    assert bool(fit.notes) == bool(thin)
    for k, name in enumerate(fr3.link_names):
        assert any(name in note for note in fit.notes) == (k in thin)
    if thin:  # the note states the change, to its two digits
        change = np.abs(fit.pi.reshape(7, 10) - given).max()
        assert f"largest change {change:.1e} kg·m²" in fit.notes[0]
    assert fit.lam is not None
    np.testing.assert_allclose(fr3.pi_from_lam(fit.lam), fit.pi, atol=1e-9)


def outcome(x: np.ndarray) -> Outcome:
    return Outcome(x, 0.0, 1, Status.CONVERGED, Trace((), (), ()))
