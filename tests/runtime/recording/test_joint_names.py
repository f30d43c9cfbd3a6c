"""Joints of a log whose names differ from those of the robot in a prefix."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.inspection import inspect_log
from runtime.library import Library
from runtime.recording import read_recording
from runtime.recording.coupled_joints import in_order_of, independent_joints, renamed_joints
from runtime.recording.streamed import open_streamed
from tests.runtime.diagnosis import EXAMPLE

FR3 = tuple(f"fr3_joint{k}" for k in range(1, 4))
UR = ("shoulder_pan_joint", "elbow_joint")


@pytest.mark.parametrize(
    ("of_log", "robot", "expected"),
    [
        ("fr3_joint3 x fr3_joint1 fr3_joint2", FR3, FR3),
        (
            "fer_joint1 fer_joint3 fer_joint2 fer_finger_joint1",
            FR3,
            "fer_joint1 fer_joint2 fer_joint3",
        ),
        ("joint1 joint2 joint3", FR3, "joint1 joint2 joint3"),
        ("left_joint1 left_joint2 left_joint3 right_joint1 right_joint2 right_joint3", FR3, ""),
        ("motor1 motor2 motor3", FR3, ""),
        ("myjoint1 myjoint2 myjoint3", FR3, ""),
        ("fer_joint1 fer_joint2", FR3, ""),
        ("ur5_elbow_joint ur5_shoulder_pan_joint", UR, "ur5_shoulder_pan_joint ur5_elbow_joint"),
    ],
)
def test_a_prefix_is_replaced_where_one_fits(
    of_log: str, robot: tuple[str, ...], expected: tuple[str, ...] | str
) -> None:
    """Property: in the robot's order; never where two prefixes or another word would fit."""
    names = tuple(expected.split()) if isinstance(expected, str) else expected
    assert renamed_joints(of_log.split(), robot) == names


@pytest.mark.parametrize("more", [0, 2])
def test_arrays_are_taken_by_their_names(lib: Library, tmp_path: Path, more: int) -> None:
    """Oracle: the log in the order of the robot; the file has it reversed, with two fingers."""
    right = read_recording(EXAMPLE)
    extra = np.zeros((len(right), more))
    arrays = {key: np.hstack([getattr(right, key)[:, ::-1], extra]) for key in ("q", "dq", "tau")}
    names = [*(f"fer_joint{k}" for k in range(7, 0, -1)), "fer_finger1", "fer_finger2"]
    np.savez(tmp_path / "log.npz", t=right.t, **arrays, joint_names=np.array(names[: 7 + more]))
    log = independent_joints(read_recording(tmp_path / "log.npz"), lib)
    assert log.joint_names == lib.joint_names
    for key in arrays:
        np.testing.assert_array_equal(getattr(log, key), getattr(right, key))
    if not more:
        found = inspect_log(tmp_path / "log.npz", lib)
        assert not [each for each in found.findings if each.level == "error"]


@pytest.mark.parametrize("kind", ["law", "currents"])
def test_commands_and_currents_are_taken_by_their_names(
    lib: Library, tmp_path: Path, kind: str
) -> None:
    """Oracle: the torque of the log in the order of the robot; the file has it reversed."""
    right = read_recording(EXAMPLE)
    kp = np.linspace(100.0, 700.0, 7)
    arrays = {"q": right.q, "dq": right.dq, "tau": right.tau}
    if kind == "law":
        arrays = {
            "q": right.q,
            "dq": right.dq,
            "q_des": right.q + right.tau / kp,
            "kp": kp,
            "kd": 0 * kp,
        }
    turned = {key: values[..., ::-1] for key, values in arrays.items()}
    names = np.array([f"fr3_joint{k}" for k in range(7, 0, -1)])
    np.savez(tmp_path / "log.npz", t=right.t, **turned, joint_names=names)
    recipe = None
    if kind == "currents":
        plan = inspect_log(tmp_path / "log.npz", lib).plan
        torque, position = (
            replace(plan.torque, unit="A", order=()),
            replace(plan.position, order=()),
        )
        recipe = plan.replace(torque=torque, position=position, velocity=None, joints=tuple(names))
    log = independent_joints(read_recording(tmp_path / "log.npz", recipe), lib)
    np.testing.assert_allclose(log.q, right.q)
    np.testing.assert_allclose(log.tau, right.tau, atol=1e-9)
    if log.law is not None:
        np.testing.assert_allclose(log.law.kp, kp)
        proposed = inspect_log(tmp_path / "log.npz", lib).plan
        again = independent_joints(read_recording(tmp_path / "log.npz", proposed), lib)
        np.testing.assert_allclose(again.tau, right.tau, atol=1e-9)


@pytest.mark.parametrize("has_recipe", [True, False])
def test_arrays_that_stay_in_their_file_are_taken_by_their_names(
    lib: Library, tmp_path: Path, has_recipe: bool
) -> None:
    """Oracle: the log in the order of the robot, also with a recipe that names no order."""
    right = read_recording(EXAMPLE)
    turned = {key: getattr(right, key)[:, ::-1].copy() for key in ("q", "dq", "tau")}
    names = np.array([f"fr3_joint{k}" for k in range(7, 0, -1)])
    np.savez(tmp_path / "log.npz", t=right.t, **turned, joint_names=names)
    recipe = None
    if has_recipe:
        plan = inspect_log(tmp_path / "log.npz", lib).plan
        parts = {kind: replace(part, order=()) for kind, part in plan.signals().items()}
        recipe = plan.replace(joints=(), **parts)
    block = in_order_of(lib, open_streamed(tmp_path / "log.npz", recipe)).block(0, 100)
    whole = independent_joints(read_recording(tmp_path / "log.npz", recipe), lib)
    for key in turned:
        np.testing.assert_array_equal(getattr(block, key), getattr(right, key)[:100])
        np.testing.assert_array_equal(getattr(whole, key), getattr(right, key))
    more = {key: np.hstack([x, x[:, :1]]) for key, x in turned.items()}
    np.savez(tmp_path / "log.npz", t=right.t, **more, joint_names=np.append(names, "finger"))
    with pytest.raises(IdentificationError, match="contains more joints than 'fr3'"):
        in_order_of(lib, open_streamed(tmp_path / "log.npz"))
