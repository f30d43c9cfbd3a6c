"""Logs of free bases in another convention get a sentence that names it; statements must agree."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from runtime.errors import RuntimeFault
from runtime.identification.identify import identify
from runtime.library import Library
from runtime.recording.free_base import free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from tests.free_base_logs import Experiment, virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command

Arrays = dict[str, Any]
FEET = ("left_foot", "right_thigh")


@pytest.fixture(scope="module")
def arrays() -> Arrays:
    text = (DATA / "hopper.urdf").read_text()
    return virtual_log(text, FEET, 0, Experiment(count=200)).arrays


def turned(log: Arrays, vectors: np.ndarray, inverse: bool = False) -> np.ndarray:
    return Rotation.from_quat(log["base_pose"][:, 3:]).apply(vectors, inverse)


def origin(log: Arrays) -> np.ndarray:
    """Acceleration of the origin of the base in its axes."""
    twist = log["base_twist"]
    return np.asarray(log["base_acceleration"][:, :3] + np.cross(twist[:, 3:], twist[:, :3]))


def half(log: Arrays, key: str, values: np.ndarray, first: int = 0) -> Arrays:
    changed = log[key].copy()
    changed[:, first : first + 3] = values
    return {key: changed}


def swapped(log: Arrays, key: str) -> Arrays:
    return {key: np.roll(log[key], 3, axis=1)}


def up(log: Arrays) -> np.ndarray:
    return turned(log, np.tile([0, 0, 9.81], (len(log["t"]), 1)), inverse=True)


def flags(log: Arrays) -> Arrays:
    """A foot that is lifted for the first half, with inverted flags."""
    touching, wrench = np.ones((len(log["t"]), 2)), log["contact_wrench"].copy()
    touching[:100, 1] = 0
    wrench[:100, 1] = 0.0
    return {"contact_flags": 1 - touching, "contact_wrench": wrench}


def infinite(log: Arrays) -> Arrays:
    wrench = log["contact_wrench"].copy()
    wrench[7, 1, 2] = np.inf
    return {"contact_wrench": wrench}


def inverse(log: Arrays) -> Arrays:
    """Pose of the world in the base."""
    pose = log["base_pose"]
    back = Rotation.from_quat(pose[:, 3:]).inv()
    return {"base_pose": np.hstack([-back.apply(pose[:, :3]), back.as_quat()])}


def in_degrees(log: Arrays) -> Arrays:
    """Pose by angles in degrees beside the right one."""
    turn = Rotation.from_quat(log["base_pose"][:, 3:])
    return {"base_rpy": turn.as_euler("xyz", degrees=True)}


CASES: dict[str, tuple[Callable[[Arrays], Arrays], str]] = {
    "velocity": (
        lambda log: half(log, "base_twist", turned(log, log["base_twist"][:, :3])),
        r"base_twist\[:, :3\] is in axes of the world, .* by Rᵀ",
    ),
    "angular": (
        lambda log: half(log, "base_twist", turned(log, log["base_twist"][:, 3:]), 3),
        r"base_twist\[:, 3:\] is in axes of the world",
    ),
    "quaternion": (
        lambda log: {"base_pose": log["base_pose"][:, [0, 1, 2, 6, 3, 4, 5]]},
        "base_pose has a quaternion w, x, y, z, expected x, y, z, w",
    ),
    "degrees": (
        lambda log: {"q": np.degrees(log["q"])},
        "moves from .*, its limits are .* names of its columns by joints",
    ),
    "degrees per second": (
        lambda log: {"dq": np.degrees(log["dq"])},
        "velocity of joint 'left_hip' looks like degrees per second",
    ),
    "twice": (
        lambda log: {"contact_links": np.array([FEET[0], FEET[0]])},
        "names 'left_foot' twice at the same point",
    ),
    "order": (lambda log: swapped(log, "base_twist"), r"base_twist\[:, :3\] holds the other half"),
    "origin": (
        lambda log: half(log, "base_acceleration", origin(log)),
        "is the acceleration of the origin, .* subtract ω × v",
    ),
    "sensor": (
        lambda log: half(log, "base_acceleration", origin(log) + up(log)),
        "is what an accelerometer reads",
    ),
    "world": (
        lambda log: half(log, "base_acceleration", turned(log, origin(log))),
        "is the acceleration of the origin in axes of the world",
    ),
    "sign": (
        lambda log: {"contact_wrench": -log["contact_wrench"]},
        "opposite to those that hold the URDF",
    ),
    "rpy": (
        lambda log: {"base_rpy": np.zeros((len(log["t"]), 3))},
        "base_pose and base_rpy differ by up to",
    ),
    "position": (
        lambda log: {"base_position": log["base_pose"][:, :3] + 0.1},
        "base_pose and base_position differ by up to 0.1; keep the right one",
    ),
    "reflection": (
        lambda log: {"base_pose": np.tile(np.diag([1.0, 1, -1, 1]), (len(log["t"]), 1, 1))},
        "base_pose: the pose of the base is not a rigid transform",
    ),
    "inverse": (inverse, "base_pose is the pose of the world in the base"),
    "rpy in degrees": (in_degrees, "base_rpy reaches a pitch of .*, expected at most π rad"),
    "flags": (flags, "contact_flags state 0, no contact, where the forces are"),
    "infinite": (infinite, "contact_wrench has infinite values, the first in row 7; state"),
}


@pytest.mark.parametrize("case", CASES)
def test_another_convention_gets_a_sentence(hopper: Library, arrays: Arrays, case: str) -> None:
    """Property: what came, what is expected, and how to convert it."""
    change, sentence = CASES[case]
    with pytest.raises(RuntimeFault, match=sentence):
        identify(free_base_of(arrays | change(arrays), "log"), hopper, rows="base")


def test_statements_of_one_pose_agree(hopper: Library, arrays: Arrays) -> None:
    """Property: signs of quaternions and turns of 2π change no digit but those of rounding."""
    pose = arrays["base_pose"].copy()
    pose[::2, 3:] *= -1
    rpy = Rotation.from_quat(pose[:, 3:]).as_euler("xyz")
    rpy[::3] += 2 * np.pi * np.array([1, 0, -1])
    both = {"base_pose": pose, "base_rpy": rpy, "base_position": pose[:, :3]}
    turns = arrays["q"].copy()
    turns[100:, 2] -= 2 * np.pi
    both |= {"q": turns, "contact_axes": np.array([b"link"])}
    plain = {key: value for key, value in arrays.items() if key not in {"base_twist"}}
    results = [
        identify(free_base_of(log, "log"), hopper, rows="base") for log in (plain, plain | both)
    ]
    # Euler angles at 1e-16 by the squared rate of 1e4 / s² and the condition of the fit, 1e3.
    np.testing.assert_allclose(results[1].pi, results[0].pi, rtol=0, atol=1e-8)


def test_unknown_rows_and_split(
    hopper: Library, arrays: Arrays, tmp_path: Path, command: Command
) -> None:
    """Property: --split A,B trains to B; the note states the fewest equations of an instant."""
    wrench = arrays["contact_wrench"].copy()
    wrench[50:100, 0] = np.nan
    path, out = tmp_path / "walk.npz", tmp_path / "out"
    np.savez(path, **(arrays | {"contact_wrench": wrench, "torque": arrays["tau"]}))
    words = ("identify", path, "--robot", hopper.folder, "--settings", "rows=all", "--out", out)
    done = command(*words, "--split", "0.5,0.8")
    assert done.code == 0, done.err
    facts = json.loads((out / "result.json").read_text())
    assert any("arrays that are not read: torque;" in note for note in facts["warnings"])
    assert not any("keep an error" in note for note in facts["warnings"])
    assert facts["recording"]["samples"] == {"train": 160, "validation": 0, "test": 40}
    assert any("3 to 9 of 9 equations" in note for note in facts["warnings"])
    for wrong in ("0.8,0.5", "all", "0.5,0.6,0.7"):
        done = command(*words, "--split", wrong)
        assert (done.code, "--split needs" in done.err) == (2, True)
    refused = ("encoder_bias=true", "stream=true", "regressor=momentum", "gain_sigma=0.1")
    for setting in (*refused, "seed=1"):
        done = command(*words, "--overwrite", "--settings", setting)
        assert done.code == 2
        assert (
            f"the setting {setting.partition('=')[0]} does not apply to a robot with a free base"
            in done.err
        )


def test_a_table_is_no_log_of_a_free_base(
    hopper: Library, tmp_path: Path, command: Command
) -> None:
    """Property: the layout that is expected, not a guess about Python objects."""
    path = tmp_path / "log.csv"
    path.write_text("t,q1\n0,1\n")
    done = command("identify", path, "--robot", hopper.folder)
    assert done.code == 2
    assert "log.csv is no NPZ, expected one with arrays t, q, base_pose" in done.err


def test_what_does_not_fit_is_noted(hopper: Library, arrays: Arrays) -> None:
    """Property: a contact point far from the true one leaves moments that no body explains."""
    wrong = arrays | {"contact_position": np.array([[0.0, 0, 1], [1, 0, 0]])}
    result = identify(free_base_of(wrong, "log"), hopper, rows="joints")
    assert any("half of the rows keep an error of" in note for note in result.record.warnings)


def in_world(log: Arrays, lib: Library) -> np.ndarray:
    """Contact wrenches in axes of the world."""
    motion = motion_of(free_base_of(log, "log"), lib.joint_names)
    places = [lib.link_names.index(foot) for foot in FEET]
    turn = lib.link_poses(motion.q)[:, places, :3, :3]
    halves = log["contact_wrench"].reshape(-1, 2, 2, 3)
    return np.asarray(np.einsum("ncij,nchj->nchi", turn, halves).reshape(-1, 2, 6))


WRENCHES: dict[str, tuple[Callable[[Arrays, Library], Arrays], str]] = {
    "link": (
        lambda log, lib: {"contact_wrench": in_world(log, lib)},
        "in axes of the world, and the log states those of the link",
    ),
    "world": (
        lambda log, _: {"contact_axes": np.array("world")},
        "in axes of the link, and the log states those of the world",
    ),
    "halves": (
        lambda log, _: {"contact_wrench": np.roll(log["contact_wrench"], 3, axis=2)},
        "holds the moment first, expected the force first",
    ),
    "kgf": (lambda log, _: {"contact_wrench": log["contact_wrench"] / 9.81}, "are in kgf"),
    "vertical kgf": (
        lambda log, lib: {
            "contact_wrench": np.where(np.arange(6) == 2, in_world(log, lib) / 9.81, np.nan),
            "contact_axes": np.array("world"),
        },
        "the forces look like kgf, expected N",
    ),
    "mm": (
        lambda log, _: {"base_pose": log["base_pose"] * np.repeat([1000.0, 1.0], [3, 4])},
        r"the base accelerates by .* m/s² \(RMS\), expected at most 300; give positions in m",
    ),
    "torque": (lambda log, _: {"tau": -log["tau"]}, "tau is opposite to the torques that move"),
}


@pytest.mark.parametrize("case", WRENCHES)
def test_another_convention_of_wrenches(hopper: Library, arrays: Arrays, case: str) -> None:
    """Property: axes, order of halves, units and signs are named; the right log is not refused."""
    change, sentence = WRENCHES[case]
    missing = {"base_twist", "base_acceleration"} if case == "mm" else set()
    log = {k: v for k, v in (arrays | change(arrays, hopper)).items() if k not in missing}
    with pytest.raises(RuntimeFault, match=sentence):
        identify(free_base_of(log, "log"), hopper, rows="all")


def test_wrenches_in_axes_of_the_world(hopper: Library, arrays: Arrays) -> None:
    """Property: the same wrenches in either axes give the same bodies.

    With noise of 0.01 N·m, since that of exact data is rounding, which decides what the prior adds.
    """
    tau = arrays["tau"]
    arrays |= {"tau": tau + np.random.default_rng(0).normal(scale=0.01, size=tau.shape)}
    world = arrays | {"contact_wrench": in_world(arrays, hopper), "contact_axes": np.array("world")}
    results = [identify(free_base_of(log, "log"), hopper, rows="all") for log in (arrays, world)]
    np.testing.assert_allclose(results[1].pi, results[0].pi, rtol=0, atol=1e-3)
