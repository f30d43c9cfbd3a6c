"""A design with all limits of the FR3, checked at 1 kHz by engines that share no code with ours.

The motion by closed forms, torques and places by Pinocchio, distances by coal: between capsules,
over a half-space, and between the convex hulls of the manufacturer's meshes.
"""

from importlib.metadata import PackageNotFoundError, files
from itertools import combinations
from pathlib import Path

import coal
import numpy as np
import pinocchio
import pytest

from runtime.errors import IdentificationError
from runtime.excitation.limits.safety import CARRIED, UNCHECKED, Safety
from runtime.excitation.proof.certificate import DISTANCES, certificate_of, pulled_inside
from runtime.excitation.search.design import Design, design
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.single_start import Search
from runtime.library import Library, ProxyFacts
from tests.oracle import pinocchio_model
from tests.runtime.excitation.test_excitation import closed_form

BOX = (-0.4, 0.4, -0.6, 0.5, 0.2, 0.9)
TABLE = 0.17
SHARE, VISCOUS, COULOMB = 0.5, 1.5, 0.5
SAFETY = Safety(torque_fraction=SHARE, table=TABLE, box=BOX, viscous=(VISCOUS,), coulomb=(COULOMB,))
"""Tight enough for each of them to stop this motion."""
TABLE_MARGIN, PAIR_MARGIN = 0.03, 0.02
DURATION, HARMONICS = 6.0, 4
RATE = 1000
FOLDED = np.array([0.0, 0.5, 0.0, -3.0, 0.0, 0.6, 0.0])
Placed = dict[str, tuple[int, coal.CollisionGeometry, pinocchio.SE3]]
"""Shape and placement on the joint with this number, 0 for the base."""


@pytest.fixture(scope="module")
def result(lib: Library) -> Design:
    return design(lib, duration=DURATION, harmonics=HARMONICS, starts=1, safety=SAFETY)


@pytest.fixture(scope="module")
def motion(result: Design) -> np.ndarray:
    """q, dq, ddq, dddq at 1 kHz, (4, N, 7)."""
    t = np.arange(int(result.trajectory.duration * RATE) + 1) / RATE
    phi = closed_form(HARMONICS, t, result.trajectory.duration)
    motion = np.stack([phi[..., k] @ result.trajectory.coefficients.T for k in range(4)])
    motion[0] += result.trajectory.home
    return motion


@pytest.fixture(scope="module")
def poses(lib: Library, motion: np.ndarray) -> list[list[pinocchio.SE3]]:
    """Of the base and of every joint, at every millisecond."""
    model = pinocchio_model(lib.urdf())
    data, result = model.createData(), []
    for q in motion[0]:
        pinocchio.forwardKinematics(model, data, q)
        result.append([pose.copy() for pose in data.oMi])
    return result


def capsule(proxy: ProxyFacts) -> tuple[int, coal.CollisionGeometry, pinocchio.SE3]:
    """Coal's lie along z around the origin."""
    start, end = np.array(proxy.start), np.array(proxy.end)
    turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start)
    shape = coal.Capsule(proxy.radius, float(np.linalg.norm(end - start)))
    return proxy.joint + 1, shape, pinocchio.SE3(turn.matrix(), (start + end) / 2)


@pytest.fixture(scope="module")
def capsules(lib: Library) -> Placed:
    return {proxy.name: capsule(proxy) for proxy in lib.proxies}


@pytest.fixture(scope="module")
def hulls() -> Placed:
    """Of the Panda's collision meshes, whose shell the FR3 has: they hold the meshes."""
    try:
        here = files("example-robot-data") or []
    except PackageNotFoundError:
        pytest.skip("the meshes come with the package example-robot-data: pip install .[meshes]")
    (urdf,) = [f for f in here if str(f).endswith("panda_description/urdf/panda.urdf")]
    path = Path(str(urdf.locate())).resolve()
    model, kind = pinocchio.buildModelFromUrdf(str(path)), pinocchio.GeometryType.COLLISION
    folders = [str(path.parents[4])]
    result = {}
    for part in pinocchio.buildGeomFromUrdf(
        model, str(path), kind, package_dirs=folders
    ).geometryObjects:
        name = part.name.removeprefix("panda_").removesuffix("_0").replace("link0", "base")
        if name in {"base", *(f"link{k}" for k in range(1, 8))}:
            part.geometry.buildConvexHull(True, "Qt")
            result[name] = part.parentJoint, part.geometry.convex, part.placement
    assert len(result) == 8
    return result


