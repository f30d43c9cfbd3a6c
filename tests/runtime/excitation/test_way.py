"""The way to a motion and back: free of collisions by coal, under the limits, whole in files."""

import json
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pinocchio
import pytest

from runtime import read_recording
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.safety import Obstacle, Safety, read_obstacles
from runtime.excitation.motion.trajectory import JoinedMotion, end_of, joined, read_session
from runtime.excitation.proof.certificate import certificate_of, certified
from runtime.excitation.search.design import Design, write_trajectory
from runtime.excitation.way import way_back, way_to
from runtime.library import Library, load
from tests.oracle import pinocchio_model
from tests.runtime.conftest import Command
from tests.taylor import assert_second_order, taylor_slope

POST = Obstacle("post", (0.0, -0.35, 0.55), (0.06, 0.06, 1.1), (0.0, 0.1, 0.3), 0.01)
"""Stands where the tip passes from one side of home to the other."""
MARGIN = 0.03


@pytest.fixture(scope="module")
def ends(lib: Library) -> tuple[np.ndarray, np.ndarray]:
    aside = np.array([0.9, 0, 0, 0, 0, 0, 0.3])
    return lib.home + aside, lib.home - aside


@pytest.fixture(scope="module")
def model(lib: Library) -> pinocchio.Model:
    return pinocchio_model(lib.urdf())


def distances_by_coal(
    lib: Library, model: pinocchio.Model, obstacle: Obstacle, q: np.ndarray
) -> np.ndarray:
    """Distance of every moving capsule from the obstacle."""
    data = model.createData()
    pinocchio.forwardKinematics(model, data, q)
    turn = pinocchio.rpy.rpyToMatrix(*obstacle.rpy)
    box = coal.Box(*obstacle.size)
    result = []
    for proxy in (one for one in lib.proxies if one.joint >= 0):
        start, end = np.array(proxy.start), np.array(proxy.end)
        along = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start)
        there = data.oMi[proxy.joint + 1] * pinocchio.SE3(along.matrix(), (start + end) / 2)
        result.append(
            coal.distance(
                *(box, coal.Transform3s(turn, np.array(obstacle.center))),
                coal.Capsule(proxy.radius, float(np.linalg.norm(end - start))),
                coal.Transform3s(there.rotation, there.translation),
                *(coal.DistanceRequest(), coal.DistanceResult()),
            )
            - obstacle.radius
        )
    return np.array(result)


def test_distances_from_obstacles(lib: Library, model: pinocchio.Model) -> None:
    """Oracle: coal, at random poses."""
    limit = next(
        one
        for one in constraints(lib, lib.home, Safety(obstacles=(POST,)))
        if one.kind == "obstacle"
    )
    apart = 0
    for q in lib.home + 0.5 * np.random.default_rng(0).normal(size=(20, 7)):
        motion = np.zeros((4, 1, 7))
        motion[0] = q
        result = MARGIN - 0.1 * limit.values(motion)[0]
        for here, wanted in zip(result, distances_by_coal(lib, model, POST, q), strict=True):
            if wanted > -POST.radius:
                # GJK of coal ends at 1e-6 m.
                assert here == pytest.approx(wanted, abs=2e-6)
                apart += 1
    assert apart > 100


def test_slopes_from_obstacles(lib: Library) -> None:
    """Derivative: every row in q."""
    (limit,) = (
        one
        for one in constraints(lib, lib.home, Safety(obstacles=(POST,)))
        if one.kind == "obstacle"
    )
    rng = np.random.default_rng(5)
    start, direction = lib.home + 0.3 * rng.normal(size=7), 0.05 * rng.normal(size=7)
    motion = np.zeros((4, 1, 7))
    motion[0] = start
    slopes = limit.slopes(motion)[0, :, 0]

    def values(q: np.ndarray, row: int) -> float:
        motion[0] = q
        return float(limit.values(motion)[0, row])

    for row in range(len(limit.labels)):
        if np.abs(slopes[row]).max() > 1e-9:
            measured = taylor_slope(
                lambda q, row=row: values(q, row), start, direction, float(slopes[row] @ direction)
            )
            # Large steps change the edge of the box that is closest.
            assert_second_order(measured, decades=2.0)


