"""Any arm of ROS 2 with a joint trajectory controller: FollowJointTrajectory and JointState.

The whole motion is one goal of the action `CONTROLLER/follow_joint_trajectory`, with points at 25
Hz that the controller joins by quintics. Samples are the messages of /joint_states; each is
compared with the motion at the time of its stamp, counted from the first message after the goal
was accepted: up to one period after the controller began. A stop cancels the goal: the controller
holds the arm.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from runtime.campaign.driver import Driver, DriverMotion, NoSampleError, Reference, Sample
from runtime.campaign.drivers import DriverKind, DriverSettings, imported
from runtime.errors import SimulationError
from runtime.excitation.motion_export import ROS_RATE
from runtime.library import Library

NAME = "ros2"
CONTROLLER = "/joint_trajectory_controller"
STATES = "/joint_states"  # topic of the states
WAIT_S = 5.0  # longest time to find the controller and its states
COUNT = 20  # number of messages from which their rate follows
LATE = 3.0  # periods after which a message is missing
_SOURCE = "source the setup file of a ROS 2 installation"


class RosDriver(Driver):
    """An arm behind a joint trajectory controller, whose name is the address."""

    def __init__(self, lib: Library, settings: DriverSettings) -> None:
        self._ros = imported("rclpy", NAME, _SOURCE)
        self._action = imported("control_msgs.action", NAME, _SOURCE).FollowJointTrajectory
        self._point = imported("trajectory_msgs.msg", NAME, _SOURCE).JointTrajectoryPoint
        self._span = imported("builtin_interfaces.msg", NAME, _SOURCE).Duration
        state = imported("sensor_msgs.msg", NAME, _SOURCE).JointState
        client = imported("rclpy.action", NAME, _SOURCE).ActionClient
        super().__init__(lib, 0.0)
        if not self._ros.ok():
            self._ros.init()
        self._node = self._ros.create_node("symgen")
        self._inbox: list[Any] = []
        self._node.create_subscription(state, STATES, self._inbox.append, 100)
        name = f"{settings.address or CONTROLLER}/follow_joint_trajectory"
        self._client = client(self._node, self._action, name)
        self._goal: Any = None
        self._started, self._newest = 0.0, -np.inf
        if not self._client.wait_for_server(timeout_sec=WAIT_S):
            raise SimulationError(
                f"no action '{name}' within {WAIT_S:g} s; start the controller, or name another "
                f"with --driver {NAME}:CONTROLLER"
            )
        stamps = [self._next(WAIT_S).t for _ in range(COUNT)]
        self.rate_hz = 1 / float(np.median(np.diff(stamps)))

    def state(self) -> Sample:
        """Newest sample of the robot at rest."""
        self._inbox.clear()
        return self._next(WAIT_S)

    def begin(self, motion: DriverMotion) -> None:
        """Send the motion as one goal."""
        goal = self._action.Goal()
        goal.trajectory.joint_names = list(self.lib.joint_names)
        count = max(1, int(np.ceil(motion.duration * ROS_RATE)))
        nanoseconds = np.round(np.linspace(0.0, motion.duration, count + 1) * 1e9).astype(int)
        # The first point is the place where the arm stands, which controllers need not repeat.
        states = motion.at(self.lib, nanoseconds[1:] * 1e-9)[:3]
        for stamp, *row in zip(nanoseconds[1:].tolist(), *states, strict=True):
            sec, nanosec = divmod(stamp, 1_000_000_000)
            q, dq, ddq = (part.tolist() for part in row)
            span = self._span(sec=sec, nanosec=nanosec)
            goal.trajectory.points.append(
                self._point(positions=q, velocities=dq, accelerations=ddq, time_from_start=span)
            )
        sent = self._client.send_goal_async(goal)
        self._ros.spin_until_future_complete(self._node, sent, timeout_sec=WAIT_S)
        handle = sent.result() if sent.done() else None
        if handle is None:
            raise NoSampleError(
                f"the controller did not answer within {WAIT_S:g} s; check that it is active"
            )
        if not handle.accepted:
            raise NoSampleError(
                "the controller refused the motion; check its joints, limits and state"
            )
        self._goal = handle
        self._inbox.clear()
        self._started = self._newest = self._next(WAIT_S).t

    def references(self, motion: DriverMotion) -> Iterator[Reference]:
        """References at the times of the messages to come, up to the end of the motion."""
        while True:
            t = self._newest + 1 / self.rate_hz - self._started
            if t > motion.duration:
                return
            q, dq, ddq, _ = motion.at(self.lib, np.array([t]))
            yield Reference(q[0], dq[0], ddq[0])

    def exchange(self, reference: Reference) -> Sample:
        """Wait for the next message; the goal commands the references."""
        sample = self._next(LATE / self.rate_hz)
        self._newest = sample.t
        return sample

    def end(self) -> None:
        """Wait for the result of the goal."""
        waited = self._goal.get_result_async()
        self._ros.spin_until_future_complete(self._node, waited, timeout_sec=WAIT_S)
        result = waited.result().result if waited.done() else None
        self._goal = None
        if result is None or result.error_code:
            text = "none came" if result is None else f"{result.error_code} {result.error_string}"
            raise NoSampleError(f"expected a result of the motion without an error, got: {text}")

    def stop(self) -> None:
        """Cancel the goal: the controller holds the present position."""
        if self._goal is not None:
            cancelled = self._goal.cancel_goal_async()
            self._goal = None
            self._ros.spin_until_future_complete(self._node, cancelled, timeout_sec=WAIT_S)

    def close(self) -> None:
        """Remove the node."""
        self._node.destroy_node()

    def _next(self, seconds: float) -> Sample:
        """Oldest message that was not read yet, with all joints."""
        last = self.clock() + seconds
        while not self._inbox:
            left = last - self.clock()
            if left <= 0:
                raise NoSampleError(
                    f"expected a message of {STATES} within {seconds:.3g} s, got none; check "
                    "the network and that the joint state broadcaster is active"
                )
            self._ros.spin_once(self._node, timeout_sec=left)
        return self._sample(self._inbox.pop(0))

    def _sample(self, message: Any) -> Sample:
        missing = [name for name in self.lib.joint_names if name not in message.name]
        parts = message.position, message.velocity, message.effort
        if missing or any(len(part) != len(message.name) for part in parts):
            whole = "position, velocity and effort of each joint"
            what = f"joint {missing[0]}" if missing else whole
            raise SimulationError(
                f"expected {what} in the messages of {STATES}; give the --robot that is connected"
            )
        place = [list(message.name).index(name) for name in self.lib.joint_names]
        q, dq, tau = (np.array(part, dtype=float)[place] for part in parts)
        stamp = message.header.stamp
        return Sample(stamp.sec + 1e-9 * stamp.nanosec, self.clock(), q, dq, tau)


ROS2 = DriverKind(NAME, "a joint trajectory controller of ROS 2, ros2:CONTROLLER", RosDriver)
