"""basis: rest at the ends, closed forms, bounds; designs in every basis."""

import json
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from scipy.interpolate import make_interp_spline

from runtime import to_pinocchio_order
from runtime.errors import IdentificationError, RecordingError
from runtime.excitation import Trajectory
from runtime.excitation.motion.family import Basis, Spline
from runtime.excitation.motion.trajectory import BASES, Cosine, Fourier, basis_of, read_trajectory
from runtime.excitation.proof.certificate import KINDS, certificate_of, joint_bounds
from runtime.excitation.search.design import Design, design, write_trajectory
from runtime.library import Library
from tests.oracle import pinocchio_model
from tests.taylor import assert_second_order, taylor_slope

EVERY = [BASES[name].make(zero_jerk) for name in BASES for zero_jerk in (False, True)]
BY_BASIS = pytest.mark.parametrize(
    "basis", EVERY, ids=[f"{b.name}{' without jerk' * b.zero_jerk}" for b in EVERY]
)
SIZE = 6


def motion_of(basis: Basis, home: np.ndarray, size: float = 1e-3) -> Trajectory:
    rng = np.random.default_rng(3)
    return Trajectory(home, size * rng.normal(size=(len(home), SIZE)), 5.0, basis)


@BY_BASIS
def test_rest_at_both_ends(basis: Basis) -> None:
    """Property: φ, φ', φ'' vanish at both ends, φ''' where asked; the next one does not."""
    result = basis.derivatives(5, SIZE, np.array([0.0, 1.0]))
    inside = np.abs(basis.derivatives(5, SIZE, np.linspace(0, 1, 501))).max(axis=1)
    # Waves and polynomials cancel: w^5 = (2π6)^5 times ε over the size of the function.
    rest = np.abs(result).max(axis=1) / inside
    assert rest[: 3 + basis.zero_jerk].max() <= 1e-9
    assert rest[3 + basis.zero_jerk].min() > 1e-2 or isinstance(basis, Spline)
    assert basis.is_symmetric == isinstance(basis, Cosine)


@BY_BASIS
@pytest.mark.parametrize("order", range(4))
def test_derivatives_by_taylor(basis: Basis, order: int) -> None:
    """Derivative: each order is that of the one below; splines between their knots."""

    def one_below(s: np.ndarray) -> np.ndarray:
        return basis.derivatives(order + 1, SIZE, s)[order, 0]

    s = np.array([0.4137])
    slope = basis.derivatives(order + 2, SIZE, s)[order + 1, 0]
    measured = taylor_slope(one_below, s, np.array([0.03]), 0.03 * slope)
    # A quintic's fourth derivative is a straight line there, without a second-order remainder.
    if not (isinstance(basis, Spline) and order == 4):
        assert_second_order(measured, decades=2.5)  # rounding of w^k ends it, earlier for high k


@BY_BASIS
def test_bounds_hold_and_are_not_idle(basis: Basis) -> None:
    """Property: no sample of |d^k φ| exceeds its bound; up to the jerk's curvature it is near."""
    s = np.linspace(0, 1, 20_001)
    result = np.abs(basis.derivatives(7, SIZE, s)).max(axis=1)
    for k in range(7):
        bound = basis.bound(k, SIZE)
        assert (result[k] <= bound * (1 + 1e-12)).all()
    # Where the amplitude is asked for wave and polynomials cancel most of each other.
    assert (basis.bound(5, SIZE)[:2] <= 5 * result[5][:2]).all()


def test_sines_by_hand() -> None:
    """Oracle: the quintic and septic through six and eight conditions, by a linear solve."""
    for zero_jerk, conditions in ((False, 3), (True, 4)):
        s = np.linspace(0, 1, 57)
        powers = np.arange(2 * conditions)
        rows, wanted = [], []
        for end in (0.0, 1.0):
            for k in range(conditions):
                factor = (
                    np.prod([powers - i for i in range(k)], axis=0) if k else np.ones(len(powers))
                )
                rows.append(factor * end ** np.maximum(powers - k, 0))
        for m in range(1, 4):
            w = 2 * np.pi * m
            wanted = [0.0, -w, 0.0, w**3][:conditions] * 2
            line = np.linalg.solve(np.array(rows), np.array(wanted))
            expected = np.sin(w * s) + s[:, None] ** powers @ line
            result = Fourier(zero_jerk).derivatives(1, 6, s)[0, :, 2 + m]
            # Conditions of the monomials' matrix (1e4) × ε × w³.
            assert result == pytest.approx(expected, abs=1e-8)


