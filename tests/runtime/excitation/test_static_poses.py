"""Poses at rest: `python -m runtime excite --settings static=true --settings poses=K` and the
accuracy they give.
"""

import csv
import json
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from runtime import load
from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.safety import Safety
from runtime.excitation.static_poses import (
    a_optimal,
    design_poses,
    feasible_poses,
    gravity_columns,
    gravity_regressor,
    pose_range,
)
from runtime.inspection import INFO, inspect_log
from runtime.library import Array, Library
from runtime.recording import Recording, write_recording
from runtime.recording.static_poses import static_poses
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import DATA, ONE_LEVEL
from tests.runtime.conftest import Command

COULOMB, QUANTUM = 0.05, 0.03
"""Coulomb friction and step of the measured torque of a servo arm [N·m]."""
POSES, SETS = 12, 50
BOTH = (1.0, -1.0)
TABLE = 0.0


@pytest.fixture(scope="module")
def servo_arm(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """Five servo joints in the size of an SO-101."""
    request = BuildRequest("servo_arm", (DATA / "servo_arm.urdf").read_text())
    return load(build(request, tmp_path_factory.mktemp("servo"), levels=ONE_LEVEL).folder)


def gravity(lib: Library, q: Array) -> Array:
    """Torque at rest, (N, n) N·m, of bodies that are 20 % heavier than the model."""
    return lib.inverse_dynamics(q, np.zeros_like(q), np.zeros_like(q), 1.2 * lib.pi0)


def gravity_error(lib: Library, q: Array, signs: Sequence[float | Array], at: Array) -> float:
    """RMS error of the gravity torque at other poses, N·m, after least squares on readings at q."""
    readings = [gravity(lib, q) + COULOMB * sign for sign in signs]
    tau = np.mean([QUANTUM * np.round(each / QUANTUM) for each in readings], axis=0)
    columns = gravity_columns(lib, at)
    matrix = gravity_regressor(lib, q, columns).reshape(-1, len(columns))
    beta = np.linalg.lstsq(matrix, tau.ravel(), rcond=None)[0]
    error = gravity_regressor(lib, at, columns) @ beta - gravity(lib, at)
    return float(np.sqrt(np.mean(error**2)))


def test_chosen_poses_halve_the_gravity_error_of_random_poses(servo_arm: Library) -> None:
    """Property: 12 poses reached from both sides ≤ half of 12 random poses reached as it comes.

    Random poses that are reached from both sides too are worse than the chosen ones, by the share
    that the design predicts.
    """
    lib, rng = servo_arm, np.random.default_rng(1)
    noise = np.full(lib.n_joints, QUANTUM / np.sqrt(12))  # of a uniform rounding error
    chosen = [design_poses(lib, POSES, Safety(), noise, starts=1, seed=s) for s in range(5)]
    pool = feasible_poses(lib, 2000, Safety(), pose_range(lib), rng)
    designed = np.mean([gravity_error(lib, d.poses, BOTH, pool) for d in chosen])
    sets = [rng.choice(pool, POSES, replace=False) for _ in range(SETS)]
    drawn = [(q, rng.choice([-1.0, 1.0], q.shape)) for q in sets]
    one_sided = np.mean([gravity_error(lib, q, (side,), pool) for q, side in drawn])
    both = np.mean([gravity_error(lib, q, BOTH, pool) for q in sets])
    assert designed <= one_sided / 2
    assert designed < both
    assert chosen[0].sigma < chosen[0].sigma_random
    assert chosen[0].torque < chosen[0].torque_random


def visited(lib: Library, poses: Array, approach: Array) -> Recording:
    """Log at 50 Hz of all poses from below and from above; encoder of 4096 counts per turn.

    Every visit moves to the start of its approach, waits there, moves on to the pose and rests.
    """
    t = np.arange(0.0, 1.0, 0.02)
    ramp = np.concatenate([0.5 - 0.5 * np.cos(np.pi * t), np.ones(15)])[:, None]
    rest = np.ones((50, 1))
    way, signs, here = [], [], np.zeros(lib.n_joints)
    for pose in poses:
        for side in (-1.0, 1.0):
            start = pose + side * approach
            way += [here + ramp * (start - here), start + ramp * (pose - start), rest * pose]
            signs += [np.sign(start - here) * np.ones_like(ramp)]
            signs += [-side * np.ones((len(ramp) + len(rest), lib.n_joints))]
            here = pose
    q, sign = np.concatenate(way), np.concatenate(signs)
    tau = gravity(lib, q) + COULOMB * sign
    count = 2 * np.pi / 4096
    return Recording(
        0.02 * np.arange(len(q)),
        count * np.round(q / count),
        tau=QUANTUM * np.round(tau / QUANTUM),
        name="visits",
    )


def test_a_log_of_poses_gives_the_gravity_torque(
    servo_arm: Library, command: Command, tmp_path: Path
) -> None:
    """Oracle: g(q) of bodies 20 % heavier than the model, from pairs that the data show.

    The design predicts the error of rounded torques; three times it, as the rounding of a torque
    at rest does not average out and the split leaves poses to the test.
    """
    lib = servo_arm
    noise = np.full(lib.n_joints, QUANTUM / np.sqrt(12))
    designed = design_poses(lib, POSES, Safety(), noise, starts=1)
    log = visited(lib, designed.poses, designed.approach)
    rows = static_poses(log)
    assert rows is not None
    # One count of the encoder.
    np.testing.assert_allclose(rows.q, designed.poses, atol=2 * np.pi / 4096)
    write_recording(log, tmp_path / "visits.csv")
    words = ("--out", "out", "--settings", "report=false", "--verbose")
    ran = command("identify", "visits.csv", "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    assert "12 poses at rest that were reached from both sides" in ran.out
    loud = [f for f in inspect_log(tmp_path / "visits.csv", lib).findings if f.level != INFO]
    assert loud == []
    refused = command("identify", "visits.csv", "--robot", lib.folder, "--delay", "auto")
    assert refused.code == 2
    assert "need motion" in refused.err
    pi = np.array(json.loads((tmp_path / "out/result.json").read_text())["pi"])
    at = np.random.default_rng(0).uniform(-1, 1, (200, lib.n_joints))
    known = lib.inverse_dynamics(at, 0 * at, 0 * at, pi.ravel())
    error = float(np.sqrt(np.mean((known - gravity(lib, at)) ** 2)))
    assert error < 3 * designed.torque
    # One side alone: no pairs, a log of motion.
    half = log.take(slice(0, len(log) // (2 * POSES)), "Took a visit.")
    assert static_poses(half) is None


def test_the_exchange_finds_the_best_subset() -> None:
    """Oracle: all subsets of three of ten random candidates."""
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(10, 2, 4))
    grams = np.swapaxes(rows, 1, 2) @ rows
    values = {
        each: np.trace(np.linalg.inv(grams[list(each)].sum(axis=0)))
        for each in combinations(range(10), 3)
    }
    chosen, value = a_optimal(grams, 3, 10, rng)
    best = min(values, key=lambda each: values[each])
    assert tuple(sorted(chosen)) == best
    # The ridge is 1e-9 of the mean information; the inverse of a random set amplifies it.
    assert value == pytest.approx(values[best], rel=1e-6)


def test_gravity_columns_reproduce_the_gravity_torque(lib: Library) -> None:
    """Oracle: RNEA at rest is in the span of the chosen columns, which are independent."""
    q = np.random.default_rng(0).uniform(-2, 2, (200, lib.n_joints))
    columns = gravity_columns(lib, q)
    matrix = gravity_regressor(lib, q, columns).reshape(-1, len(columns))
    torque = lib.inverse_dynamics(q, 0 * q, 0 * q, lib.pi0).ravel()
    beta, _, rank, _ = np.linalg.lstsq(matrix, torque, rcond=None)
    assert rank == len(columns) < len(lib.base_columns)
    # Rounding of torques of 50 N·m.
    np.testing.assert_allclose(matrix @ beta, torque, atol=1e-11)


def test_the_command_writes_poses_that_keep_all_limits(
    lib: Library, command: Command, tmp_path: Path
) -> None:
    """Property: joints, table and self-clearance at the poses and at the starts of both visits."""
    ran = command(
        *(
            "excite",
            "--robot",
            lib.folder,
            "--settings",
            "static=true",
            "--settings",
            f"poses={8}",
            "--table",
            TABLE,
        ),
        *("--settings", f"starts={1}", "--out", "poses.json"),
    )
    assert ran.code == 0, ran.err
    assert "8 poses, each reached from both sides" in ran.out
    assert "NOT checked: the way from one pose to the next" in ran.out
    facts = json.loads((tmp_path / "poses.json").read_text())
    assert facts["joints"] == list(lib.joint_names)
    poses = np.array(facts["poses"])
    assert poses.shape == (8, lib.n_joints)
    with (tmp_path / "poses.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["pose"], row["side"]) for row in rows[:2]] == [("0", "below"), ("0", "above")]
    starts = np.array([[float(row[f"{name}_start"]) for name in lib.joint_names] for row in rows])
    ends = np.array([[float(row[name]) for name in lib.joint_names] for row in rows])
    # Nine digits of angles below 10 rad.
    np.testing.assert_allclose(ends, np.repeat(poses, 2, axis=0), atol=1e-8)
    np.testing.assert_allclose((starts[::2] + starts[1::2]) / 2, poses, atol=1e-8)
    assert (starts[::2] < poses).all()
    limits, visited = lib.limits(), np.concatenate([starts, ends])
    assert (visited >= limits["lower"] - 1e-8).all()
    assert (visited <= limits["upper"] + 1e-8).all()
    motion = np.zeros((4, len(visited), lib.n_joints))
    motion[0] = visited
    for limit in constraints(lib, lib.home, Safety(table=TABLE)):
        assert (limit.values(motion) <= 1e-7).all(), limit.kind


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--settings", "static=true", "--settings", f"poses={0}"), "expected 1 to 500 poses"),
        (("--settings", "static=true", "--settings", f"poses={1}"), "expected at least"),
        (("--settings", f"poses={5}"), "give --settings static=true too"),
        (("--settings", "static=true", "--duration", 5), "--duration does not apply"),
        (("--settings", "static=true", "--export", "ros"), "--export does not apply"),
        (("--settings", "static=true", "--settings", f"margin={0}"), "a margin above 0"),
        (("--settings", "static=true", "--out", "poses.txt"), "ends in .json"),
        (("--settings", "static=true", "--table", 5), "poses within all limits"),
    ],
)
def test_bad_options_get_a_sentence(
    lib: Library, command: Command, tmp_path: Path, words: tuple[object, ...], sentence: str
) -> None:
    """Property: exit code 2, what was expected, no file."""
    ran = command("excite", "--robot", lib.folder, "--settings", f"starts={1}", *words)
    assert ran.code == 2
    assert sentence in " ".join(ran.err.split())
    assert not (tmp_path / "results").exists()


def test_existing_poses_are_not_replaced(lib: Library, command: Command, tmp_path: Path) -> None:
    """Property: the old file stays unless --settings overwrite=true is given."""
    (tmp_path / "poses.csv").write_text("mine")
    ran = command(
        "excite", "--robot", lib.folder, "--settings", "static=true", "--out", "poses.json"
    )
    assert ran.code == 2
    assert "--settings overwrite=true" in ran.err
    assert (tmp_path / "poses.csv").read_text() == "mine"


def test_gravity_without_torque_gets_a_sentence(lib: Library) -> None:
    """Property: a regressor that vanishes at rest is refused, not inverted."""

    class Floating:
        """A robot whose axes are all vertical."""

        name = "vertical"

        def base_regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
            """Zeros (N, n, 3)."""
            return np.zeros((*q.shape, 3))

    with pytest.raises(IdentificationError, match="no torque on any joint"):
        gravity_columns(Floating(), np.ones((5, 2)))  # type: ignore[arg-type]
