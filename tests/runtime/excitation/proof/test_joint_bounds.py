"""Bounds of the joints' motion as a theorem: on any grid, with limits that differ by side."""

import numpy as np
import pytest

from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import COSINE
from runtime.excitation.proof import bounds as room
from runtime.excitation.proof.bounds import joint_bounds
from runtime.excitation.proof.certificate import certificate_of
from runtime.library import Library
from tests.runtime.excitation.proof.test_certificate import brute


@pytest.mark.parametrize("harmonics", [1, 2, 3])
def test_bounds_hold_on_a_coarse_grid(
    lib: Library, monkeypatch: pytest.MonkeyPatch, harmonics: int
) -> None:
    """Oracle: samples of the kernel; the theorem holds for intervals of any length.

    With δ = 1/80 of the motion the term of third order counts: a bound without it is passed where
    |g''| is largest between two points of the grid.
    """
    monkeypatch.setattr(room, "INTERVALS", 40)
    monkeypatch.setattr(room, "INTERVALS_PER_HARMONIC", 20)
    for seed in range(40):
        a = np.random.default_rng(seed).normal(size=(lib.n_joints, harmonics))
        trajectory = Trajectory(lib.home, 1e-2 * a, 7.3)
        bounds, _ = joint_bounds(lib, trajectory)
        assert (bounds >= brute(lib, trajectory, 20_001) * (1 - 1e-12)).all(), seed


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("joint", [1, 3])
def test_the_stated_position_is_the_one_of_the_motion(
    lib: Library, joint: int, side: float
) -> None:
    """Oracle: way from home and room of that side, by samples; home is not in the middle.

    The largest use, its value and its limit belong together: value = largest way, limit = room.
    """
    s = np.linspace(0, 1, 4001)
    wave = COSINE.derivatives(1, 2, s)[0]
    limits = lib.limits()
    home = lib.home.copy()
    home[joint] = limits["lower"][joint] + 0.3 * (limits["upper"] - limits["lower"])[joint]
    a = np.zeros((lib.n_joints, 2))
    a[joint, 0] = side
    ways = wave @ a[joint]
    largest = ways[np.argmax(np.abs(ways))]
    up, down = limits["upper"][joint] - home[joint], home[joint] - limits["lower"][joint]
    scale = 0.8 * (up if largest > 0 else down) / abs(largest)
    trajectory = Trajectory(home, scale * a, 9.0)
    (use,) = (u for u in certificate_of(lib, trajectory).uses if u.kind == "position")
    assert use.where == lib.joint_names[joint]
    assert use.bound == pytest.approx(0.8, rel=1e-5)  # of the chord, and of the samples above
    assert use.limit == pytest.approx(up if largest > 0 else down, rel=1e-12)
    assert use.value == pytest.approx(scale * abs(largest), rel=1e-5)
    assert 0 < use.time < 9.0