def test_splines_by_interpolation() -> None:
    """Oracle: scipy's interpolating spline of q = Σ a_m B_m with clamped ends is q again."""
    basis, rng = Spline(), np.random.default_rng(0)
    a = rng.normal(size=SIZE)
    knots = np.linspace(0, 1, SIZE + 6 - 5 + 1)
    at_knots = basis.derivatives(1, SIZE, knots)[0] @ a
    rest = [(1, 0.0), (2, 0.0)]
    again = make_interp_spline(knots, at_knots, k=5, bc_type=(rest, rest))
    s = np.linspace(0, 1, 101)
    assert again(s) == pytest.approx(basis.derivatives(1, SIZE, s)[0] @ a, abs=1e-12)


@BY_BASIS
def test_certificates_bound_every_basis(lib: Library, basis: Basis) -> None:
    """Oracle: 200 000 samples of the motion; above them, by less than 1e-5 of them."""
    motion = motion_of(basis, lib.home)
    bounds, _ = joint_bounds(lib, motion)
    q, *rest = motion.at(lib, np.linspace(0, motion.duration, 200_001))
    limits, way = lib.limits(), q - lib.home
    up, down = limits["upper"] - lib.home, lib.home - limits["lower"]
    rows = [np.maximum(way / up, -way / down).max(0)]
    rows += [np.abs(x).max(0) / limits[kind] for x, kind in zip(rest, KINDS[1:], strict=True)]
    assert (bounds >= np.array(rows) * (1 - 1e-12)).all()
    assert (bounds <= np.array(rows) * (1 + 1e-5)).all()


def test_a_peak_in_the_second_half_counts(lib: Library) -> None:
    """Property: a spline that moves near its end only is seen by certificate, limits and cost."""
    a = np.zeros((7, SIZE))
    a[3, -1] = 100.0
    assert not certificate_of(lib, Trajectory(lib.home, a, 5.0, Spline())).holds


