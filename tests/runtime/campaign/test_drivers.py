"""Drivers and guards: what goes wrong stops the virtual robot, and the log up to there is whole."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from runtime import read_recording, write_recording
from runtime.campaign.campaign import move_to
from runtime.campaign.driver import START, Sample, Streamed
from runtime.campaign.drivers.virtual import PlantedFault, VirtualDriver
from runtime.campaign.guards import KeyGuard, LimitsGuard, model_error, usual_guards
from runtime.errors import IdentificationError, SimulationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.library import Library

MOTION = Path(__file__).parents[3] / "runtime" / "examples" / "fr3_trajectory.json"
WITHIN_S = 0.005 + 1e-9
"""Stated time from a fault to the stop, and rounding of the clock."""


def test_model_errors_follow_the_limits_of_efforts() -> None:
    """Oracle: .6 % of the limit, at least .5 N·m, at most 3 %; a joint without a limit is named."""

    @dataclass
    class Arm:
        efforts: tuple[float, ...]
        joint_names = ("hip", "knee", "toe")

        def limits(self) -> dict[str, np.ndarray]:
            return {"effort": np.array(self.efforts)}

    np.testing.assert_allclose(model_error(Arm((200.0, 20.0, 0.5))), [1.2, 0.5, 0.015])
    for unknown in (0.0, np.inf):
        with pytest.raises(IdentificationError, match="an effort limit of knee"):
            model_error(Arm((200.0, unknown, 0.5)))


@pytest.fixture(scope="module")
def motion(fr3: Library) -> Trajectory:
    return read_trajectory(MOTION, fr3)


def streamed(fr3: Library, motion: Trajectory, fault: PlantedFault | None, **words) -> Streamed:
    robot = VirtualDriver(fr3, fault=fault, **words)
    robot.place(motion.home)
    done = robot.stream(motion, guards=usual_guards(fr3, robot.rate_hz))
    # Braked: 0.5 s of a controller whose time constant is 1/15 s.
    assert np.abs(robot.velocity).max() < 0.05
    return done


def require_whole(done: Streamed, folder: Path, fr3: Library) -> None:
    """The log has every sample up to the stop, in a file too."""
    assert done.stop is not None
    log = done.recording(fr3, "stopped")
    assert len(log.t) == len(done.samples)
    write_recording(log, folder / "stopped.npz")
    again = read_recording(folder / "stopped.npz")
    np.testing.assert_array_equal(again.q, [each.q for each in done.samples])
    np.testing.assert_array_equal(again.tau, [each.tau for each in done.samples])
    assert f"Stopped by {done.stop.guard}" in " ".join(log.history)


@pytest.mark.parametrize("joint", range(7))
def test_a_collision_stops_the_robot(
    fr3: Library, motion: Trajectory, joint: int, tmp_path: Path
) -> None:
    """Property: 10 N·m on any joint, of either sign, during a fast motion; within 5 ms."""
    at = 0.30 + 0.03 * joint
    done = streamed(
        fr3, motion, PlantedFault("collision", at, joint, 10.0 * (-1) ** joint), seed=joint
    )
    assert done.stop is not None
    assert done.stop.guard == "external torque"
    assert fr3.joint_names[joint] in done.stop.sentence
    assert 0 < done.stop.seconds - at <= WITHIN_S
    assert len(done.samples) == round(1000 * done.stop.seconds)
    require_whole(done, tmp_path, fr3)


@pytest.mark.parametrize(
    ("kind", "size", "guard"),
    [
        ("stuck", 0.0, {"limits", "external torque", "tracking"}),
        ("dead", 0.0, {"connection"}),
        ("clock", 0.5, {"clock"}),
        ("clock", -0.5, {"clock"}),
    ],
)
def test_other_faults_stop_the_robot(
    fr3: Library, motion: Trajectory, kind: str, size: float, guard: set[str], tmp_path: Path
) -> None:
    """Property: a joint that stops turning, a lost connection, a clock that jumps; within 5 ms."""
    at = 0.4
    done = streamed(fr3, motion, PlantedFault(kind, at, 1, size))
    assert done.stop is not None
    assert done.stop.guard in guard
    assert 0 < done.stop.seconds - at <= WITHIN_S
    require_whole(done, tmp_path, fr3)


def test_a_sound_robot_completes_its_motion(fr3: Library, motion: Trajectory) -> None:
    """Property: no guard refuses free motion; samples come at the rate of the robot."""
    short = replace(motion, coefficients=0.05 * motion.coefficients, duration=1.5)
    robot, seen = VirtualDriver(fr3, seed=3), []
    robot.place(short.home)
    done = robot.stream(short, seen.append, usual_guards(fr3, robot.rate_hz))
    assert done.stop is None
    assert seen == done.samples
    log = done.recording(fr3, "virtual")
    np.testing.assert_allclose(np.diff(log.t), 1e-3, atol=1e-9)
    assert len(log.t) == 1501


def test_the_user_stops_the_robot(fr3: Library, motion: Trajectory) -> None:
    """Property: a key and Ctrl-C at the sample at which they come; the samples are kept."""
    robot, count = VirtualDriver(fr3), []
    robot.place(motion.home)
    done = robot.stream(motion, count.append, [KeyGuard(lambda: len(count) == 20)])
    assert (done.stop.guard, len(done.samples)) == ("key", 20)

    def interrupted(_: Sample) -> None:
        raise KeyboardInterrupt

    robot.place(motion.home)
    done = robot.stream(motion, interrupted)
    assert (done.stop.guard, len(done.samples)) == ("interrupt", 1)


def test_limits(fr3: Library) -> None:
    """Property: position, velocity, torque and numbers that are not finite, named by joint."""
    guard, still = LimitsGuard(fr3), np.zeros(7)
    good = Sample(0.0, 0.0, fr3.home, still, still)
    assert guard.refusal(good, None) is None
    for key, j, value, said in (
        ("q", 3, 0.5, "expected fr3_joint4 in"),
        ("dq", 0, -2.9, "velocity of fr3_joint1"),
        ("tau", 6, 13.0, "torque of fr3_joint7"),
        ("dq", 2, np.nan, "finite velocity of fr3_joint3"),
    ):
        values = getattr(good, key).copy()
        values[j] = value
        assert said in guard.refusal(replace(good, **{key: values}), None)


def test_a_motion_begins_where_the_robot_is(fr3: Library, motion: Trajectory) -> None:
    """Property: one sentence; the robot does not move."""
    robot = VirtualDriver(fr3)
    robot.place(motion.home + 0.1)
    with pytest.raises(SimulationError, match="expected the robot at the start of the motion"):
        robot.stream(motion)
    np.testing.assert_array_equal(robot.velocity, 0)
    with pytest.raises(SimulationError, match="expected a fault of stuck"):
        PlantedFault("fire", 0.1)


def test_a_robot_elsewhere_moves_to_the_start(
    fr3: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a certified way under guards; a robot that stands there stays, a push stops it."""
    aside = fr3.home + np.array([0.1, 0, 0, 0.1, 0, 0, 0])
    robot = VirtualDriver(fr3)
    robot.place(aside)
    sentences: list[str] = []
    monkeypatch.setattr("runtime.campaign.campaign.WAY_SPEED", 0.5)
    move_to(robot, fr3.home, Safety(), sentences.append)
    assert np.abs(robot.position - fr3.home).max() < START
    move_to(robot, robot.position, Safety(), sentences.append)
    assert len(sentences) == 1
    assert sentences[0].startswith("the robot moves to the start")
    pushed = VirtualDriver(fr3, fault=PlantedFault("collision", 0.2, 1))
    pushed.place(aside)
    with pytest.raises(IdentificationError, match=r"stopped after 0.2\d* s by external torque"):
        move_to(pushed, fr3.home, Safety())
