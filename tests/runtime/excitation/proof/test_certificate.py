"""certificate: bounds over all t, proven, tight, and told where nothing can be proven."""

from pathlib import Path

import numpy as np
import pytest

from runtime import load
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import CARRIED, UNCHECKED
from runtime.excitation.motion.trajectory import COSINE, JoinedMotion, fourier_basis
from runtime.excitation.proof.certificate import (
    KINDS,
    certificate_of,
    certified,
    fastest,
    joint_bounds,
    pulled_inside,
)
from runtime.library import Library


def brute(lib: Library, trajectory: Trajectory, count: int = 1_000_001) -> np.ndarray:
    """max |value| / limit at equally spaced samples by the library's own kernel, (4, n)."""
    limits = lib.limits()
    best = np.zeros((4, lib.n_joints))
    for t in np.array_split(np.linspace(0, trajectory.duration, count), 20):
        q, *rest = trajectory.at(lib, t)
        way = q - trajectory.home
        up, down = limits["upper"] - trajectory.home, trajectory.home - limits["lower"]
        rows = [np.maximum(way / up, -way / down).max(0)]
        rows += [np.abs(x).max(0) / limits[kind] for x, kind in zip(rest, KINDS[1:], strict=True)]
        best = np.maximum(best, rows)
    return best


def random_motion(lib: Library, harmonics: int, seed: int, size: float = 1e-2) -> Trajectory:
    rng = np.random.default_rng(seed)
    return Trajectory(lib.home, size * rng.normal(size=(lib.n_joints, harmonics)), 7.3)


def test_derivatives_are_the_kernel_and_finite_differences(lib: Library) -> None:
    """Oracle: the compiled basis for k ≤ 3, central differences of our own below above that."""
    harmonics, duration = 6, 2.5
    s = np.linspace(0, 1, 301)
    result = COSINE.derivatives(7, harmonics, s)
    kernel = fourier_basis(lib, harmonics, s * duration, duration)
    for k in range(4):
        scaled = result[k] / duration**k
        # Rounding of cosines of arguments up to 38 and of factors (2πm)^k.
        assert scaled == pytest.approx(kernel[..., k], abs=1e-13 * np.abs(scaled).max())
    h = 1e-5
    lower, higher = COSINE.derivatives(7, harmonics, s - h), COSINE.derivatives(7, harmonics, s + h)
    for k in range(1, 7):
        slope = (higher[k - 1] - lower[k - 1]) / (2 * h)
        # Truncation (2πM h)²/6 = 2e-8 and rounding ε/(2πM h) = 1e-13 per harmonic.
        assert slope == pytest.approx(result[k], abs=1e-7 * np.abs(result[k]).max())


@pytest.mark.parametrize("k", range(7))
def test_suprema_are_above(k: int) -> None:
    """Property: no sample of |d^k φ| exceeds its bound, and the bound is not idle."""
    largest = np.abs(COSINE.derivatives(7, 8, np.linspace(0, 1, 20_001))[k]).max(axis=0)
    bound = COSINE.bound(k, 8)
    assert (largest <= bound * (1 + 1e-12)).all()
    assert (bound <= 5 * largest).all()  # m = 1: wave and hump cancel most of each other


@pytest.mark.parametrize("harmonics", [1, 5, 10])
def test_bounds_are_above_and_close(lib: Library, harmonics: int) -> None:
    """Oracle: a million samples of the kernel; above them, by less than 1e-6 of them."""
    trajectory = random_motion(lib, harmonics, harmonics)
    bounds, times = joint_bounds(lib, trajectory)
    largest = brute(lib, trajectory)
    assert (bounds >= largest).all()
    assert (bounds <= largest * (1 + 1e-6)).all()
    # The time it names is one of the maximum, to a step of the grid.
    for j in range(lib.n_joints):
        dq = trajectory.at(lib, times[1, j : j + 1])[1][0, j]
        assert abs(dq) / lib.limits()["velocity"][j] == pytest.approx(bounds[1, j], rel=1e-5)


@pytest.mark.parametrize("order", range(4))
def test_a_violation_between_samples_is_caught(lib: Library, order: int) -> None:
    """Adversary: scaled so that a grid of 0.1 s and its neighbours see 99.99…% of the limit."""
    trajectory = random_motion(lib, 10, 3 + order)
    grid = np.linspace(0, trajectory.duration, 74)
    limits = lib.limits()
    values = trajectory.at(lib, grid)[order]
    if order == 0:
        way = values - lib.home
        seen = np.maximum(way / (limits["upper"] - lib.home), way / (limits["lower"] - lib.home))
    else:
        seen = np.abs(values) / limits[KINDS[order]]
    scale = 0.9999 / seen.max(axis=0)
    adversary = Trajectory(lib.home, trajectory.coefficients * scale[:, None], trajectory.duration)
    assert brute(lib, adversary, 20_001)[order].max() > 1, "the test's own motion must violate"
    use = certificate_of(lib, adversary).uses[order]
    assert (use.kind, use.holds) == (KINDS[order], False)
    assert not certificate_of(lib, adversary).holds


