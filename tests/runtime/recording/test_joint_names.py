"""Joints of a log whose names differ from those of the robot in a prefix."""

import pytest

from runtime.recording.joint_names import renamed_joints

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
