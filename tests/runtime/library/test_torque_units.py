"""Units of joint torques: N·m of joints that turn, N of joints that slide."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from runtime.campaign.shortest_session import target_of
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import write_motion
from runtime.library import Library
from runtime.library.manifest import common_unit, file_units, listed_torques, torque_units
from tests.runtime.conftest import Command

Robot = Callable[[str], Library]
UNITS = ("N", "N·m", "N", "N·m")


def test_units_of_a_gantry(robot: Robot) -> None:
    """Property: the joints slide, turn, slide and turn."""
    gantry = robot("gantry").manifest
    assert torque_units(gantry) == UNITS
    assert file_units(gantry) == ["N", "N*m", "N", "N*m"]


def test_numbers_with_units() -> None:
    """Property: one unit stands once; units that differ stand beside each number."""
    values = np.array([1.0, 2.5])
    assert listed_torques(values, ("N", "N"), ".1f", "m") == "1.0, 2.5 mN"
    assert listed_torques(values, ("N", "N·m"), ".1f", "m") == "1.0 mN, 2.5 mN·m"
    assert [common_unit(units, "m") for units in (("N·m",), ("N", "N"), UNITS)] == [
        "mN·m",
        "mN",
        "mN|mN·m",
    ]


def test_a_prediction_states_the_unit_of_every_joint(
    command: Command, robot: Robot, tmp_path: Path
) -> None:
    """Property: noise and σ of joints that slide are in N; before, all were in N·m."""
    gantry = robot("gantry")
    rng = np.random.default_rng(0)
    swing = Trajectory(gantry.home, 0.01 * rng.normal(size=(4, 5)), 4.0)
    write_motion(swing, gantry, tmp_path / "motion.json")
    ran = command("predict", "motion.json", "--robot", gantry.folder)
    assert ran.code == 0, ran.err
    assert "torque noise 0.05 N|N·m" in ran.out
    line = next(line for line in ran.out.splitlines() if "expected σ of the predicted" in line)
    numbers = line.split("joint by joint: ")[1].split(", ")
    assert [number.split(" ")[1] for number in numbers] == ["m" + unit for unit in UNITS]


def test_coulomb_friction_of_a_slide(robot: Robot) -> None:
    """Property: friction beyond the limit of a joint that slides is refused in N."""
    gantry = robot("gantry")
    with pytest.raises(IdentificationError, match=r"friction of 900 N exceeds .* % of 200 N;"):
        constraints(gantry, gantry.home, Safety(coulomb=(900.0, 0.0, 0.0, 0.0)))


def test_a_target_of_slides() -> None:
    """Property: a robot that slides states its target in N."""
    target = target_of("v=5mN")
    assert (target.value, target.shown(target.value)) == (5e-3, "5 mN")
