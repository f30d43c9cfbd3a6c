"""A body in the hand: torques against Pinocchio, distances against coal, slopes by Taylor."""

import json
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pinocchio
import pytest

from runtime.cli.motion_limits import carried_body
from runtime.errors import IdentificationError, RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import constraints, require_rest
from runtime.excitation.limits.nonlinear_limits import Constraint, SampledMotion
from runtime.excitation.limits.safety import CarriedBox, Safety
from runtime.excitation.proof.certificate import certificate_of
from runtime.library import Library
from tests.oracle import pinocchio_model
from tests.runtime.conftest import Command
from tests.taylor import assert_second_order, taylor_slope

MASS, COM, EDGES = 1.8, (0.02, -0.01, 0.1), (0.1, 0.16, 0.2)
BODY = ",".join(map(str, (MASS, *COM, *EDGES)))
MARGIN = 0.02


def safety_of(lib: Library, body: str = BODY, table: float | None = 0.0) -> Safety:
    return Safety(table=table, carried=carried_body(lib, body))


def carried(lib: Library, kind: str) -> Constraint:
    """The constraint of this kind whose rows are the body's."""
    return next(
        one
        for one in constraints(lib, lib.home, safety_of(lib))
        if one.kind == kind and "carried body" in one.labels[0]
    )


def poses(lib: Library, q: np.ndarray) -> tuple[pinocchio.Model, pinocchio.Data]:
    model = pinocchio_model(lib.urdf())
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, q)
    return model, data


def test_a_box_reaches_as_far_as_its_farthest_corner() -> None:
    """Oracle: distances of the eight corners; those of a box whose centre lies along a diagonal."""
    size = np.array(EDGES)
    box = CarriedBox(tuple(0.7 * size), tuple(map(tuple, np.eye(3))), EDGES)
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    corners = 0.7 * size + signs * size / 2
    assert box.placed(3).body.reach == pytest.approx(
        np.linalg.norm(corners, axis=1).max(), rel=1e-12
    )


