"""runtime.identification.metrics: torque errors and distances between mass matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import logm

from runtime.identification.metrics import airm, frobenius, torque_error
from runtime.library import Library


def test_torque_error_by_hand() -> None:
    """Oracle: the norms of a 3-4-5 triangle, by hand."""
    measured = np.array([[3.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    predicted = np.array([[3.0, 0.0, 1.0], [3.0, 0.0, 0.0]])
    error = torque_error(measured, predicted)
    # Nothing was measured at joints 2 and 3.
    assert error.percent == pytest.approx([20.0, np.nan, np.nan], nan_ok=True)
    # √(1 + 1) of 5, to rounding.
    assert error.overall == pytest.approx(100 * np.sqrt(2) / 5, rel=1e-15)
    assert error.rms == pytest.approx([np.sqrt(0.5), 0.0, np.sqrt(0.5)], rel=1e-15)


def test_a_silent_recording_has_no_share() -> None:
    """Property: whatever is predicted where nothing was measured, its share is undefined."""
    silent = np.zeros((4, 2))
    for predicted in (silent, silent + 1):
        error = torque_error(silent, predicted)
        assert np.isnan([error.overall, *error.percent]).all()
        assert (error.rms == predicted[0]).all()


def spd(rng: np.random.Generator, n: int = 4) -> np.ndarray:
    half = rng.normal(size=(n, n))
    return half @ half.T + 0.1 * np.eye(n)


def test_airm_against_the_matrix_logarithm() -> None:
    """Oracle: ‖log(A⁻¹B)‖ through scipy's Schur logarithm, similar matrices keep eigenvalues."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b = spd(rng) + np.eye(4), spd(rng) + np.eye(4)
        half = np.linalg.cholesky(a)
        middle = np.linalg.solve(half, np.linalg.solve(half, b).T)
        # Rounding times condition numbers below 100.
        assert airm(a, b) == pytest.approx(np.linalg.norm(logm(middle)), rel=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_airm_is_an_affine_invariant_metric(seed: int) -> None:
    """Property: symmetric, zero at A = B, triangle inequality, d(GAGᵀ, GBGᵀ) = d(A, B)."""
    rng = np.random.default_rng(seed)
    a, b, c = (spd(rng) for _ in range(3))
    g = np.eye(4) + 0.2 * rng.normal(size=(4, 4))
    d = float(airm(a, b))
    # Rounding times condition numbers up to 1e6 (G included).
    assert float(airm(a, a)) < 1e-7
    assert float(airm(b, a)) == pytest.approx(d, rel=1e-7)
    assert d <= float(airm(a, c)) + float(airm(c, b)) + 1e-7
    assert float(airm(g @ a @ g.T, g @ b @ g.T)) == pytest.approx(d, rel=1e-5)


def test_airm_and_frobenius_take_batches(lib: Library, pi_true: np.ndarray) -> None:
    """Property: N matrices at once are N single calls; scaling by s gives √n ln s."""
    q = np.linspace(lib.home - 0.3, lib.home + 0.3, 5)
    m = lib.mass_matrix(q, pi_true)
    # M of this arm has a condition number of 1e4; ln of eigenvalues keeps 1e-11 of it.
    assert airm(m, np.e * m) == pytest.approx(np.full(5, np.sqrt(7)), rel=1e-9)
    assert frobenius(m, 2 * m) == pytest.approx([np.sqrt((x**2).sum()) for x in m], rel=1e-14)
