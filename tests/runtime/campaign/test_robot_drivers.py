"""Drivers of real arms against stand-ins with the makers' signatures; no such arm was at hand."""

import inspect
import re
import sys
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from runtime.campaign.driver import Driver
from runtime.campaign.drivers import DRIVERS, DriverSettings
from runtime.campaign.guards import usual_guards
from runtime.errors import SimulationError
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import JoinedMotion, end_of, joined
from runtime.excitation.way import way_to
from runtime.library import Library, load
from tests.runtime import robot_servers, ros2_server
from tests.runtime.conftest import Command
from tests.runtime.robot_servers import Arm

GAIN = 7.5
KINDS = {"libfranka": ("172.16.0.2", 1e-3), "ur": ("192.168.0.2", 2e-3), "ros2": ("", 0.01)}
"""Address and period of the arms."""


@pytest.fixture(scope="module")
def pendulum(tiny_built: Path) -> Library:
    return load(tiny_built)


def modules_of(kind: str, arm: Arm) -> dict[str, ModuleType]:
    if kind == "libfranka":
        return {"pylibfranka": robot_servers.pylibfranka(arm)}
    if kind == "ur":
        return robot_servers.ur_rtde(arm, np.full(arm.lib.n_joints, GAIN))
    return ros2_server.ros2(arm)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch, fr3: Library, pendulum: Library):
    """Opens a driver on a stand-in."""

    def make(kind: str, address: str | None = None, **words) -> tuple[Driver, Arm]:
        lib = fr3 if kind == "libfranka" else pendulum
        usual, period = KINDS[kind]
        arm = Arm(lib, period, **words)
        for name, module in modules_of(kind, arm).items():
            monkeypatch.setitem(sys.modules, name, module)
        # Time passes as the arm says: a loaded computer must not look like a late sample.
        monkeypatch.setattr("time.monotonic", lambda: arm.time)
        gains = np.full(lib.n_joints, GAIN)
        settings = DriverSettings(usual if address is None else address, gains=gains)
        return DRIVERS[kind].open(lib, settings), arm

    return make


