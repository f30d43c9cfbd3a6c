"""regression: the objective over the factor is the objective over all samples."""

import numpy as np
import pytest

from runtime import Recording
from runtime.estimators.regression.factor import (
    CompressedObjective,
    TorqueObjective,
    compress,
    joined,
)
from runtime.estimators.regression.samples import samples_of, thesis_weights
from runtime.library import Library
from runtime.recording import Friction
from runtime.recording.friction.model import add_columns


def test_joined_triangles_of_numpy_and_of_c_agree(lib: Library) -> None:
    """Oracle: the compiled join against NumPy's QR."""
    assert lib.compiled_statistics is not None
    triangles = np.triu(np.random.default_rng(0).normal(size=(5, 44, 44)))
    wanted = joined(triangles)
    # Rounding times the condition number of random columns.
    assert lib.compiled_statistics.join(triangles) == pytest.approx(wanted, abs=1e-12)


def test_compressed_objective_is_the_objective(lib: Library, noisy: Recording) -> None:
    """Oracle: value and gradient from R, r, ρ equal those from all samples."""
    s = samples_of(add_columns(noisy, Friction()), lib)
    whole = TorqueObjective(lib, s, thesis_weights(s.tau))
    rng = np.random.default_rng(3)
    lam = lib.lam0 * (1 + 0.1 * rng.normal(size=lib.lam0.size))
    x = whole.join(lam, rng.uniform(0.1, 1.0, whole.shape))
    statistics = compress(lib, s, whole.weights)
    value, gradient = CompressedObjective(whole, statistics).value_gradient(x)
    expected, slope = whole.value_gradient(x)
    # Rounding of a QR of 7000 rows: 1e-16 × √7000, and a factor 10 for the cancellation in r.
    assert value == pytest.approx(expected, rel=1e-12)
    assert np.linalg.norm(gradient - slope) <= 1e-12 * np.linalg.norm(slope)
    lam, phi = whole.split(x)
    assert statistics.value(lib.pi_from_lam(lam), phi) == pytest.approx(expected, rel=1e-12)
    both = np.concatenate([lib.pi0, phi.ravel()])
    assert statistics.over_pi() @ both - statistics.target == pytest.approx(
        statistics.residual(lib.pi0, phi), abs=1e-10 * np.linalg.norm(statistics.target)
    )


def test_nothing_measured_beyond_parameters_leaves_no_rest(
    lib: Library, ideal_runs: tuple[Recording, ...], pi_true: np.ndarray
) -> None:
    """Property: ρ and the loss at the truth vanish on noise-free data."""
    s = samples_of(ideal_runs[0], lib)
    statistics = compress(lib, s, np.ones(7))
    scale = float(np.sum(s.tau**2))
    # Squares of rounding.
    assert statistics.rest < 1e-26 * scale
    assert statistics.value(pi_true, np.zeros((7, 0))) * 2 * len(s) < 1e-26 * scale
