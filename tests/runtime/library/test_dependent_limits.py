"""Limits of joints that follow several others, and of those that a closed loop moves."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from runtime.campaign.driver import Reference, Sample
from runtime.campaign.guards import LimitsGuard
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import constraints, require_rest
from runtime.excitation.limits.safety import Safety
from runtime.excitation.proof.certificate import Use, certificate_of
from runtime.excitation.search.criteria import unseen_motions
from runtime.excitation.search.design import design
from runtime.excitation.way import way_to
from runtime.library import Library, load
from symgen.make.config import RobotConfig, home_of
from tests.coupled_chains import WRIST, coupled

KINDS = ("position of dependent joints", "velocity of dependent joints")


@pytest.fixture(scope="module")
def limited(palletizer_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The palletizing robot with limits of the joints that its loop moves."""
    folder = tmp_path_factory.mktemp("limited") / palletizer_folder.name
    shutil.copytree(palletizer_folder, folder)
    facts = json.loads((folder / "manifest.json").read_text())
    for joint in facts["all_joints"]:
        if joint["name"] == "forearm":
            joint |= {"lower": -0.5, "upper": 0.6, "velocity": 0.7}
        if joint["name"] == "rod":
            joint |= {"velocity": 0.9}
    text = json.dumps(facts)
    (folder / "manifest.json").write_text(text)
    for record in folder.rglob("build.json"):
        build = json.loads(record.read_text())
        build["sources"]["manifest.json"] = hashlib.sha256(text.encode()).hexdigest()
        record.write_text(json.dumps(build))
    return load(folder)


def waves(lib: Library, size: float) -> Trajectory:
    """A motion that moves neighbouring joints against each other."""
    a = np.zeros((lib.n_joints, 3))
    a[:, 1] = size * (-1.0) ** np.arange(lib.n_joints)
    return Trajectory(lib.home, a, 4.0)


def uses_of(lib: Library, trajectory: Trajectory, safety: Safety | None = None) -> dict[str, Use]:
    return {use.kind: use for use in certificate_of(lib, trajectory, safety).uses}


@pytest.mark.parametrize("robot", ["wrist", "limited"])
def test_motions_of_predictions_keep_the_limits(robot: str, request: pytest.FixtureRequest) -> None:
    """Property: motions on which torques are predicted keep limits of dependent joints, to what a
    grid of 0.05 s misses of 0.5 Hz, 0.08 % of the amplitude, which a few harmonics share; several
    reach them.
    """
    lib: Library = request.getfixturevalue(robot)
    t = np.linspace(0, 10, 1001)
    worst = [
        max(float(g.values(np.stack(motion.at(lib, t))).max()) for g in dependents)
        for dependents in [constraints(lib, lib.home, None)]
        for motion in unseen_motions(lib, lib.home)
    ]
    assert max(worst) < 0.003
    assert np.sum(np.array(worst) > -0.05) > 5  # steps of 3 %


@pytest.mark.parametrize("robot", ["wrist", "limited"])
def test_certificates_bound_dependent_joints(robot: str, request: pytest.FixtureRequest) -> None:
    """Oracle: the largest position and speed among 20,001 samples of A q + b or g(q); between them
    a motion of 0.5 Hz rises by 1e-7. The bounds are proven for couplings and measured for loops.
    """
    lib: Library = request.getfixturevalue(robot)
    trajectory = waves(lib, 0.1)
    uses = uses_of(lib, trajectory)
    q, dq, ddq, _ = trajectory.at(lib, np.linspace(0, 4, 20001))
    x, dx, _ = lib.all_motion(q, dq, ddq)
    start = lib.all_positions(lib.home)
    expected = np.zeros(2)
    for k, joint in enumerate(lib.manifest.all_joints):
        if joint.name in {"right_lift", "forearm", "rod"}:
            if joint.upper is not None and joint.lower is not None:
                way = x[:, k] - start[k]
                up, down = joint.upper - start[k], joint.lower - start[k]
                expected[0] = max(expected[0], (way / up).max(), (way / down).max())
            assert joint.velocity is not None
            expected[1] = max(expected[1], np.abs(dx[:, k]).max() / joint.velocity)
    for kind, dense in zip(KINDS, expected, strict=True):
        assert dense - 1e-12 <= uses[kind].bound <= dense + 1e-4
        assert uses[kind].is_proven == (robot == "wrist")
    assert not certificate_of(lib, waves(lib, 0.4)).holds


