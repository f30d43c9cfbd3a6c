"""The Fourier + quintic basis: its ends, its derivatives."""

import numpy as np
import pytest

from runtime.library import Library, load
from tests.taylor import Array, assert_second_order, taylor_slope

T_F = 7.5


@pytest.fixture(params=["fr3", "tiny"])
def lib(request: pytest.FixtureRequest) -> Library:
    """The FR3 as it is committed, and a pendulum that is built for this run."""
    if request.param == "fr3":
        return request.getfixturevalue("fr3")
    return load(request.getfixturevalue("tiny_built"))


@pytest.mark.parametrize("m", [1, 2, 5])
def test_harmonics_start_and_end_at_rest(lib: Library, m: int) -> None:
    """Property: φ_m and two derivatives vanish at both ends (Eqs. 3.24–3.27)."""
    ends = lib.harmonic_basis([m, m], [0.0, T_F], T_F)
    # cos(2πm) is 1 to rounding of its argument; m²(2π)² scales the second derivative.
    scale = 1e-13 * (2 * np.pi * m / T_F) ** np.arange(3)
    assert (np.abs(ends[:, :3]) < scale).all()


def test_harmonics_are_the_formula(lib: Library) -> None:
    """Oracle: NumPy's cos 2πms − 1 + 2π²m² s²(1−s)², for many m and t at once."""
    m, t = (part.ravel() for part in np.meshgrid([1.0, 3.0, 5.0], np.linspace(0, T_F, 31)))
    s = t / T_F
    expected = np.cos(2 * np.pi * m * s) - 1 + 2 * np.pi**2 * m**2 * s**2 * (1 - s) ** 2
    # Terms of up to 31, rounded a few times.
    np.testing.assert_allclose(lib.harmonic_basis(m, t, T_F)[:, 0], expected, rtol=0, atol=1e-13)


def test_transfer_goes_from_rest_to_rest(lib: Library) -> None:
    """Oracle: S = 10s³ − 15s⁴ + 6s⁵ goes from 0 to 1 with two derivatives zero at both ends."""
    ends = lib.transfer_basis([0.0, T_F], T_F)
    np.testing.assert_allclose(ends[0, :3], 0, rtol=0, atol=0)
    np.testing.assert_allclose(ends[1, :3], [1, 0, 0], rtol=0, atol=1e-14)
    middle = lib.transfer_basis(T_F / 2, T_F)[0]
    np.testing.assert_allclose(middle, [0.5, 1.875 / T_F, 0, -30 / T_F**3], rtol=0, atol=1e-15)


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("kind", ["harmonic", "transfer"])
def test_basis_derivatives(lib: Library, kind: str, row: int) -> None:
    """Derivative: each row is the time derivative of the row before it."""

    def basis(t: Array) -> Array:
        if kind == "harmonic":
            return lib.harmonic_basis([3], t, T_F)[0]
        return lib.transfer_basis(t, T_F)[0]

    t = np.array([2.1])
    assert_second_order(taylor_slope(lambda x: basis(x)[row], t, np.ones(1), basis(t)[row + 1]))