def there_and_back(lib: Library) -> JoinedMotion:
    """A slow motion away from home and a part of the way back."""
    aside = np.where(np.arange(lib.n_joints) == lib.n_joints - 1, 0.3, 0.0)
    way = way_to(lib, lib.home, lib.home + aside, Safety(), 0.5).trajectory
    back = way_to(lib, lib.home + aside, lib.home + aside / 2, Safety(), 0.5).trajectory
    assert way is not None
    assert back is not None
    return joined(way, back, None)


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_on_every_arm(opened, kind: str) -> None:
    """Oracle: the arm ends where the motion ends; samples are its states, under guards."""
    driver, arm = opened(kind)
    motion = there_and_back(driver.lib)
    assert driver.rate_hz == pytest.approx(1 / KINDS[kind][1], rel=1e-6)  # stamps of whole ns
    done = driver.stream(motion, guards=usual_guards(driver.lib, driver.rate_hz))
    assert done.stop is None, done.stop
    # ROS samples end within one period before the end of the motion.
    assert done.samples[-1].q == pytest.approx(end_of(motion.parts[-1]), abs=1e-3)
    t = np.array([each.t for each in done.samples])
    assert np.diff(t) == pytest.approx(arm.period, abs=2e-9)  # stamps of whole ns
    assert t[-1] - t[0] == pytest.approx(motion.duration, abs=2.1 * arm.period)
    q = np.array([each.q for each in done.samples])
    # A sample shows the command of its period or of the one before; a goal of ROS is seen to begin
    # up to one period late.
    wanted = motion.at(driver.lib, np.clip(t - t[0], 0, motion.duration))[0]
    fastest = np.abs(motion.at(driver.lib, t - t[0])[1]).max()
    assert np.abs(q - wanted).max() <= 2.02 * arm.period * fastest + 1e-9
    tau = done.samples[len(t) // 2].tau
    still = driver.lib.bias_forces(q[len(t) // 2], 0 * q[0], driver.lib.pi0)
    assert tau == pytest.approx(still, abs=0.5)  # without the velocity of the arm
    driver.close()
    ends = {"libfranka": "finished", "ur": "disconnect", "ros2": "destroy_node"}
    assert arm.calls[-1] == ends[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_a_lost_connection_stops_every_arm(opened, monkeypatch, kind: str) -> None:
    """Property: the stop is that of the connection, the samples up to there are kept."""
    monkeypatch.setattr("runtime.campaign.drivers.ros2.WAIT_S", 0.05)
    driver, arm = opened(kind)
    motion = there_and_back(driver.lib)
    arm.dead_at = arm.time - 100.0 + 0.3
    done = driver.stream(motion, guards=usual_guards(driver.lib, driver.rate_hz))
    assert done.stop is not None
    assert done.stop.guard == "connection"
    remedies = {"libfranka": "find the cause of this stop", "ur": "check the", "ros2": "network"}
    assert remedies[kind] in done.stop.sentence
    expected = 0.3 / arm.period
    assert expected - 3 <= len(done.samples) <= expected
    calls = {"libfranka": "stop", "ur": None, "ros2": "cancel"}
    assert calls[kind] is None or calls[kind] in arm.calls


@pytest.mark.parametrize("kind", KINDS)
def test_a_guard_stops_every_arm(opened, kind: str) -> None:
    """Property: a refusal brakes by the means of the maker."""
    driver, arm = opened(kind)

    class Refusing:
        name = "key"

        def refusal(self, sample, reference) -> str | None:
            return "the user pressed the key to stop" if sample.t - 100 > 0.4 else None

    done = driver.stream(there_and_back(driver.lib), guards=[Refusing()])
    assert done.stop is not None
    assert done.stop.guard == "key"
    assert {"libfranka": "stop", "ur": "servoStop", "ros2": "cancel"}[kind] in arm.calls


@pytest.mark.parametrize(
    ("kind", "address", "match"),
    [
        ("libfranka", "1.2.3.4", "no connection to a Franka arm at '1.2.3.4'"),
        ("libfranka", "", "needs the address of the robot; give --driver libfranka:172.16.0.2"),
        ("ur", "1.2.3.4", "no connection to an arm of Universal Robots at '1.2.3.4'"),
        ("ur", "", "needs the address of the robot"),
        ("ros2", "/other", "no action '/other/follow_joint_trajectory' within 5 s"),
    ],
)
def test_arms_that_do_not_answer(opened, kind: str, address: str, match: str) -> None:
    """Property: one sentence."""
    with pytest.raises(SimulationError, match=match):
        opened(kind, address)


def test_a_controller_that_reports_an_error(monkeypatch, pendulum: Library) -> None:
    """Property: refused goals and failed motions are stops of the connection, with the reason."""
    for words, match in (
        ({"accepted": False}, "the controller refused the motion; check its joints"),
        ({"accepted": None}, "the controller did not answer within 5 s; check that it is active"),
        ({"error_code": -4}, "got: -4 tolerance violated"),
    ):
        arm = Arm(pendulum, 0.01)
        for name, module in ros2_server.ros2(arm, **words).items():
            monkeypatch.setitem(sys.modules, name, module)
        driver = DRIVERS["ros2"].open(pendulum, DriverSettings())
        done = driver.stream(there_and_back(pendulum))
        assert done.stop is not None
        assert re.search(match, done.stop.sentence)


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (("--driver", "ros2"), "the driver 'ros2' needs rclpy, which cannot be imported"),
        (("--driver", "libfranka:h"), "install it with: pip install pylibfranka"),
        (
            ("--driver", "ur:h"),
            "an arm of Universal Robots measures currents; give --settings gains=K,K,…",
        ),
        (("--driver", "ur:h", "--settings", "gains=1,2"), "the setting gains needs 7 numbers"),
        (
            ("--driver", "tractor"),
            "there is no driver 'tractor'; choose from virtual, ros2, libfranka, ur",
        ),
        (("--driver", "virtual:x"), "the virtual robot has no address"),
    ],
)
def test_drivers_on_the_command_line(
    command: Command, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], match: str
) -> None:
    """Property: what cannot be opened is one sentence, exit code 2."""
    for name in ("rclpy", "pylibfranka", "rtde_control", "rtde_receive"):
        monkeypatch.setitem(sys.modules, name, None)
    ran = command("campaign", "--target", "v=20mNm", *words)
    assert (ran.code, ran.err.count("Traceback")) == (2, 0)
    assert match in ran.err.replace("\n", " ")


def test_messages_have_the_fields_of_ros() -> None:
    """Oracle: the message definitions of ROS 2 Humble in rosbags."""
    typesys = pytest.importorskip("rosbags.typesys")
    types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).types
    for name, stand_in in (
        ("trajectory_msgs/msg/JointTrajectoryPoint", ros2_server.JointTrajectoryPoint),
        ("trajectory_msgs/msg/JointTrajectory", ros2_server.JointTrajectory),
        ("sensor_msgs/msg/JointState", ros2_server.JointState),
        ("builtin_interfaces/msg/Duration", ros2_server.Duration),
    ):
        known = [one.name for one in fields(types[name]) if one.name != "__msgtype__"]
        assert [one.name for one in fields(stand_in)] == known


@pytest.mark.parametrize("name", ["rtde_control", "rtde_receive", "pylibfranka"])
def test_stand_ins_have_the_signatures_of_the_makers(name: str, fr3: Library) -> None:
    """Oracle: every method of a stand-in takes the arguments of the installed library's."""
    real = pytest.importorskip(name)
    arm = Arm(fr3, 1e-3)
    made = robot_servers.ur_rtde(arm, np.ones(7)) | {"pylibfranka": robot_servers.pylibfranka(arm)}
    for cls, stand_in in vars(made[name]).items():
        if not inspect.isclass(stand_in) or issubclass(stand_in, Exception):
            continue
        for method, function in inspect.getmembers(stand_in, inspect.isfunction):
            text = getattr(getattr(real, cls), method).__doc__ or ""
            (head,) = re.findall(rf"{method}\(self: [\w.]+(.*)\) ->", text)[:1]
            known = re.findall(r", (\w+): ", head)
            assert list(inspect.signature(function).parameters)[1:] == known, (cls, method)
