"""Franka arms by libfranka, through pylibfranka of the maker, at 1 kHz.

Positions are commanded to the joint impedance controller; τ is the measured torque of the joints
`tau_J`, with gravity. libfranka ends a motion by itself where commands do not arrive in time.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from runtime.campaign.driver import Driver, DriverMotion, NoSampleError, Reference, Sample
from runtime.campaign.drivers import DriverKind, DriverSettings, imported, require_address, row_of
from runtime.errors import SimulationError
from runtime.library import Library

RATE_HZ = 1000.0
NAME = "libfranka"
_READY = "release the brakes and activate FCI in Desk, then repeat the command"
_CLEARED = "find the cause of this stop and clear it in Desk before you repeat the command"


class FrankaDriver(Driver):
    """A Franka arm; the address is that of its control unit."""

    def __init__(self, lib: Library, settings: DriverSettings) -> None:
        super().__init__(lib, RATE_HZ)
        address = require_address(settings, NAME, "172.16.0.2")
        self._franka = imported("pylibfranka", NAME, "install it with: pip install pylibfranka")
        self._control: Any = None
        self._last = Reference(lib.home, 0 * lib.home, 0 * lib.home)
        try:
            self._robot = self._franka.Robot(address)
        except self._franka.FrankaException as error:
            raise SimulationError(
                f"no connection to a Franka arm at '{address:.60}' ({error}); check the address "
                "and that FCI is activated"
            ) from None

    def state(self) -> Sample:
        """Newest sample of the robot at rest."""
        with self._expecting("a state of the robot", _READY):
            return self._sample(self._robot.read_once())

    def begin(self, motion: DriverMotion) -> None:
        """Start the control of joint positions."""
        mode = self._franka.ControllerMode.JointImpedance
        with self._expecting("control of the joints", _READY):
            self._control = self._robot.start_joint_position_control(mode)

    def exchange(self, reference: Reference) -> Sample:
        """Wait for the state of this millisecond and command the reference."""
        self._last = reference
        return self._exchanged(self._franka.JointPositions(reference.q.tolist()))

    def end(self) -> None:
        """Tell libfranka that the motion is finished."""
        command = self._franka.JointPositions(self._last.q.tolist())
        command.motion_finished = True
        self._exchanged(command)
        self._control = None

    def stop(self) -> None:
        """Stop the motion by the controller of the maker, which brakes and holds."""
        self._control = None
        try:
            self._robot.stop()
        except self._franka.FrankaException:
            return  # The connection is lost: the control unit has stopped the arm itself.

    def _exchanged(self, command: Any) -> Sample:
        with self._expecting("the next state", _CLEARED):
            state, _ = self._control.readOnce()
            self._control.writeOnce(command)
        return self._sample(state)

    @contextmanager
    def _expecting(self, what: str, remedy: str) -> Iterator[None]:
        try:
            yield
        except self._franka.FrankaException as error:
            raise NoSampleError(f"expected {what}, libfranka says: {error}; {remedy}") from None

    def _sample(self, state: Any) -> Sample:
        q, dq, tau = (row_of(getattr(state, k), self.lib, k) for k in ("q", "dq", "tau_J"))
        return Sample(state.time.to_sec(), self.clock(), q, dq, tau)


LIBFRANKA = DriverKind(NAME, "a Franka arm by pylibfranka, libfranka:ADDRESS", FrankaDriver)
