"""Stand-ins for the libraries of makers: same names and signatures, an arm that follows exactly.

Signatures: pylibfranka 0.21.3, ur_rtde 1.6.5, rclpy and messages of ROS 2 Humble. Time passes as
samples are read. `Arm.dead_at` is the time from which the connection is lost.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from scipy.interpolate import BPoly

from runtime.library import Library


@dataclass
class Arm:
    """An arm that follows every command exactly.

    Attributes:
        lib: the robot.
        period: of its states [s].
        dead_at: time from which nothing arrives [s].
        calls: names of calls that matter, in their order.
    """

    lib: Library
    period: float
    dead_at: float = np.inf
    calls: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.time = 100.0
        self.q = self.lib.home.copy()
        self.dq = 0 * self.q

    def follow(self, q: Sequence[float]) -> None:
        """Move to a position within a period."""
        self.dq = (np.array(q) - self.q) / self.period
        self.q = np.array(q)

    @property
    def tau(self) -> np.ndarray:
        """Torque that holds the arm there."""
        return self.lib.bias_forces(self.q, self.dq, self.lib.pi0)

    def is_dead(self) -> bool:
        return self.time - 100.0 >= self.dead_at


def pylibfranka(arm: Arm) -> ModuleType:
    """`pylibfranka` with one arm."""

    class FrankaException(Exception):
        pass

    class JointPositions:
        def __init__(self, arg0: Sequence[float]) -> None:
            if len(arg0) != 7:
                raise TypeError("JointPositions takes 7 numbers")
            self.q, self.motion_finished = list(arg0), False

    def state() -> SimpleNamespace:
        if arm.is_dead():
            raise FrankaException("libfranka: UDP receive: Timeout")
        clock = arm.time
        return SimpleNamespace(
            q=list(arm.q),
            dq=list(arm.dq),
            tau_J=list(arm.tau),
            time=SimpleNamespace(to_sec=lambda: clock),
        )

    class ActiveControlBase:
        def readOnce(self) -> tuple[Any, Any]:
            arm.time += arm.period
            return state(), SimpleNamespace(to_sec=lambda: arm.period)

        def writeOnce(self, command: JointPositions) -> None:
            arm.follow(command.q)
            if command.motion_finished:
                arm.calls.append("finished")

    class Robot:
        def __init__(self, robot_ip_address: str, realtime_config: object = None) -> None:
            if robot_ip_address != "172.16.0.2":
                raise FrankaException("libfranka: Connection timeout")

        def read_once(self) -> Any:
            return state()

        def start_joint_position_control(self, arg0: str) -> ActiveControlBase:
            arm.calls.append(f"control {arg0}")
            return ActiveControlBase()

        def stop(self) -> None:
            arm.calls.append("stop")

    return _module(
        "pylibfranka",
        FrankaException=FrankaException,
        JointPositions=JointPositions,
        Robot=Robot,
        ControllerMode=SimpleNamespace(JointImpedance="JointImpedance"),
    )


def ur_rtde(arm: Arm, gains: np.ndarray) -> dict[str, ModuleType]:
    """`rtde_control` and `rtde_receive` with one arm, whose currents are τ / K."""

    def connected(hostname: str) -> None:
        if hostname != "192.168.0.2":
            raise RuntimeError("connect: Connection refused")

    class RTDEControlInterface:
        def __init__(
            self,
            hostname: str,
            frequency: float = -1.0,
            flags: int = 1,
            ur_cap_port: int = 50002,
            rt_priority: int = 0,
        ) -> None:
            connected(hostname)

        def getStepTime(self) -> float:
            return arm.period

        def initPeriod(self) -> timedelta:
            return timedelta(seconds=arm.time)

        def waitPeriod(self, arg0: timedelta) -> None:
            arm.time += arm.period

        def servoJ(
            self,
            arg0: list[float],
            arg1: float,
            arg2: float,
            arg3: float,
            arg4: float,
            arg5: float,
        ) -> bool:
            if not (arg3 > 0 and 0.03 <= arg4 <= 0.2 and 100 <= arg5 <= 2000):
                raise ValueError("servoJ: time, lookahead_time or gain out of range")
            arm.follow(arg0)
            return True

        def isConnected(self) -> bool:
            return not arm.is_dead()

        def servoStop(self, a: float = 10.0) -> bool:
            arm.calls.append("servoStop")
            return True

        def stopScript(self) -> None:
            arm.calls.append("stopScript")

        def disconnect(self) -> None:
            arm.calls.append("disconnect")

    class RTDEReceiveInterface:
        def __init__(
            self,
            hostname: str,
            frequency: float = -1.0,
            variables: Sequence[str] = (),
            verbose: bool = False,
            use_upper_range_registers: bool = False,
            rt_priority: int = 0,
        ) -> None:
            connected(hostname)

        def isConnected(self) -> bool:
            return not arm.is_dead()

        def isProtectiveStopped(self) -> bool:
            return False

        def getTimestamp(self) -> float:
            return arm.time

        def getActualQ(self) -> list[float]:
            return list(arm.q)

        def getActualQd(self) -> list[float]:
            return list(arm.dq)

        def getActualCurrent(self) -> list[float]:
            return list(arm.tau / gains)

        def disconnect(self) -> None:
            arm.calls.append("disconnect")

    return {
        "rtde_control": _module("rtde_control", RTDEControlInterface=RTDEControlInterface),
        "rtde_receive": _module("rtde_receive", RTDEReceiveInterface=RTDEReceiveInterface),
    }


@dataclass
class Duration:
    sec: int = 0
    nanosec: int = 0


@dataclass
class JointTrajectoryPoint:
    positions: list[float] = field(default_factory=list)
    velocities: list[float] = field(default_factory=list)
    accelerations: list[float] = field(default_factory=list)
    effort: list[float] = field(default_factory=list)
    time_from_start: Duration = field(default_factory=Duration)


@dataclass
class JointTrajectory:
    header: Any = None
    joint_names: list[str] = field(default_factory=list)
    points: list[JointTrajectoryPoint] = field(default_factory=list)


@dataclass
class JointState:
    header: Any = None
    name: list[str] = field(default_factory=list)
    position: list[float] = field(default_factory=list)
    velocity: list[float] = field(default_factory=list)
    effort: list[float] = field(default_factory=list)


@dataclass
class _Future:
    value: Any

    def done(self) -> bool:
        return True

    def result(self) -> Any:
        return self.value


class FollowJointTrajectory:
    """The action; only the goal is made by clients."""

    @dataclass
    class Goal:
        """Joint trajectory to follow."""

        trajectory: JointTrajectory = field(default_factory=JointTrajectory)


def ros2(arm: Arm, accepted: bool = True, error_code: int = 0) -> dict[str, ModuleType]:
    """Modules of ROS 2 with one arm behind /joint_trajectory_controller.

    The controller joins the points by quintics through position, velocity and acceleration.
    """
    names = [*arm.lib.joint_names[::-1], "gripper"]
    receivers: list[Callable[[JointState], None]] = []
    paths: list[tuple[float, BPoly]] = []

    class Node:
        def create_subscription(
            self, msg_type: type, topic: str, callback: Any, qos_profile: int
        ) -> None:
            if (msg_type, topic) != (JointState, "/joint_states"):
                raise TypeError("no such topic")
            receivers.append(callback)

        def destroy_node(self) -> None:
            arm.calls.append("destroy_node")

    class Handle:
        def __init__(self) -> None:
            self.accepted = accepted

        def get_result_async(self) -> _Future:
            text = "tolerance violated" if error_code else ""
            result = SimpleNamespace(error_code=error_code, error_string=text)
            return _Future(SimpleNamespace(result=result))

        def cancel_goal_async(self) -> _Future:
            arm.calls.append("cancel")
            paths.clear()
            return _Future(None)

    class ActionClient:
        def __init__(self, node: Node, action_type: type, action_name: str) -> None:
            self.name = action_name

        def wait_for_server(self, timeout_sec: float) -> bool:
            return self.name == "/joint_trajectory_controller/follow_joint_trajectory"

        def send_goal_async(self, goal: FollowJointTrajectory.Goal) -> _Future:
            points = goal.trajectory.points
            place = [goal.trajectory.joint_names.index(name) for name in arm.lib.joint_names]
            t = [0.0, *(p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points)]
            zero = np.zeros(len(place))
            states = [[arm.q, zero, zero]]
            states += [
                [np.array(row)[place] for row in (p.positions, p.velocities, p.accelerations)]
                for p in points
            ]
            if accepted:
                paths.append((arm.time, BPoly.from_derivatives(t, states)))
            return _Future(Handle())

    def spin_once(node: Node, timeout_sec: float) -> None:
        arm.time += arm.period
        if arm.is_dead():
            return
        if paths:
            start, path = paths[-1]
            t = min(arm.time - start, path.x[-1])
            arm.q, arm.dq = path(t), path(t, 1)
        sec, nanosec = divmod(round(arm.time * 1e9), 1_000_000_000)
        header = SimpleNamespace(stamp=SimpleNamespace(sec=sec, nanosec=nanosec))
        rows = ([*row[::-1].tolist(), 0.04] for row in (arm.q, arm.dq, arm.tau))
        for receive in receivers:
            receive(JointState(header, names, *rows))

    modules = {
        "rclpy": _module(
            "rclpy",
            ok=lambda: False,
            init=lambda: arm.calls.append("init"),
            create_node=lambda name: Node(),
            spin_once=spin_once,
            spin_until_future_complete=lambda node, future, timeout_sec: None,
        ),
        "rclpy.action": _module("rclpy.action", ActionClient=ActionClient),
        "control_msgs.action": _module(
            "control_msgs.action", FollowJointTrajectory=FollowJointTrajectory
        ),
        "trajectory_msgs.msg": _module(
            "trajectory_msgs.msg", JointTrajectoryPoint=JointTrajectoryPoint
        ),
        "builtin_interfaces.msg": _module("builtin_interfaces.msg", Duration=Duration),
        "sensor_msgs.msg": _module("sensor_msgs.msg", JointState=JointState),
    }
    parents = {name.partition(".")[0] for name in modules} - set(modules)
    return modules | {name: _module(name) for name in parents}


def _module(name: str, **members: Any) -> ModuleType:
    module = ModuleType(name)
    vars(module).update(members)
    return module
