"""bounds on laws whose largest value is known in closed form."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from runtime.excitation import Trajectory
from runtime.excitation.limits.nonlinear_limits import IntervalBounds, SampledMotion
from runtime.excitation.proof import bounds
from runtime.excitation.proof.bounds import (
    SAFETY,
    MotionGrid,
    Peaks,
    _see_braking,
    _see_measured,
    constraint_bounds,
)
from runtime.library import Library
from tests.runtime.excitation.proof.spiked import Spiked

DURATION = 2.0


@dataclass(frozen=True)
class Travel:
    """g = s q₁: the largest value is that of the joint; |g''| ≤ sup |ddq₁|."""

    sign: float = 1.0
    precision: tuple[float, float] = (1e-10, 1e-10)
    kind: ClassVar[str] = "travel"
    orders: ClassVar[int] = 1
    labels: ClassVar[tuple[str, ...]] = ("first joint",)
    even: ClassVar[bool] = True

    def values(self, motion: np.ndarray) -> np.ndarray:
        return self.sign * motion[0][:, :1]

    def rise(self, bounds: IntervalBounds) -> np.ndarray:
        return bounds.bend(bounds.motion[2][:, :1])


@dataclass(frozen=True)
class Wave(Travel):
    """g = cos(k (q₁ − c)) at one crest, −1 elsewhere."""

    waves: float = 0.0
    crest: float = 0.0

    def along(self, sampled: SampledMotion) -> tuple[np.ndarray, np.ndarray]:
        angle = np.clip(self.waves * (sampled.motion[0][:, :1] - self.crest), -np.pi, np.pi)
        return np.cos(angle), -self.waves * np.sin(angle) * sampled.motion[1][:, :1]


def swing(lib: Library) -> Trajectory:
    """The first joint goes to one side and back: its largest distance is that at half time."""
    a = np.zeros((lib.n_joints, 1))
    a[0] = 0.2
    return Trajectory(lib.home, a, DURATION)


def at(lib: Library, motion: Trajectory, time: float) -> float:
    return float(motion.at(lib, np.array([time]))[0][0, 0])


def test_a_divided_interval_counts_both_of_its_ends(lib: Library) -> None:
    """Property: the largest value at the end of the last interval, where half a motion ends."""
    motion = swing(lib)
    half = at(lib, motion, DURATION / 2)
    travel = Travel(np.sign(half - lib.home[0]))
    (bound,) = constraint_bounds(lib, [travel], motion)
    assert bound.intervals > MotionGrid(motion).count // 2  # it was divided
    # Above it by the tolerance and rounding at most, and never below it.
    assert 0 <= bound.bound - abs(half) * np.sign(half) * travel.sign < 3e-10


@pytest.mark.parametrize("most", [1, bounds.MOST_INTERVALS])
def test_what_is_not_decided_keeps_a_proven_bound(
    lib: Library, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """Adversary: a bump between two samples, with and without the intervals that would show it."""
    monkeypatch.setattr(bounds, "MOST_INTERVALS", most)
    height, middle = 1e-6, (round(0.3 * DURATION / 1e-3) + 0.5) * 1e-3 / DURATION
    a = np.zeros((lib.n_joints, 2))
    a[0] = -1e-9, height
    motion = Trajectory(lib.home, a, DURATION, Spiked(middle, 0.45e-3 / DURATION))
    true = at(lib, motion, middle * DURATION)
    samples = motion.at(lib, np.arange(2001) * 1e-3)[0][:, 0]
    assert samples.max() < true - height / 2
    (bound,) = constraint_bounds(lib, [Travel()], motion)
    assert bound.is_proven
    assert bound.bound >= true - 1e-15  # the rounding of q


def test_a_measured_bend_is_counted_with_its_safety(
    lib: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: the crest of a wave of 24 samples, between two of them.

    The change of the slope over an interval is below δ sup |g''| there, by (ωδ)²/24; without the
    safety the bound is below the crest by (ωδ)²/48 of its height above the samples.
    """
    monkeypatch.setattr(Library, "bounds_motions", False)
    motion: Trajectory = swing(lib)
    step = MotionGrid(motion).step
    q, dq, *_ = motion.at(lib, (np.arange(500) + 0.5) * step)
    fastest = np.argmax(np.abs(dq[:, 0]))
    wave = Wave(waves=2 * np.pi / (24 * step * abs(dq[fastest, 0])), crest=q[fastest, 0])
    (bound,) = constraint_bounds(lib, [wave], motion)
    assert not bound.is_proven
    assert bound.bound >= 1.0
    assert bound.bound < 1.0 + 2 * (2 * np.pi / 24) ** 2 / 8


def test_a_long_interval_is_above_the_short_ones_inside() -> None:
    """Adversary: the acceleration rises to 10 in the middle of the last of three long intervals.

    There h'' ≤ 2 a² + a = 210 lets the value rise to 210 · 20²/8 above its ends, and a short
    interval beside the middle, with a ≤ 10.5 and h'' ≤ 231, by 231/8 more. The largest sample, at
    the first row, is between that and what 210 alone allows.
    """
    row = np.arange(61)
    motion = np.zeros((5, 61, 1))
    motion[2, 40:, 0] = 10 - np.abs(row[40:] - 50)
    value = np.where(row == 50, 210 * 20**2 / 8, 0.0)
    value[0] = 210 * (1 + 20**2) / 8 + 0.25
    sup = np.zeros((6, 1))
    sup[3] = 1.0
    grid = SimpleNamespace(step=1.0, count=60, sup=sup, at=lambda rows: motion[:, rows])
    motion[0, :, 0] = value
    law = SimpleNamespace(
        labels=("",),
        sides=(SimpleNamespace(sign=1.0, c=0.0, k=1.0),),
        values=lambda motion: motion[0],
        room=lambda _: 1.0,
    )
    peaks = Peaks(law, is_proven=True)
    _see_braking(peaks, law, grid, 60, forwards=True)
    assert peaks.bounds()[0].bound == pytest.approx(210 * 20**2 / 8 + 231 / 8, rel=1e-12)


def test_a_measured_bend_counts_in_both_neighbours() -> None:
    """Oracle: a slope that changes by 1 in interval 5 bends the value in 4, 5 and 6 by SAFETY/8."""
    for peak, bent in ((3, False), (4, True), (7, True), (8, False)):  # the end that is highest
        g, slope = np.zeros((11, 1)), np.where(np.arange(11)[:, None] > 5, 1.0, 0.0)
        g[peak] = 2.0
        grid = SimpleNamespace(step=1.0, between=lambda first, last: np.zeros((5, 11, 1)))
        law = SimpleNamespace(labels=("",), along=lambda _, g=g, slope=slope: (g, slope))
        peaks = Peaks(law, is_proven=False)
        _see_measured([peaks], None, grid, 10)
        assert peaks.bounds()[0].bound == pytest.approx(2.0 + bent * SAFETY / 8, rel=1e-12)