def test_torques_carry_the_body(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Oracle: RNEA of the URDF with a homogeneous box welded to its tip."""
    model = pinocchio_model(lib.urdf())
    tip = model.frames[model.getFrameId(lib.manifest.tip, pinocchio.BODY)]
    moment = MASS / 12 * (np.sum(np.square(EDGES)) - np.square(EDGES))
    box = pinocchio.Inertia(MASS, np.array(COM), np.diag(moment))
    model.appendBodyToJoint(tip.parentJoint, box, tip.placement)
    data = model.createData()
    motion = np.stack(trajectories[0].at(lib, np.array([0.0, 1.3, 4.4, 7.7])))
    wanted = [pinocchio.rnea(model, data, *state) for state in zip(*motion[:3], strict=True)]
    torque = next(c for c in constraints(lib, lib.home, safety_of(lib)) if c.kind == "torque")
    limit = 0.95 * lib.limits()["effort"]
    # Rounding of sums of 100 N·m over limits of 12.
    assert torque.values(motion)[:, :7] == pytest.approx(np.array(wanted) / limit - 1, abs=1e-11)


def test_distances_are_coals(lib: Library) -> None:
    """Oracle: box and capsules in coal, at random places in the range of the joints."""
    rng = np.random.default_rng(3)
    limits = lib.limits()
    clearance, height = carried(lib, "self-collision"), carried(lib, "table")
    others = [proxy for proxy in lib.proxies if proxy.joint != 6]
    assert clearance.labels == tuple(f"carried body and {proxy.name}" for proxy in others)
    box = coal.Box(*EDGES)
    apart = 0
    for q in rng.uniform(limits["lower"], limits["upper"], (60, 7)):
        model, data = poses(lib, q)
        tip = data.oMf[model.getFrameId(lib.manifest.tip, pinocchio.BODY)]
        place = tip * pinocchio.SE3(np.eye(3), np.array(COM))
        motion = np.zeros((4, 1, 7))
        motion[0] = q
        result = MARGIN - 0.1 * clearance.values(motion)[0]
        for proxy, distance in zip(others, result, strict=True):
            start, end = np.array(proxy.start), np.array(proxy.end)
            turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start)
            shape = coal.Capsule(proxy.radius, float(np.linalg.norm(end - start)))
            there = data.oMi[proxy.joint + 1] * pinocchio.SE3(turn.matrix(), (start + end) / 2)
            wanted = coal.distance(
                *(box, coal.Transform3s(place.rotation, place.translation)),
                *(shape, coal.Transform3s(there.rotation, there.translation)),
                *(coal.DistanceRequest(), coal.DistanceResult()),
            )
            if wanted > 0:
                # GJK of coal ends at 1e-6 m.
                assert distance == pytest.approx(wanted, abs=2e-6), proxy.name
                apart += 1
            else:
                assert distance <= 0
        corners = np.array(np.meshgrid(*[(-edge / 2, edge / 2) for edge in EDGES])).reshape(3, -1)
        lowest = (place.rotation @ corners)[2].min() + place.translation[2]
        # Rounding of a place.
        assert 0.03 - 0.1 * height.values(motion)[0, 0] == pytest.approx(lowest, abs=1e-12)
    assert apart > 300


@pytest.mark.parametrize("kind", ["self-collision", "table"])
def test_slopes_by_taylor(lib: Library, kind: str) -> None:
    """Derivative: every row in q; rates along a motion are the slopes times dq."""
    constraint = carried(lib, kind)
    rng = np.random.default_rng(5)
    direction = rng.normal(size=7)

    def values(q: np.ndarray) -> np.ndarray:
        motion = np.zeros((4, 1, 7))
        motion[0] = q
        return constraint.values(motion)[0]

    motion = np.zeros((4, 1, 7))
    motion[0] = start = lib.home + 0.3 * rng.normal(size=7)
    slopes = constraint.slopes(motion)[0, :, 0]
    for row in range(len(constraint.labels)):
        if np.abs(slopes[row]).max() < 1e-9:
            continue
        measured = taylor_slope(
            lambda q, row=row: values(q)[row],
            start,
            0.05 * direction,
            float(slopes[row] @ (0.05 * direction)),
        )
        # Large steps change the edge of the box that is closest.
        assert_second_order(measured, decades=2.5)
    moved = np.zeros((5, 1, 7))
    moved[:2, 0] = start, direction
    rate = constraint.along(SampledMotion(lib, moved))[1][0]
    assert rate == pytest.approx(slopes @ direction, abs=1e-12)  # rounding of sums of 7


def test_the_payload_that_was_left_out(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Property: a motion within the torque limits of the empty hand breaks them with the body."""
    motion = replace(trajectories[0], coefficients=0.9 * trajectories[0].coefficients)
    heavy = "6,0,0,0.1,0.1,0.1,0.2"
    empty = certificate_of(lib, motion, Safety())
    loaded = certificate_of(lib, motion, safety_of(lib, heavy, None))
    use = {c: next(u for u in c.uses if u.kind == "torque").bound for c in (empty, loaded)}
    assert use[loaded] > use[empty] + 0.1
    assert empty.sentences()[0] == "load: empty hand"
    assert loaded.sentences()[0] == "load: 6 kg in a box of 100 x 100 x 200 mm"
    assert any("carried body" in one.where for one in loaded.distances)
    bare = certificate_of(lib, motion, safety_of(lib, "6,0,0,0.1", None))
    assert "carried body" in bare.unchecked


def test_a_box_that_meets_the_arm_at_home_is_refused(lib: Library) -> None:
    """Property: one sentence with the capsule and the lack of room."""
    safety = safety_of(lib, "1,0,0,0.1,0.5,0.5,0.5")
    with pytest.raises(IdentificationError, match=r"limit of carried body and link\d is already"):
        require_rest(constraints(lib, lib.home, safety), lib.home)


@pytest.mark.parametrize(
    ("body", "match"),
    [
        ("1.8", r"--carry needs MASS,CX,CY,CZ,LX,LY,LZ .* got '1.8'"),
        ("a,b,c,d,e,f,g", "--carry needs MASS"),
        ("1,0,0,0,0.1,x,0.1", "--carry needs MASS"),
        ("-1,0,0,0,0.1,0.1,0.1", "mass above 0 kg"),
        ("1,0,0,0,0.1,0,0.1", "edges above 0 m"),
        ("1,0,0,0,0.1,nan,0.1", "edges above 0 m"),
        ("missing.json", "missing.json"),
        ("bad.json", "the box of 'bad.json' needs six finite numbers"),
        ("other.json", "in the frame 'elsewhere'"),
    ],
)
def test_what_is_no_body(
    lib: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, match: str
) -> None:
    """Property: one sentence."""
    monkeypatch.chdir(tmp_path)
    facts = {"mass": 1.0, "com": [0, 0, 0.1], "box": [0, 1, 2]}
    Path("bad.json").write_text(json.dumps(facts))
    Path("other.json").write_text(json.dumps(facts | {"frame": "elsewhere", "box": None}))
    with pytest.raises(RuntimeFault, match=match):
        carried_body(lib, body)


def test_a_file_of_a_body(lib: Library, tmp_path: Path) -> None:
    """Property: mass, inertia and box of a JSON are those of the numbers."""
    moment = MASS / 12 * (np.sum(np.square(EDGES)) - np.square(EDGES))
    ends = [end for c, e in zip(COM, EDGES, strict=True) for end in (c - e / 2, c + e / 2)]
    facts = {"mass": MASS, "com": COM, "inertia": np.diag(moment).tolist(), "box": ends}
    path = tmp_path / "body.json"
    path.write_text(json.dumps(facts))
    numbers, file = carried_body(lib, BODY), carried_body(lib, str(path))
    assert numbers is not None
    assert file is not None
    # Rounding of the sums of ends and of a linear solve.
    assert file.pi == pytest.approx(numbers.pi, abs=1e-12)
    assert isinstance(file.box, CarriedBox)
    assert isinstance(numbers.box, CarriedBox)
    assert file.box.center == pytest.approx(numbers.box.center, abs=1e-12)
    assert file.box.size == pytest.approx(numbers.box.size, abs=1e-12)


def test_excite_with_a_body_in_the_hand(command: Command, lib: Library, tmp_path: Path) -> None:
    """Property: the certificate states the load; without the option it states an empty hand."""
    words = (
        "--duration",
        4,
        "--settings",
        f"harmonics={2}",
        "--settings",
        f"starts={1}",
        "--out",
        "m.json",
    )
    ran = command("excite", "--robot", lib.folder, *words, "--carry", "1.8,0,0,0.12,0.1,0.1,0.2")
    assert ran.code == 0, ran.err
    assert "load: 1.8 kg in a box of 100 x 100 x 200 mm; NOT checked: table" in ran.out
    ran = command("excite", "--robot", lib.folder, *words, "--settings", "overwrite=true")
    assert ran.code == 0, ran.err
    assert "load: empty hand; NOT checked: table" in ran.out
    assert ran.out.count("checked: position, velocity, acceleration, jerk, braking, torque") == 1
    for option in (("--carry", "1,0,0,0"), ("--settings", "torque_fraction=0.9")):
        ran = command(
            "excite", "--robot", lib.folder, *words, "--settings", "document=true", *option
        )
        assert (ran.code, ran.err.count("\n")) == (2, 1)
        assert "--settings document=true excludes" in ran.err
