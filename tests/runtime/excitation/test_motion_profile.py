"""motion_figures: what pictures show is the motion with its limits and distances."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from runtime import load
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.proof.certificate import KINDS, certificate_of, certified, joint_bounds
from runtime.library import Library
from runtime.outputs.report.motion_figures import profile_of
from tests.oracle import pinocchio_model

BOX = (-1.0, 1.0, -1.0, 1.0, 0.0, np.inf)
SAFETY = Safety(torque_fraction=0.9, table=-0.3, box=BOX, viscous=(0.4,), coulomb=(0.2,))


def test_shares_are_those_of_the_certificate(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Oracle: the largest share is the proven bound, to the step of the samples."""
    result = profile_of(certified(lib, trajectories[0], SAFETY), samples=10_001)
    bounds, _ = joint_bounds(lib, trajectories[0])
    assert tuple(result.shares) == (*KINDS, "torque")
    for kind, bound in zip(KINDS, bounds, strict=True):
        assert result.shares[kind].max(axis=0) == pytest.approx(bound, rel=1e-5)
    torque = next(use for use in result.certificate.uses if use.kind == "torque")
    # The curvature of a torque between samples 1 ms apart.
    assert result.shares["torque"].max() == pytest.approx(torque.bound, rel=1e-4)


def test_torque_and_tip_are_pinocchios(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Oracle: RNEA plus viscous friction, the frame's place; Coulomb friction lowers the limit."""
    result = profile_of(certified(lib, trajectories[0], SAFETY), samples=41)
    model = pinocchio_model(lib.urdf())
    data, frame = model.createData(), model.getFrameId(lib.manifest.tip, pinocchio.BODY)
    q, dq, ddq = (result.motion[kind] for kind in KINDS[:3])
    for k, state in enumerate(zip(q, dq, ddq, strict=True)):
        tau = pinocchio.rnea(model, data, *state) + 0.4 * state[1]
        assert result.motion["torque"][k] == pytest.approx(tau, abs=1e-10)  # rounding of 50 N·m
        pinocchio.framesForwardKinematics(model, data, state[0])
        assert result.tip[k] == pytest.approx(data.oMf[frame].translation, abs=1e-12)
    assert result.bands["torque"].upper == pytest.approx(0.9 * lib.limits()["effort"] - 0.2)
    assert result.bands["torque"].lower == pytest.approx(-result.bands["torque"].upper)
    assert result.has_friction


def test_gaps_are_those_of_the_certificate(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Oracle: least distances as proven, per pair and per proxy above the table, in its order."""
    result = profile_of(certified(lib, trajectories[0], SAFETY), samples=10_001)
    proven = certificate_of(lib, trajectories[0], SAFETY).distances
    assert [(gap.kind, gap.label) for gap in result.gaps] == [(u.kind, u.where) for u in proven]
    assert {gap.kind for gap in result.gaps} == {"self-collision", "table"}
    for gap, use in zip(result.gaps, proven, strict=True):
        assert gap.margin == use.limit
        assert gap.least == pytest.approx(use.value, abs=1e-5)  # the chord of a millisecond
        assert gap.left == pytest.approx(gap.least - gap.margin)


def test_envelopes_end_where_braking_does(lib: Library) -> None:
    """Oracle: max(0, ±dq + c)² = k (q̂ ∓ q) on the edge, nowhere faster than the constant limit."""
    result = profile_of(certified(lib, Trajectory(lib.home, np.zeros((7, 2)), 3.0)))
    facts, limits = lib.braking, lib.limits()
    assert facts is not None
    for j, edge in enumerate(result.envelopes):
        assert edge.q[0] >= limits["lower"][j]
        assert edge.q[-1] <= limits["upper"][j]
        assert edge.upper.max() == limits["velocity"][j] == -edge.lower.min()
        free = edge.upper < limits["velocity"][j]
        assert 0 < free.sum() < len(free)
        way = (edge.upper[free] + facts.c[j]) ** 2 / facts.k[j]
        assert way == pytest.approx(facts.upper[j] - edge.q[free], abs=1e-12)
        free = edge.lower > -limits["velocity"][j]
        way = (facts.c[j] - edge.lower[free]) ** 2 / facts.k[j]
        assert way == pytest.approx(edge.q[free] - facts.lower[j], abs=1e-12)


def test_little_is_known_of_little(lib: Library, tiny_built: Path) -> None:
    """Property: no proxies, no braking, few limits; document mode shows what it does not check."""
    tiny = load(tiny_built)
    result = profile_of(certified(tiny, Trajectory(tiny.home, np.full((1, 2), 1e-3), 3.0)))
    assert tuple(result.shares) == ("position", "velocity", "torque")
    assert (result.gaps, result.table, result.box, result.has_friction) == ((), None, None, False)
    assert result.envelopes[0].upper.tolist() == [3.0, 3.0]
    assert result.bands["torque"].upper.tolist() == [10.0]
    result = profile_of(certified(lib, Trajectory(lib.home, np.zeros((7, 2)), 3.0)))
    assert {gap.kind for gap in result.gaps} == {"self-collision"}
    assert "self-collision" in result.certificate.unchecked
    assert result.bands["torque"].upper == pytest.approx(lib.limits()["effort"])


def test_another_robots_motion_is_reported(lib: Library, tiny_built: Path) -> None:
    """Property: one sentence with both shapes; a table needs proxies."""
    motion = Trajectory(lib.home, np.zeros((7, 2)), 3.0)
    tiny = load(tiny_built)
    with pytest.raises(IdentificationError, match=r"needs a home of shape \(1,\)"):
        profile_of(certified(tiny, motion))
    motion = replace(motion, home=tiny.home, coefficients=np.zeros((1, 2)))
    with pytest.raises(IdentificationError, match="one number or one per joint, 1, got 2"):
        profile_of(certified(tiny, motion, Safety(viscous=(0.1, 0.1))))