def by_hand(facts: dict, t: np.ndarray) -> list[np.ndarray]:
    """q, dq, ddq from a file's numbers alone, by the closed forms of the bases."""
    a, duration = np.array(facts["coefficients"]), facts["duration"]
    s, size = t / duration, a.shape[1]
    if facts["basis_name"] == "bspline":
        from scipy.interpolate import BSpline

        inner = np.linspace(0, 1, size + 6 - 5 + 1)
        knots = np.r_[np.zeros(5), inner, np.ones(5)]
        c = np.pad(a, ((0, 0), (3, 3)))
        curves = [BSpline(knots, row, 5) for row in c]
        q = [np.array([curve(s, k) for curve in curves]).T / duration**k for k in range(3)]
    else:
        m = np.arange(1, (size if facts["basis_name"] == "cosine" else size // 2) + 1)
        w, x = 2 * np.pi * m, s[:, None]
        hump = (x**2 * (1 - x) ** 2, 2 * x - 6 * x**2 + 4 * x**3, 2 - 12 * x + 12 * x**2)
        wave = (np.cos(w * x) - 1, -w * np.sin(w * x), -(w**2) * np.cos(w * x))
        parts = [[v + w**2 / 2 * h for v, h in zip(wave, (hump[0], hump[1], hump[2]), strict=True)]]
        if facts["basis_name"] == "fourier":
            ramp = (
                x - 10 * x**3 + 15 * x**4 - 6 * x**5,
                1 - 30 * x**2 + 60 * x**3 - 30 * x**4,
                -60 * x + 180 * x**2 - 120 * x**3,
            )
            sine = (np.sin(w * x), w * np.cos(w * x), -(w**2) * np.sin(w * x))
            parts.append([v - w * r for v, r in zip(sine, ramp, strict=True)])
        phi = [np.hstack([part[k] for part in parts]) for k in range(3)]
        q = [phi[k] @ a.T / duration**k for k in range(3)]
    return [q[0] + facts["home"], q[1], q[2]]


@pytest.fixture(scope="module")
def designs(lib: Library) -> dict[str, Design]:
    return {
        name: design(lib, duration=4.0, harmonics=3, starts=1, basis=basis_of(name))
        for name in BASES
    }


@pytest.mark.parametrize("name", list(BASES))
def test_saved_designs_are_what_they_say(
    lib: Library, designs: dict[str, Design], name: str, tmp_path: Path
) -> None:
    """Oracle: file → closed form → Pinocchio's regressor → SVD: the same cond to four decimals."""
    path = tmp_path / "motion.json"
    write_trajectory(designs[name], lib, path)
    facts = json.loads(path.read_text())
    assert facts["basis_name"] == name
    q, dq, ddq = by_hand(facts, np.linspace(0, facts["duration"], 80))
    model = pinocchio_model(lib.urdf())
    data = model.createData()
    ours = list(to_pinocchio_order(np.arange(lib.pi0.size)).astype(int))
    base = [ours.index(column) for column in lib.base_columns]
    rows = np.vstack(
        [
            pinocchio.computeJointTorqueRegressor(model, data, *state)[:, base]
            for state in zip(q, dq, ddq, strict=True)
        ]
    )
    cond = np.linalg.cond(rows / np.linalg.norm(rows, axis=0))
    assert facts["condition_number"] == pytest.approx(cond, abs=5e-5)
    # The reader's motion is the same, and its limits hold everywhere.
    read = read_trajectory(path, lib)
    assert read.basis == basis_of(name)
    t = np.linspace(0, 4.0, 1001)
    for one, other in zip(read.at(lib, t), by_hand(facts, t), strict=False):
        assert one == pytest.approx(other, abs=1e-9)
    limits = lib.limits()
    q, dq, ddq = by_hand(facts, np.arange(4001) / 1000)
    # Rounding of coefficients of 70 that cancel down to 1.
    slack = 1 + 1e-10
    up, down = limits["upper"] - lib.home, lib.home - limits["lower"]
    way = np.maximum((q - lib.home) / up, (lib.home - q) / down)
    assert way.max() <= slack
    assert (np.abs(dq) / limits["velocity"]).max() <= slack
    assert (np.abs(ddq) / limits["acceleration"]).max() <= slack


def test_the_full_series_has_half_the_condition_number(designs: dict[str, Design]) -> None:
    """Property: with the same harmonics; for five 2.57 against 4.0 was measured (10 s)."""
    full, cosine = designs["fourier"], designs["cosine"]
    # Measured with three harmonics: ratios of 0.35 to 0.41 over four seeds.
    assert full.condition < 0.5 * cosine.condition


def test_no_such_basis() -> None:
    """Property: one sentence."""
    with pytest.raises(IdentificationError, match=r"no basis 'wavelet'.* cosine, fourier"):
        basis_of("wavelet")


def test_files_of_before_and_odd_ones(
    lib: Library, designs: dict[str, Design], tmp_path: Path
) -> None:
    """Property: a file without the name of a basis is one of cosines; what does not fit is told."""
    path = tmp_path / "motion.json"
    write_trajectory(designs["cosine"], lib, path)
    facts = json.loads(path.read_text())
    del facts["basis_name"], facts["zero_jerk_at_ends"]
    path.write_text(json.dumps(facts))
    assert read_trajectory(path, lib).basis == basis_of("cosine")
    for name, match in (("fourier", "pairs of coefficients"), ("wavelet", "no basis 'wavelet'")):
        path.write_text(json.dumps(facts | {"basis_name": name}))  # three coefficients: no pairs
        with pytest.raises(RecordingError, match=match):
            read_trajectory(path, lib)