def test_a_straight_way(lib: Library, ends: tuple[np.ndarray, np.ndarray]) -> None:
    """Property: the quintic between both ends, at rest there; its limits are nearly used."""
    way = way_to(lib, *ends, Safety(table=0.0), share=0.9)
    assert way.corners == 0
    assert way.trajectory is not None
    s = np.linspace(0.0, 1.0, 11)
    q = way.trajectory.at(lib, s * way.trajectory.duration)[0]
    blend = (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None]
    assert q == pytest.approx(ends[0] + blend * (ends[1] - ends[0]), abs=1e-12)  # rounding
    certificate = certificate_of(lib, way.trajectory, Safety(table=0.0))
    assert certificate.holds
    timed = [u.bound for u in certificate.uses if u.kind in {"velocity", "acceleration", "jerk"}]
    # The duration is that of the largest share, seen at 400 samples, or one step of 2 % longer.
    assert 0.9 / 1.02**2 < max(timed) <= 0.9


def test_a_way_around_a_post(
    lib: Library,
    model: pinocchio.Model,
    ends: tuple[np.ndarray, np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Oracle: the straight way meets the post, the planned one keeps the margin, both by coal."""
    monkeypatch.setattr("runtime.excitation.way.PATHS", 1)  # the first is good enough
    straight = way_to(lib, *ends, Safety(table=0.0)).trajectory
    safety = Safety(table=0.0, obstacles=(POST,))
    way = way_to(lib, *ends, safety)
    assert straight is not None
    assert way.trajectory is not None
    assert way.corners > 0
    least = []
    for motion in (straight, way.trajectory):
        q = motion.at(lib, np.linspace(0.0, motion.duration, 60))[0]
        least.append(min(distances_by_coal(lib, model, POST, one).min() for one in q))
    assert least[0] < 0
    assert least[1] > MARGIN - 2e-6  # GJK of coal ends at 1e-6 m
    back = way_back(lib, way.trajectory, safety)
    session = joined(way.trajectory, replace(back, home=end_of(way.trajectory)), None)
    certificate = certified(lib, session, safety).certificate
    assert certificate.holds
    assert "obstacle" in {use.kind for use in certificate.uses}
    assert end_of(back) == pytest.approx(ends[0], abs=1e-12)  # rounding
    t = np.linspace(0.0, 1.0, 7)
    there = way.trajectory.at(lib, t * way.trajectory.duration)[0]
    again = back.at(lib, (1 - t) * back.duration)[0]
    # The splines of both directions are summed in another order.
    assert again == pytest.approx(there, abs=1e-12)


@pytest.mark.parametrize(
    ("joint", "value", "match"),
    [
        (3, -0.01, "expected a start of the way within the limits, fr3_joint4 is at -0.01"),
        (0, -1.55, "obstacle of .* and post is .* where 0.03 m is allowed; move the robot by hand"),
    ],
)
def test_a_start_without_a_way(lib: Library, joint: int, value: float, match: str) -> None:
    """Property: one sentence with the limit that the present pose exceeds."""
    start = lib.home.copy()
    start[joint] = value
    away = lib.home + np.array([0.9, 0, 0, 0, 0, 0, 0])
    near = replace(POST, center=(0.0, -0.35, 0.55))
    with pytest.raises(IdentificationError, match=match):
        way_to(lib, start, away, Safety(obstacles=(near,)))


def test_no_way_at_all(tiny_built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: a hinge whose range is cut in two by a limit of its torque has no way."""
    monkeypatch.setattr("runtime.excitation.way.MOST_POSES", 50)
    lib = load(tiny_built)
    # Gravity needs up to 3.3 N·m inside the range, 25 % of 10 N·m are allowed.
    poses = np.linspace(-0.9, 1.9, 57)[:, None]
    zero = np.zeros((1, 1))
    tau = np.array([abs(lib.inverse_dynamics(q[None], zero, zero, lib.pi0)[0, 0]) for q in poses])
    allowed = np.flatnonzero(tau < 2.4)
    ends = poses[allowed[0]], poses[allowed[-1]]
    if not (np.diff(allowed) > 1).any():
        pytest.fail("the torque limit does not cut the range")
    with pytest.raises(IdentificationError, match="no collision-free way was found"):
        way_to(lib, *ends, Safety(torque_fraction=0.25))


def test_motions_that_do_not_meet(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Property: joined motions begin where the last one ends."""
    apart = replace(trajectories[0], home=lib.home + 0.01)
    with pytest.raises(IdentificationError, match=r"it begins 0.01 rad or m away"):
        JoinedMotion((trajectories[0], apart), ("approach", "motion"))


def test_a_session_in_one_file(
    lib: Library, trajectories: tuple[Trajectory, ...], command: Command, tmp_path: Path
) -> None:
    """Property: every file holds way, motion and way back; their certificate is one."""
    motion = replace(trajectories[0], coefficients=0.3 * trajectories[0].coefficients)
    write_trajectory(Design(motion, 4.9, (4.9,), {}, ()), lib, tmp_path / "m.json")
    start = lib.home + 0.1
    (tmp_path / "last.csv").write_text(
        "t,q1,q2,q3,q4,q5,q6,q7\n" + "".join(f"{t},{','.join(map(str, start))}\n" for t in (0, 1))
    )
    words = ("approach", "m.json", "--return", "--table", "none", "--out", "s.json")
    formats = ("--export", "npz", "--export", "libfranka", "--settings", f"export_rate={100}")
    numbers = ",".join(map(str, start))
    ran = command(*words, "--from", numbers, *formats)
    assert (ran.code, ran.err.count("Traceback")) == (0, 0), ran.err
    session = read_session(tmp_path / "s.json", lib)
    assert session.names == ("approach", "motion", "return")
    facts = json.loads((tmp_path / "s.certificate.json").read_text())
    assert facts["holds"]
    assert facts["duration"] == pytest.approx(session.duration, rel=1e-15)
    log = read_recording(tmp_path / "s.npz")
    assert log.q == pytest.approx(session.at(lib, log.t)[0], abs=1e-12)  # rounding
    assert log.q[0] == pytest.approx(start, abs=1e-12)
    # The last row is within one period of the end, which is at rest.
    assert log.q[-1] == pytest.approx(start, abs=1e-5)
    table = np.loadtxt(tmp_path / "s.libfranka.csv", delimiter=",", skiprows=0, comments=("#", "t"))
    assert table[[0, -1], 1:8] == pytest.approx(np.array([start, start]), abs=1e-9)
    # A pose from a log, and options without a meaning.
    again = command(*words[:2], *words[3:-1], "l.json", "--from", "s.npz")
    assert (again.code, read_session(tmp_path / "l.json", lib).names) == (0, ("approach", "motion"))
    refused = command("excite", "--return")
    assert refused.code == 2
    assert "--return goes back to the pose of --from; give --from POSE too" in refused.err


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("a = 1", "unknown key 'a'; known are obstacle"),
        ("[[obstacle]]\nname = 'x'", "expects the key center in obstacle.0., got none; add it"),
        ("obstacle = []", "obstacle expects a list that is not empty, got"),
        (
            "[[obstacle]]\ncenter = [0, 0]\nradius = 0.1",
            "center expects a list of length 3, got .0, 0.;",
        ),
        ("[[obstacle]]\ncenter = [0, 0, 'a']\nradius = 0.1", "center.2. expects a number, got 'a'"),
        ("[[obstacle]]\ncenter = [0, 0, nan]\nradius = 0.1", "center.2. expects a finite number"),
        ("[[obstacle]]\ncenter = [0, 0, 101]\nradius = 0.1", "three finite numbers and a radius"),
        ("[[obstacle]]\ncenter = [0, 0, 1]", "edges and a radius from 0 m up"),
        ("[[obstacle]]\ncenter = [0, 0, 1]\nradius = -1", "edges and a radius from 0 m up"),
        ("[[obstacle", "cannot be read as TOML"),
        (None, "cannot be read"),
    ],
)
def test_files_that_are_no_obstacles(tmp_path: Path, text: str | None, match: str) -> None:
    """Property: one sentence."""
    path = tmp_path / "cell.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(IdentificationError, match=match):
        read_obstacles(path)
