"""Extensions of SciPy without its packages: the same digits as the packages."""

import clarabel
import numpy as np
import pytest
from scipy import fft, linalg, optimize, signal, sparse, special
from scipy.spatial.transform import Rotation

from runtime.numerics import cosines as cosines_module
from runtime.numerics import nonnegative
from runtime.numerics import sections as sections_module
from runtime.numerics.cosines import cosines, is_fast_length
from runtime.numerics.dense import (
    block_diag,
    null_space,
    pivoted_qr,
    solve_positive,
    solve_triangular,
)
from runtime.numerics.extension import extension
from runtime.numerics.quantiles import NORMAL_95, chi2_quantile
from runtime.numerics.rotations import matrix_from_rpy
from runtime.numerics.sections import (
    both_directions,
    butterworth_sections,
    response,
    steady_state,
)
from runtime.numerics.sparse import columns_of, solve_conic

RNG = np.random.default_rng(0)
TALL = RNG.normal(size=(60, 22))


def test_an_absent_extension_is_none() -> None:
    """Property: neither a wrong name nor an absent function raises; the package serves instead."""
    assert extension("scipy.linalg._no_such", ()) is None
    assert extension("scipy.linalg._flapack", ("no_such",)) is None
    assert extension("scipy.linalg._flapack", ("dpotrf",)) is not None


@pytest.mark.parametrize("order", range(1, 9))
def test_butterworth_is_that_of_scipy(order: int) -> None:
    """Oracle: scipy.signal.butter; poles and gain differ by the rounding of products."""
    for cutoff in (1e-5, 1e-3, 0.02, 0.3, 0.5, 0.9):
        theirs = signal.butter(order, cutoff, output="sos")
        ours = butterworth_sections(order, cutoff)
        np.testing.assert_allclose(ours, theirs, rtol=4e-15, atol=4e-16)
        assert np.array_equal(steady_state(theirs), signal.sosfilt_zi(theirs))


@pytest.mark.parametrize("compiled", [True, False])
def test_filter_and_transform_are_those_of_scipy(compiled: bool, monkeypatch) -> None:
    """Oracle: sosfiltfilt, dct and freqz_sos, with and without the extension."""
    if not compiled:
        monkeypatch.setattr(sections_module, "_compiled", None)
        monkeypatch.setattr(cosines_module, "_compiled", None)
    sections, values = signal.butter(4, 0.05, output="sos"), RNG.normal(size=(500, 3))
    theirs = signal.sosfiltfilt(sections, values, axis=0, padlen=100)
    assert np.array_equal(both_directions(sections, values, 100), theirs)
    assert np.array_equal(cosines(values), fft.dct(values, axis=0, norm="ortho"))
    frequency, gain = response(sections, 64)
    w, h = signal.freqz_sos(sections, 64)
    np.testing.assert_array_equal(frequency, w)
    # Sums of three terms that cancel to the distance from a pole, 1e-3.
    np.testing.assert_allclose(gain, np.abs(h) ** 2, rtol=1e-11, atol=1e-15)


def test_lengths_of_transforms() -> None:
    """Oracle: next_fast_len of real data."""
    fast = [k for k in range(1, 500) if fft.next_fast_len(k, True) == k]
    assert [k for k in range(1, 500) if is_fast_length(k)] == fast


def test_linear_algebra_is_that_of_scipy() -> None:
    """Oracle: the same LAPACK called by scipy.linalg gives the same bits."""
    for ours, theirs in zip(pivoted_qr(TALL), linalg.qr(TALL, pivoting=True), strict=True):
        assert np.array_equal(ours, theirs)
    upper, gram, right = linalg.qr(TALL)[1][:22], TALL.T @ TALL, RNG.normal(size=(22, 5))
    for order in ("C", "F"):
        matrix = np.array(upper, order=order)
        theirs = linalg.solve_triangular(matrix, right)
        assert np.array_equal(solve_triangular(matrix, right), theirs)
    theirs = linalg.cho_solve(linalg.cho_factor(gram, lower=True), right[:, 0])
    assert np.array_equal(solve_positive(gram, right[:, 0]), theirs)
    assert np.array_equal(null_space(TALL.T), linalg.null_space(TALL.T))
    assert np.array_equal(block_diag(TALL, right), linalg.block_diag(TALL, right))
    assert solve_triangular(np.eye(2), np.zeros((2, 0))).shape == (2, 0)


def test_singular_matrices_are_named() -> None:
    """Property: zero pivots raise the error of NumPy instead of returning numbers."""
    with pytest.raises(np.linalg.LinAlgError, match="diagonal element 2"):
        solve_triangular(np.diag([1.0, 0.0]), np.ones(2))
    with pytest.raises(np.linalg.LinAlgError, match="leading minor 1"):
        solve_positive(-np.eye(2), np.ones(2))


@pytest.mark.parametrize("compiled", [True, False])
def test_nonnegative_least_squares_are_those_of_scipy(compiled: bool, monkeypatch) -> None:
    """Oracle: scipy.optimize.nnls to the bit, by its extension and by its package."""
    if not compiled:
        monkeypatch.setattr(nonnegative, "_compiled", None)
    right = RNG.normal(size=60)
    solution = nonnegative.nonnegative_least_squares(TALL, right)
    assert np.array_equal(solution, optimize.nnls(TALL, right)[0])


def test_quantiles_and_rotation_are_those_of_scipy() -> None:
    """Oracle: ndtri, chdtri and Rotation.from_euler."""
    assert special.ndtri(0.975) == NORMAL_95
    for freedom in (1, 7, 60):
        assert chi2_quantile(freedom, 0.05) == special.chdtri(freedom, 0.05)
    for rpy in RNG.uniform(-4, 4, (20, 3)):
        assert np.array_equal(matrix_from_rpy(rpy), Rotation.from_euler("xyz", rpy).as_matrix())


def test_columns_are_those_of_scipy() -> None:
    """Oracle: csc_matrix; Clarabel's answer of a program with a closed form."""
    matrix = RNG.integers(-1, 2, (5, 7)).astype(float)
    ours, theirs = columns_of(matrix), sparse.csc_matrix(matrix)
    for name in ("data", "indices", "indptr"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name))
    assert ours.shape == theirs.shape
    # The largest x with [[1, x], [x, 1]] ⪰ 0 is 1; b − A x is svec of the matrix.
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    a, b = np.array([[0.0], [-np.sqrt(2)], [0.0]]), np.array([1.0, 0.0, 1.0])
    answer = solve_conic(np.array([-1.0]), a, b, [clarabel.PSDTriangleConeT(2)], settings)
    assert answer.x[0] == pytest.approx(1.0, abs=1e-7)  # Clarabel's tolerance is 1e-8