def test_rest(lib: Library) -> None:
    """Property: a robot that stands still uses nothing, exactly."""
    result = certificate_of(lib, Trajectory(lib.home, np.zeros((7, 5)), 10.0))
    assert [use.bound for use in result.uses] == [0.0] * 4
    assert [use.margin for use in result.uses] == [1.0] * 4
    assert (result.holds, result.unlimited) == (True, ())
    assert result.unchecked == UNCHECKED[: UNCHECKED.index(CARRIED)]


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_no_number_is_no_proof(lib: Library, value: float) -> None:
    """Property: what is not a number never passes, whatever else the motion does."""
    for joint in (0, 6):
        a = np.full((7, 3), 1e-4)
        a[joint, 1] = value
        with np.errstate(all="ignore"):
            result = certificate_of(lib, Trajectory(lib.home, a, 10.0))
        assert not result.holds
        assert {use.where for use in result.broken} == {lib.joint_names[joint]}
    home = lib.home.copy()
    home[2] = np.nan
    result = certificate_of(lib, Trajectory(home, np.full((7, 3), 1e-4), 10.0))
    assert [use.kind for use in result.broken] == ["position"]


@pytest.mark.parametrize("beyond", [0.0, 0.1])
def test_a_home_on_its_limit_has_no_room(lib: Library, beyond: float) -> None:
    """Property: outside is told as an infinite use of the position."""
    home = lib.home.copy()
    home[4] = lib.limits()["upper"][4] + beyond
    use = certificate_of(lib, Trajectory(home, np.full((7, 3), 1e-4), 10.0)).uses[0]
    assert (use.bound, use.where, use.holds) == (np.inf, "fr3_joint5", False)


def test_limits_that_no_robot_states(tiny_built: Path) -> None:
    """Property: without a limit there is no proof, and the certificate says so."""
    lib = load(tiny_built)
    result = certificate_of(lib, Trajectory(lib.home, np.full((1, 2), 1e-3), 10.0))
    assert [use.kind for use in result.uses] == ["position", "velocity"]
    assert result.unlimited == ("acceleration of swing", "jerk of swing")
    assert result.sentences()[-4] == "no limit stated: jerk of swing"
    assert result.sentences()[-1] == "NOT checked: table"


def test_designs_are_pulled_inside(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Property: touching at samples becomes holding everywhere, by less than 1e-5; others stay."""
    for trajectory in trajectories:
        assert not certificate_of(lib, trajectory).holds
        inside = pulled_inside(lib, trajectory)
        assert certificate_of(lib, inside).holds
        assert inside.coefficients == pytest.approx(trajectory.coefficients, rel=1e-5)
    far = Trajectory(lib.home, 1.01 * trajectories[0].coefficients, 10.0)
    bounds, _ = joint_bounds(lib, far)
    kept = bounds.max(axis=0) > 1.001
    assert kept.any()
    assert np.array_equal(pulled_inside(lib, far).coefficients[kept], far.coefficients[kept])


def test_slowing_keeps_the_path(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Property: the same positions later; uses fall with r, r², r³; `fastest` in percents."""
    motion = Trajectory(lib.home, trajectories[0].coefficients, 5.0)
    half = motion.slowed(0.5)
    t = np.linspace(0, 5, 51)
    assert np.array_equal(half.at(lib, 2 * t)[0], motion.at(lib, t)[0])
    for k in range(4):
        ratio = joint_bounds(lib, half)[0][k] / joint_bounds(lib, motion)[0][k]
        assert ratio == pytest.approx(0.5**k, rel=1e-9)
    motion = Trajectory(lib.home, 0.9 * motion.coefficients, 5.0)
    r = fastest(certified(lib, motion))
    assert 0.1 < r < 1
    assert certificate_of(lib, motion.slowed(r)).holds
    assert not certificate_of(lib, motion.slowed(r + 0.01)).holds
    with np.errstate(all="ignore"):
        lost = Trajectory(lib.home, np.full((7, 2), np.nan), 5.0)
        assert fastest(certified(lib, lost)) == 0
    for wrong in (0.0, 1.1, -1.0, np.nan):
        with pytest.raises(IdentificationError, match="a replay needs a speed above 0"):
            motion.slowed(wrong)


def test_motions_in_a_row_use_what_the_largest_of_them_uses(lib: Library) -> None:
    """Oracle: a motion alone is a row; one of twice the size behind it has the uses, later."""
    small = random_motion(lib, 4, 2)
    large = Trajectory(lib.home, 2 * small.coefficients, small.duration)
    alone = certified(lib, JoinedMotion((small,), ("small",))).certificate
    assert alone == certificate_of(lib, small)
    row = certified(lib, JoinedMotion((small, large), ("small", "large"))).certificate
    expected = certificate_of(lib, large)
    for use, one in zip(row.uses, expected.uses, strict=True):
        assert (use.kind, use.where, use.bound) == (one.kind, one.where, one.bound)
        assert use.time == pytest.approx(small.duration + one.time, rel=1e-12)
        assert use.intervals == 2 * one.intervals


@pytest.mark.parametrize(
    ("shape", "duration"), [((6, 5), 10.0), ((7,), 10.0), ((7, 0), 10.0), ((7, 5), 0.0)]
)
def test_other_robots_are_reported(lib: Library, shape: tuple[int, ...], duration: float) -> None:
    """Property: one sentence with both shapes."""
    with pytest.raises(IdentificationError, match="needs a home of shape"):
        certificate_of(lib, Trajectory(lib.home, np.zeros(shape), duration))
