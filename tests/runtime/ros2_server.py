"""Stand-in for ROS 2: rclpy and messages of Humble, an arm behind a trajectory controller."""

from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from scipy.interpolate import BPoly

from tests.runtime.robot_servers import Arm, module_of


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


def ros2(arm: Arm, accepted: bool | None = True, error_code: int = 0) -> dict[str, ModuleType]:
    """Modules of ROS 2 with one arm behind /joint_trajectory_controller.

    A controller whose `accepted` is None does not answer. It joins the points by quintics through
    position, velocity and acceleration.
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
            return _Future(Handle() if accepted is not None else None)

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
        "rclpy": module_of(
            "rclpy",
            ok=lambda: False,
            init=lambda: arm.calls.append("init"),
            create_node=lambda name: Node(),
            spin_once=spin_once,
            spin_until_future_complete=lambda node, future, timeout_sec: None,
        ),
        "rclpy.action": module_of("rclpy.action", ActionClient=ActionClient),
        "control_msgs.action": module_of(
            "control_msgs.action", FollowJointTrajectory=FollowJointTrajectory
        ),
        "trajectory_msgs.msg": module_of(
            "trajectory_msgs.msg", JointTrajectoryPoint=JointTrajectoryPoint
        ),
        "builtin_interfaces.msg": module_of("builtin_interfaces.msg", Duration=Duration),
        "sensor_msgs.msg": module_of("sensor_msgs.msg", JointState=JointState),
    }
    parents = {name.partition(".")[0] for name in modules} - set(modules)
    return modules | {name: module_of(name) for name in parents}
