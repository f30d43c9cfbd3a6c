"""Stand-ins for the libraries of makers: same names and signatures, an arm that follows exactly.

Signatures: pylibfranka 0.21.3 and ur_rtde 1.6.5; ros2_server.py has ROS 2. Time passes as samples
are read. `Arm.dead_at` is the time from which the connection is lost.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

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

    return module_of(
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
            self, arg0: list[float], arg1: float, arg2: float, arg3: float, arg4: float, arg5: float
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
        "rtde_control": module_of("rtde_control", RTDEControlInterface=RTDEControlInterface),
        "rtde_receive": module_of("rtde_receive", RTDEReceiveInterface=RTDEReceiveInterface),
    }


def module_of(name: str, **members: Any) -> ModuleType:
    """A module with these members."""
    module = ModuleType(name)
    vars(module).update(members)
    return module
