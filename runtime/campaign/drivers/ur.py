"""Arms of Universal Robots by ur_rtde: positions by `servoJ`, states by RTDE.

The arm measures currents, not torques: τ = K i with the gains K [N·m/A] of its drives, which
`symgen gains` estimates. The torques that the controller reports are of its model, or without
gravity, and identify nothing.
"""

from contextlib import suppress
from typing import Any

import numpy as np

from runtime.campaign.driver import Driver, NoSampleError, Reference, Sample
from runtime.campaign.drivers import DriverKind, DriverSettings, imported, require_address, row_of
from runtime.errors import SimulationError
from runtime.library import Library

NAME = "ur"
LOOKAHEAD = 0.03  # smoothing of `servoJ` [s], the least that it takes
GAIN = 1000.0  # proportional gain of `servoJ`, of 100 to 2000
BRAKE = 5.0  # deceleration of `servoStop` [rad/s²]
_INSTALL = "install it with: pip install ur_rtde"


class UrDriver(Driver):
    """An arm of Universal Robots in remote control, with the gains of its drives."""

    def __init__(self, lib: Library, settings: DriverSettings) -> None:
        address = require_address(settings, NAME, "192.168.0.2")
        if settings.gains is None:
            raise SimulationError(
                "an arm of Universal Robots measures currents; give --settings gains=K,K,… with "
                "one number in N·m/A per joint, which `symgen gains LOG` estimates from a log in A"
            )
        control = imported("rtde_control", NAME, _INSTALL)
        receive = imported("rtde_receive", NAME, _INSTALL)
        self._gains = row_of(settings.gains, lib, "gains")
        try:
            self._receive: Any = receive.RTDEReceiveInterface(address)
            self._control: Any = control.RTDEControlInterface(address)
            step = float(self._control.getStepTime())
        except (RuntimeError, OSError) as error:
            raise SimulationError(
                f"no connection to an arm of Universal Robots at '{address:.60}' ({error}); check "
                "the address, and switch the arm on and to remote control"
            ) from None
        if not step > 0:
            raise SimulationError(
                "expected the time step of the controller, it states none; update ur_rtde"
            )
        super().__init__(lib, 1 / step)
        self._step, self._last = step, -np.inf

    def state(self) -> Sample:
        """Newest sample of the robot at rest."""
        if not self._receive.isConnected():
            raise _lost()
        read, t = self._receive, None
        values: Any = ()
        # Each call reads the newest package; between two equal time stamps they read one package.
        while t != (t := read.getTimestamp()):
            values = read.getActualQ(), read.getActualQd(), read.getActualCurrent()
        names = "positions", "velocities", "currents"
        q, dq, current = (row_of(v, self.lib, k) for v, k in zip(values, names, strict=True))
        return Sample(float(t), self.clock(), q, dq, self._gains * current)

    def exchange(self, reference: Reference) -> Sample:
        """Command one reference for a period and read the state at its end."""
        begin = self._control.initPeriod()
        q = reference.q.tolist()
        try:
            accepted = self._control.servoJ(q, 0.0, 0.0, self._step, LOOKAHEAD, GAIN)
        except RuntimeError as error:  # ur_rtde could not connect again
            raise _lost(f" ({error})") from None
        if not accepted or self._receive.isProtectiveStopped():
            raise NoSampleError("the robot stopped following; see the message on its teach pendant")
        self._control.waitPeriod(begin)
        # The period ends when the state of the next step is there, at most another step later.
        for _ in range(2):
            sample = self.state()
            if sample.t > self._last:
                break
            self._control.waitPeriod(self._control.initPeriod())
        self._last = sample.t
        return sample

    def end(self) -> None:
        """Leave the servo mode at rest."""
        self._control.servoStop(BRAKE)

    def stop(self) -> None:
        """Brake and leave the servo mode."""
        if self._control.isConnected():
            with suppress(RuntimeError):  # the connection is lost while ur_rtde brakes
                self._control.servoStop(BRAKE)

    def close(self) -> None:
        """End the script on the controller and both connections."""
        self._control.stopScript()
        self._control.disconnect()
        self._receive.disconnect()


def _lost(reason: str = "") -> NoSampleError:
    """Fault of a connection that ended during a motion."""
    return NoSampleError(
        f"the connection by RTDE was lost{reason}; check the network, then repeat the command"
    )


UR = DriverKind(
    NAME, "an arm of Universal Robots by ur_rtde, ur:ADDRESS with the setting gains", UrDriver
)
