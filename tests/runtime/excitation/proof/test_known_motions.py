"""Bounds, times and speeds of motions whose limits are known by hand."""

from pathlib import Path

import numpy as np
import pytest

from runtime import load
from runtime.errors import ExportError
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.nonlinear_limits import Braking, Side
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import COSINE
from runtime.excitation.proof import certificate
from runtime.excitation.proof.bounds import MotionGrid, constraint_bounds, joint_bounds
from runtime.excitation.proof.certificate import (
    Use,
    certificate_of,
    certified,
    fastest,
    pulled_inside,
)
from runtime.library import Library

SAFETY = Safety(table=0.0, box=(0.2, 0.8, -0.6, 0.6, 0.2, 1.0), viscous=(2.0,))


@pytest.mark.parametrize("proven", [True, False], ids=["proven", "measured"])
def test_rest_peaks_in_the_middle_of_the_first_interval(
    lib: Library, proven: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Closed form: all of 2000 intervals of 1 ms are alike, and the first is the largest."""
    monkeypatch.setattr(Library, "bounds_motions", proven)
    rest = Trajectory(lib.home, np.zeros((7, 2)), 2.0)
    result = constraint_bounds(lib, constraints(lib, lib.home, SAFETY), rest)
    assert {bound.constraint.kind for bound in result} >= {"braking", "torque", "table"}
    times = np.array([bound.time for bound in result])
    assert times == pytest.approx(np.full(len(result), 5e-4), rel=1e-12)
    # Of 2 x 6000 intervals over 2 s, for two functions.
    assert joint_bounds(lib, rest)[1] == pytest.approx(np.full((4, 7), 1 / 12000), rel=1e-12)


def test_braking_exceeds_its_samples_by_its_bend_at_most(lib: Library) -> None:
    """Closed form: h'' ≤ 2 (a² + (v + c) j)/k + a with the largest v, a, j of a fast small cosine.

    2 c ω/k = 12: its peak is where it is fastest, where the jerk is largest as well.
    """
    size, duration, c, k = 1e-4, 0.1, 0.1, 1.0
    every = np.ones(7)
    sides = [Side(s, k * every, c * every, lib.home + s * every) for s in (1.0, -1.0)]
    braking = Braking(tuple(sides), lib.home, lib.joint_names)
    motion = Trajectory(lib.home, size * np.ones((7, 1)), duration)
    v, a, j = (size * COSINE.bound(order, 1)[0] / duration**order for order in (1, 2, 3))
    bounds = np.array([bound.bound for bound in constraint_bounds(lib, [braking], motion)])
    dense = braking.values(np.stack(motion.at(lib, np.linspace(0, duration, 20_001)))).max(axis=0)
    # 2000 intervals, and the 20 000 between the samples; the room is 1 − c²/k.
    squares = (duration / 2000) ** 2 + (duration / 20_000) ** 2
    allowed = squares / 8 * (2 / k * (a**2 + (v + c) * j) + a) / (1 - c**2 / k)
    assert (bounds >= dense - 1e-13).all()  # rounding of two evaluations of the basis
    assert (bounds <= dense + allowed + 1e-13).all()


@pytest.mark.parametrize("kind", ["torque", "torque rate", "tip speed"])
def test_measured_bounds_exceed_samples_by_twice_their_bend(
    lib: Library, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: second differences at 20 kHz of g; a bound is at most δ²/8 of twice the largest."""
    monkeypatch.setattr(Library, "bounds_motions", False)
    motion = Trajectory(lib.home, 1e-3 * np.random.default_rng(11).normal(size=(7, 3)), 2.2)
    (constraint,) = [x for x in constraints(lib, lib.home, SAFETY) if x.kind == kind]
    t, step = np.linspace(0, 2.2, 44_001, retstep=True)
    g = constraint.values(np.stack(motion.at(lib, t)))
    bend = np.abs(np.diff(g, 2, axis=0)).max(axis=0) / step**2
    result = constraint_bounds(lib, [constraint], motion)
    bounds = np.array([bound.bound for bound in result])
    assert [bound.intervals for bound in result] == [1100 if constraint.even else 2200] * len(g[0])
    assert (bounds >= g.max(axis=0) - 1e-13).all()
    # 1 % for the bend between two samples; and what peaks between the 20 kHz.
    allowed = (2 * 1.01 * 1e-6 + step**2) / 8 * bend
    assert (bounds <= g.max(axis=0) + allowed + 1e-13).all()


def test_the_margin_is_the_rest_of_the_limit() -> None:
    """Closed form: a quarter is used, or an eighth too much."""
    rest = "joint", 0.0, 1.0, 1.0, "rad"
    assert Use("position", 0.25, *rest).margin == 0.75
    assert Use("position", 1.125, *rest).margin == -0.125


@pytest.mark.parametrize(("free", "other"), [("upper", "lower"), ("lower", "upper")])
def test_a_joint_limited_on_one_side_states_that_limit(
    tiny_built: Path, free: str, other: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Closed form: the pendulum swings towards its free side, and comes from the other one."""
    lib = load(tiny_built)
    limits = lib.limits()
    room = abs(float(limits[other][0] - lib.home[0]))
    limits[free] = np.array([np.inf if free == "upper" else -np.inf])
    monkeypatch.setattr(Library, "limits", lambda self: limits)
    a = np.array([[1e-3 if free == "upper" else -1e-3]])
    for sign in (1.0, -1.0):
        position = certificate_of(lib, Trajectory(lib.home, sign * a, 10.0)).uses[0]
        assert (position.kind, position.limit) == ("position", pytest.approx(room, rel=1e-12))
        assert position.value == pytest.approx(position.bound * room, rel=1e-12)


def pendulum(folder: Path, use: float) -> tuple[Library, Trajectory]:
    """A pendulum that uses this share of its velocity limit and little of its range."""
    lib = load(folder)
    slow = Trajectory(lib.home, np.array([[1e-3]]), 1.0)
    speed = float(joint_bounds(lib, slow)[0][1, 0])
    return lib, Trajectory(lib.home, slow.coefficients, speed / use)


def test_a_motion_that_holds_keeps_its_speed(
    tiny_built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: nothing to slow down, and no second certificate is computed."""
    motion = certified(*pendulum(tiny_built, 0.99))

    def computed(*_: object) -> None:
        raise AssertionError("a certificate was computed")

    monkeypatch.setattr(certificate, "_certificate", computed)
    assert motion.certificate.holds
    assert fastest(motion) == 1.0


@pytest.mark.parametrize(
    ("use", "advice"),
    [
        (1.5, "add --speed 66, at which"),
        (80.0, "add --speed 1, at which"),
        (120.0, "design another motion"),
    ],
)
def test_the_speed_that_keeps_a_velocity_limit(tiny_built: Path, use: float, advice: str) -> None:
    """Closed form: 1 / use of the velocity limit, in whole percents and at least one."""
    motion = certified(*pendulum(tiny_built, use))
    assert fastest(motion) == pytest.approx(int(100 / use) / 100, rel=1e-12)
    with pytest.raises(ExportError, match=advice):
        motion.require_limits()


def test_no_speed_helps_where_the_position_breaks_too(
    tiny_built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: of two broken limits one does not depend on the speed: no slower one is tried."""
    lib = load(tiny_built)
    motion = certified(lib, Trajectory(lib.home, np.array([[100.0]]), 1.0))
    assert {use.kind for use in motion.certificate.broken} == {"position", "velocity"}

    def computed(*_: object) -> None:
        raise AssertionError("a certificate was computed")

    monkeypatch.setattr(certificate, "_certificate", computed)
    assert fastest(motion) == 0.0


def test_what_is_pulled_inside_ends_on_its_limit(tiny_built: Path) -> None:
    """Closed form: one part in 10⁹ below the share that may be used; 0.2 % too much stays."""
    for share in (1.0, 0.9):
        lib, motion = pendulum(tiny_built, 1.0005 * share)
        bounds, _ = joint_bounds(lib, pulled_inside(lib, motion, share=share))
        assert bounds[1, 0] / share == pytest.approx(1 - 1e-9, rel=1e-12)
        lib, motion = pendulum(tiny_built, 1.002 * share)
        assert pulled_inside(lib, motion, share=share).coefficients == motion.coefficients


@pytest.mark.parametrize(
    ("duration", "count"), [(0.5, 2000), (2.0, 2000), (5.0, 5000), (5.0005, 5002), (5.0015, 5002)]
)
def test_intervals_last_a_millisecond_at_most(lib: Library, duration: float, count: int) -> None:
    """Known cases: an even number of intervals, of 1 ms or less, and 2000 of a short motion."""
    grid = MotionGrid(Trajectory(lib.home, np.zeros((7, 1)), duration))
    assert grid.count == count
    assert grid.step == pytest.approx(duration / count, rel=1e-15)
    assert grid.step <= 1e-3