def least(
    poses: list[list[pinocchio.SE3]], placed: Placed, pairs: list[tuple[str, str]]
) -> dict[tuple[str, str], float]:
    """Smallest distance of every pair over the motion, m, negative inside; "table" is one, too."""
    request, answer = coal.DistanceRequest(), coal.DistanceResult()
    plane = coal.Halfspace(np.array([0.0, 0.0, 1.0]), TABLE)
    result = dict.fromkeys(pairs, np.inf)
    for pose in poses:
        where = {"table": (plane, coal.Transform3s.Identity())}
        for name, (joint, shape, placement) in placed.items():
            there = pose[joint] * placement
            where[name] = shape, coal.Transform3s(there.rotation, there.translation)
        for pair in pairs:
            answer.clear()
            one, other = (where[name] for name in pair)
            result[pair] = min(result[pair], coal.distance(*one, *other, request, answer))
    return result


def test_joint_limits_hold_at_1_khz(lib: Library, result: Design, motion: np.ndarray) -> None:
    """Oracle: closed forms of the motion, the manufacturer's speeds; nothing was left unused."""
    q, dq, ddq, dddq = motion
    limits = lib.limits()
    slack = 1 + 1e-11  # rounding of coefficients of 70 that cancel down to 1
    assert ((q >= limits["lower"]) & (q <= limits["upper"])).all()
    for values, kind in ((dq, "velocity"), (ddq, "acceleration"), (dddq, "jerk")):
        assert (np.abs(values) <= limits[kind] * slack).all()
    facts = lib.braking
    assert facts is not None
    assert (dq <= -facts.c + np.sqrt(facts.k * (facts.upper - q))).all()
    assert (dq >= facts.c - np.sqrt(facts.k * (q - facts.lower))).all()
    # Limits that are not linear were tightened by 2e-3 of themselves and are used up to there.
    for kind in ("braking", "torque", "tip box", "self-collision", "table"):
        assert result.use[kind] > 0.99, kind
    assert result.unchecked == ()


def test_torques_and_tip_hold_by_pinocchio(lib: Library, motion: np.ndarray) -> None:
    """Oracle: RNEA with friction and its differences over 1 ms, place and velocity of the tip."""
    model = pinocchio_model(lib.urdf())
    data, tip = model.createData(), model.getFrameId(lib.manifest.tip, pinocchio.BODY)
    limits, there = lib.limits(), pinocchio.LOCAL_WORLD_ALIGNED
    tau, place, speed = [], [], []
    for q, dq, ddq in zip(*motion[:3], strict=True):
        tau.append(pinocchio.rnea(model, data, q, dq, ddq) + VISCOUS * dq)
        pinocchio.forwardKinematics(model, data, q, dq)
        pinocchio.updateFramePlacements(model, data)
        place.append(data.oMf[tip].translation.copy())
        speed.append(np.linalg.norm(pinocchio.getFrameVelocity(model, data, tip, there).linear))
    assert (np.abs(tau).max(axis=0) + COULOMB <= SHARE * limits["effort"]).all()
    assert (np.abs(np.diff(tau, axis=0)).max(axis=0) * RATE <= limits["torque_rate"]).all()
    assert (np.min(place, axis=0) >= BOX[::2]).all()
    assert (np.max(place, axis=0) <= BOX[1::2]).all()
    assert np.max(speed) <= limits["tip_speed"]


def test_capsules_keep_apart_by_coal(
    lib: Library, poses: list[list[pinocchio.SE3]], capsules: Placed
) -> None:
    """Oracle: coal's capsules and half-space at every millisecond; only named pairs come closer."""
    margins = {(pair.first, pair.second): pair.margin for pair in lib.pairs}
    lifted = [(name, "table") for name in lib.moving_proxies if name != "link1"]
    margins |= dict.fromkeys(lifted, TABLE_MARGIN)
    distances = least(poses, capsules, list(margins))
    short = {pair: distances[pair] - margin for pair, margin in margins.items()}
    assert min(short.values()) >= 0, short
    closer = {pair for pair, margin in margins.items() if margin < PAIR_MARGIN}
    assert closer == {("link5", "link7")}
    # Used up: the design ends 2e-3 of 0.1 m before its margins.
    assert min(short.values()) < 1e-3