@pytest.mark.parametrize("robot", ["wrist", "limited"])
def test_slopes_are_derivatives(robot: str, request: pytest.FixtureRequest) -> None:
    """Derivative: slopes of linear rows are exact to rounding, those of a loop to h²."""
    lib: Library = request.getfixturevalue(robot)
    rng = np.random.default_rng(0)
    at, step = rng.normal(0, 0.2, (2, 4, 1, lib.n_joints))
    for constraint in constraints(lib, lib.home, None):
        slopes = constraint.slopes(at)[0]
        along = np.einsum("rok,ok->r", slopes, step[: constraint.orders, 0])
        if robot == "wrist":
            change = constraint.values(at + step)[0] - constraint.values(at)[0]
            np.testing.assert_allclose(change, along, atol=1e-14)
        else:
            rows = np.abs(along) > 0
            values = lambda x, c=constraint, rows=rows: c.values(x)[0][rows]  # noqa: E731
            small = 1e-6 * step
            change = (values(at + small) - values(at - small)) / 2e-6
            # Differences of values of size one by 2e-6 carry 1e-10.
            np.testing.assert_allclose(change, along[rows], atol=2e-9)


def test_designs_keep_limits_of_dependent_joints(wrist: Library) -> None:
    """Property: a search whose best motions would exceed the limit of a joint with two masters
    ends inside it; the margin counts there as well.
    """
    best = design(wrist, harmonics=3, duration=4.0, starts=2, seed=0, margin=0.9)
    uses = uses_of(wrist, best.trajectory)
    assert uses[KINDS[1]].bound <= 0.9 + 1e-3
    assert uses[KINDS[0]].bound <= 0.9 + 1e-3
    assert max(uses[kind].bound for kind in KINDS) > 0.85


def test_a_home_beyond_the_limit_is_refused(wrist: Library) -> None:
    """Property: right_lift = trunk − 2.5 lift + 0.3 may reach 1 rad, and 1.3 is named."""
    home = np.array([1.0, 0.0])
    with pytest.raises(IdentificationError, match=r"right_lift .*1\.3 rad where 1 rad"):
        require_rest(constraints(wrist, home, None), home)


def test_ways_keep_limits_of_dependent_joints(wrist: Library) -> None:
    """Property: a way of lift alone is as slow as right_lift, which is 2.5 times as fast, needs; an
    end with right_lift at 1.05 rad is refused.
    """
    safety = Safety(torque_fraction=1.0)
    way = way_to(wrist, np.zeros(2), np.array([0.0, 0.8]), safety).trajectory
    assert way is not None
    uses = uses_of(wrist, way, safety)
    assert max(uses[kind].bound for kind in KINDS) <= 1
    assert 3 * uses[KINDS[1]].bound == pytest.approx(2.5 * 3 * uses["velocity"].bound, rel=1e-3)
    with pytest.raises(IdentificationError, match=r"right_lift is 1\.05 rad where 1 rad"):
        way_to(wrist, np.zeros(2), np.array([0.0, -0.3]), safety)


@pytest.mark.parametrize("robot", ["wrist", "limited"])
def test_the_guard_of_limits_counts_dependent_joints(
    robot: str, request: pytest.FixtureRequest
) -> None:
    """Property: samples are refused where a dependent joint is too far or too fast alone."""
    lib: Library = request.getfixturevalue(robot)
    n = lib.n_joints
    guard, still = LimitsGuard(lib), np.zeros(n)
    there = Reference(np.zeros(n), still, still)
    far, fast = np.zeros(n), np.zeros(n)
    far[-1], fast[-1] = -0.55, 1.5
    assert guard.refusal(Sample(0.0, 0.0, np.zeros(n), still, still), there) is None
    for q, dq, what in ((far, still, "in ["), (still, fast, "velocity of")):
        refusal = guard.refusal(Sample(0.0, 0.0, q, dq, still), there)
        assert refusal is not None
        assert what in refusal
        assert ("right_lift" if robot == "wrist" else "forearm") in refusal


def test_homes_have_room_for_coupled_joints() -> None:
    """Oracle: right_lift = trunk − 2.5 lift − 1.9 in [−2, 1] leaves 0.1 rad at zero; the middle of
    all ranges is found by hand: trunk and lift at equal shares of theirs.
    """
    table = {
        "coupling": [
            {"joint": "right_lift", "of": {"trunk_turn": 1.0, "left_lift": -2.5}, "offset": -1.9}
        ]
    }
    home = np.array(home_of(coupled(table), RobotConfig()))
    matrix = np.array([1.0, -2.5])
    assert -2 + 0.15 < home[:2] @ matrix - 1.9 < 1 - 0.15
    assert home_of(coupled(WRIST), RobotConfig()) == (0.0, 0.0)
    given = RobotConfig(home=(0.1, 0.2))
    assert home_of(coupled(table), given) == (0.1, 0.2)
