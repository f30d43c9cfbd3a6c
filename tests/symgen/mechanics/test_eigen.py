"""eigen.h: the two outermost eigenpairs against LAPACK, for spectra that are hard to separate."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from tests.robots import levels_here
from tests.symgen.builds import with_headers

EPS = np.finfo(float).eps
DRIVER = r"""
#include "eigen.h"
#define JOIN(level, name) name##_##level
#define AT(level, name) JOIN(level, name)
int AT(LEVEL, pairs)(int n, int ld, double *a, double *values, double *low, double *high,
                     double *work);
int AT(LEVEL, pairs)(int n, int ld, double *a, double *values, double *low, double *high,
                     double *work)
{
    double *d = work, *e = d + ld, *f = e + ld, *spare = f + ld, *vectors[2] = {low, high};
    tridiagonal(n, ld, a, d, e, f, spare);
    outermost(n, d, e, spare, values, values + 1);
    eigenvectors(n, d, e, values, vectors, spare);
    reflect(n, ld, a, f, low, high);
    return 0;
}
"""
Pairs = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@pytest.fixture(scope="module")
def solvers(tmp_path_factory: pytest.TempPathFactory, fr3) -> dict[str, Pairs]:
    """level → (a → [low, high], v_low, v_high), for the levels that run here."""
    folder = tmp_path_factory.mktemp("eigen")
    dll = with_headers(folder, DRIVER, "eigen.h", "lanes.h")
    return {level: _solver(dll[f"pairs_{level}"]) for level in levels_here(fr3)}


def _solver(function) -> Pairs:
    def solve(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        n = len(matrix)
        ld = -(-n // 8) * 8
        # What lies beyond the matrix must not matter, as long as it is finite.
        a = np.full((n, ld), 7.25)
        a[:, :n] = matrix
        values, low, high, work = np.zeros(2), np.zeros(ld), np.zeros(ld), np.full(8 * ld, 3.5)
        pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (a, values, low, high, work)]
        function(ctypes.c_int(n), ctypes.c_int(ld), *pointers)
        return values, low[:n], high[:n]

    return solve


def with_spectrum(values: np.ndarray, seed: int) -> np.ndarray:
    """A symmetric matrix with these eigenvalues and random eigenvectors."""
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(len(values), len(values))))[0]
    matrix = (basis * values) @ basis.T
    return (matrix + matrix.T) / 2


def check(solve: Pairs, matrix: np.ndarray) -> None:
    """Values by LAPACK's, vectors by their residual, which holds for multiple values, too."""
    n, known = len(matrix), np.linalg.eigvalsh(matrix)
    values, low, high = solve(matrix)
    # Both are backward stable: n roundings of the largest value, seen 1.5 of them.
    slack = 8 * np.sqrt(n) * EPS * max(known[-1], np.finfo(float).tiny)
    assert abs(values[0] - max(known[0], 0.0)) <= slack
    assert abs(values[1] - known[-1]) <= slack
    for value, vector in ((known[0], low), (known[-1], high)):
        assert abs(np.linalg.norm(vector) - 1) <= 1e-13
        assert np.linalg.norm(matrix @ vector - value * vector) <= 4 * slack


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 8, 9, 16, 17, 31, 43, 48, 49, 65, 100])
def test_outermost_pairs_of_random_matrices(solvers: dict[str, Pairs], n: int) -> None:
    """Oracle: numpy.linalg.eigvalsh, every size around the vectors' own, every level."""
    for solve in solvers.values():
        for seed in range(10):
            rows = np.random.default_rng(seed).normal(size=(2 * n, n))
            check(solve, rows.T @ rows)


SPECTRA = {
    "one": np.ones(43),
    "two": np.r_[np.ones(20), 3 * np.ones(23)],
    "double ends": np.r_[1e-5, 1e-5, np.linspace(0.1, 3, 37), 5, 5, 5, 5],
    "near ends": np.r_[1e-3, 1e-3 + 1e-12, np.linspace(0.1, 3, 39), 5, 5 + 1e-13],
    "graded": np.geomspace(1e-12, 10, 43),
    "deficient": np.r_[np.zeros(10), np.ones(33)],
    "rank one": np.r_[np.zeros(42), 43.0],
    "many small": np.r_[np.full(90, 1e-14), np.linspace(1, 9, 10)],
    "wide": np.r_[1e-6, np.linspace(1, 100, 119)],
}


@pytest.mark.parametrize("name", SPECTRA)
def test_clusters_and_missing_rank(solvers: dict[str, Pairs], name: str) -> None:
    """Oracle: numpy.linalg.eigvalsh; multiple, nearly multiple and vanishing eigenvalues."""
    for solve in solvers.values():
        for seed in range(10):
            check(solve, with_spectrum(SPECTRA[name], seed))


def test_matrices_that_are_tridiagonal_or_diagonal_already(solvers: dict[str, Pairs]) -> None:
    """Oracle: numpy.linalg.eigvalsh, where a reflection has nothing to do."""
    second = 2 * np.eye(43) - np.eye(43, k=1) - np.eye(43, k=-1)
    blocks = np.kron(np.eye(10), np.array([[2.0, 1.0], [1.0, 2.0]]))
    for solve in solvers.values():
        for matrix in (np.eye(43), np.diag(np.arange(1.0, 44.0)), second, blocks):
            check(solve, matrix)


@pytest.mark.parametrize("size", [1e-150, 1e-139, 1e-120, 1e-76, 1e-74, 1e-20])
def test_entries_that_only_rounding_made(solvers: dict[str, Pairs], size: float) -> None:
    """Oracle: numpy.linalg.eigvalsh, where squares and their inverses leave the doubles' range."""
    matrix = np.eye(43)
    matrix[20, :10] = matrix[:10, 20] = size
    for solve in solvers.values():
        check(solve, matrix)


def test_what_is_not_finite_gives_nan(solvers: dict[str, Pairs]) -> None:
    """Property: NaN or infinity anywhere makes both values NaN, and it ends."""
    for solve in solvers.values():
        for bad in (np.nan, np.inf):
            for place in ((0, 0), (20, 7), (42, 42), (42, 41), (1, 0)):
                matrix = np.eye(43)
                matrix[place] = matrix[place[::-1]] = bad
                assert np.isnan(solve(matrix)[0]).all(), place