def test_meshes_keep_apart_by_coal(
    lib: Library, poses: list[list[pinocchio.SE3]], hulls: Placed
) -> None:
    """Oracle: hulls of the meshes, all links that are no neighbours; 5 and 7 keep 1 cm."""
    names = ["base", *(f"link{k}" for k in range(1, 8))]
    pairs = [(a, b) for (i, a), (k, b) in combinations(enumerate(names), 2) if k > i + 1]
    pairs += [(name, "table") for name in names[2:]]
    distances = least(poses, hulls, pairs)
    assert distances.pop(("link5", "link7")) >= 0.01  # see robots/fr3.toml
    for pair, distance in distances.items():
        assert distance >= (TABLE_MARGIN if "table" in pair else PAIR_MARGIN), pair
    # The judge is no yes-man: folded like this, inside all ranges, the wrist hits the shoulder.
    model = pinocchio_model(lib.urdf())
    data = model.createData()
    pinocchio.forwardKinematics(model, data, FOLDED)
    struck = least([list(data.oMi)], hulls, pairs)
    touching = {pair for pair, distance in struck.items() if distance <= 0 and "table" not in pair}
    assert touching == {("base", "link6"), ("link1", "link6"), ("link1", "link7")}
    assert (lib.clearance(FOLDED)[0] < 0).any()


def test_its_certificate_holds(lib: Library, result: Design) -> None:
    """Property: between samples too, at full and at half speed."""
    motion = pulled_inside(lib, result.trajectory)
    proof = certificate_of(lib, motion, SAFETY)
    assert proof.holds
    for use in proof.uses:
        if use.kind in result.use:
            # The chord's error of a millisecond; 1e-3 of 0.1 m.
            assert use.bound == pytest.approx(result.use[use.kind], abs=1e-3), use.kind


def test_the_document_forgets_the_table(lib: Library) -> None:
    """Property: without the limits the same start breaks some, and nobody claims otherwise."""
    free = design(lib, duration=DURATION, harmonics=HARMONICS, starts=1)
    assert free.unchecked == UNCHECKED[: UNCHECKED.index(CARRIED)]
    assert not certificate_of(lib, free.trajectory, SAFETY).holds


def test_no_room_is_explained(lib: Library) -> None:
    """Property: a box around the tip of 20 nm leaves nothing; the sentence names what stops it."""
    p = lib.tip_motion(lib.home, np.zeros(7))[0].ravel()
    ends = np.stack([p - 1e-8, p + 1e-8], axis=1).ravel()
    search = Search(lib, DesignSettings(4.0, 2, safety=Safety(box=tuple(ends))))
    with pytest.raises(IdentificationError, match=r"no room for a motion.*tip box \(. m..\) and"):
        search._shrunk(search._random(0), 0.0)


def test_a_margin_leaves_a_share_of_every_limit(lib: Library) -> None:
    """Property: bounds over all t of the certificate, which is against the whole limits."""
    shape = {"duration": 3.0, "harmonics": 2, "starts": 1, "safety": Safety(table=0.0)}
    use = []
    for margin in (1.0, 0.9):
        result = design(lib, margin=margin, **shape)
        trajectory = pulled_inside(lib, result.trajectory, share=margin)
        proof = certificate_of(lib, trajectory, shape["safety"])
        assert proof.holds
        use.append(max(u.bound for u in proof.uses if u.kind not in DISTANCES))
        sampled = max(u for kind, u in result.use.items() if kind not in DISTANCES)
        assert sampled == pytest.approx(use[-1], abs=1e-3)  # chords between samples
    # Some limit is reached in both; 1e-8 is the rounding that `pulled_inside` leaves.
    assert 0.999 < use[0] <= 1.0
    assert 0.899 < use[1] <= 0.9 + 1e-8
    for margin in (0.0, 1.1, np.nan):
        with pytest.raises(IdentificationError, match="a margin above 0 and up to 1 is needed"):
            design(lib, margin=margin)
