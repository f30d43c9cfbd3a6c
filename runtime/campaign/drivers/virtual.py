"""The virtual robot as a driver: plant, friction, sensors, drive and controller.

The same robot as `runtime.simulation.record` for the same `truth_seed`; time passes as the samples
do. `PlantedFault` is what goes wrong at an instant: a stuck joint, a collision, a dead connection,
a jump of the clock.
"""

from collections import deque
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from runtime.campaign.driver import Driver, DriverMotion, NoSampleError, Reference, Sample
from runtime.campaign.drivers import DriverKind, DriverSettings
from runtime.errors import SimulationError
from runtime.library import Array, Library
from runtime.simulation.plant_engine import plant_engine
from runtime.simulation.settings import VirtualRobotSettings, settings_of
from runtime.simulation.virtual_robot import (
    Encoders,
    SimulatedFriction,
    calibration,
    measured_torque,
    perturbed,
)

FAULTS = ("stuck", "collision", "dead", "clock")
TIMEOUT = 0.003  # time after which a missing sample is an error [s]
_STUCK = 1e7  # damping of a stuck joint [N·m·s/rad, N·s/m]
_BRAKE_S = 0.5
_NOISE_ROWS = 4096
_SHOWN = 32  # positions of a motion that its noise is seeded by


@dataclass(frozen=True, slots=True)
class PlantedFault:
    """A fault at an instant of a motion."""

    kind: str  # of `FAULTS`
    at: float  # time since the start of the stream [s]
    joint: int = 0  # index of the stuck or pushed joint
    size: float = 10.0  # torque of the collision [N·m, N], or jump of the clock [s]

    def __post_init__(self) -> None:
        if self.kind not in FAULTS:
            raise SimulationError(
                f"expected a fault of {', '.join(FAULTS)}, got {self.kind!r:.40}; correct it"
            )


class VirtualDriver(Driver):
    """A simulated robot, with seeds of its noise and of itself as in `runtime.simulation.record`.

    `held` are parameters added to those of the links, such as a payload's, (10 n,).
    """

    def __init__(
        self,
        lib: Library,
        settings: VirtualRobotSettings | None = None,
        *,
        seed: int = 0,
        truth_seed: int = 0,
        fault: PlantedFault | None = None,
        held: Array | None = None,
    ) -> None:
        self._settings = settings or settings_of(lib)
        s = self._settings
        super().__init__(lib, s.rate_hz)
        of_robot = np.random.SeedSequence(truth_seed).spawn(2)
        self.pi = perturbed(lib, lib.pi0, s.spread, np.random.default_rng(of_robot[0]))
        if held is not None:
            self.pi = self.pi + held
        self._calibration = calibration(s.sensors, np.random.default_rng(of_robot[1]))
        self._seed = seed
        self._rng = np.random.default_rng(np.random.SeedSequence([seed, 2]))
        self._plant = plant_engine(lib, self.pi, s.rotor, s.step_s)
        self._friction = self._new_friction()
        self._substeps = round(1 / (s.rate_hz * s.step_s))
        self._effort = lib.limits()["effort"]
        self._fault, self._time, self._ticks, self._start = fault, 0.0, 0, np.inf
        self._link = np.zeros(lib.n_joints)
        self.place(lib.home)

    def clock(self) -> float:
        """Simulated time [s]."""
        return self._time

    def place(self, q: Array) -> None:
        """Put the robot at rest at a position: q (n,) [rad, m]."""
        plant = self._plant
        plant.q[:], plant.dq[:] = plant.sorted(np.asarray(q, dtype=float)), 0.0
        self._start, self._ticks = np.inf, 0
        jitter = self._rng.normal(size=(_NOISE_ROWS, self.lib.n_joints))
        sensors = self._settings.sensors
        noise = plant.sorted(sensors.position_noise * jitter)
        self._encoders = Encoders(sensors, noise, 1 / self.rate_hz, plant.places)
        self._link = self._plant.sorted(
            self.lib.bias_forces(q, np.zeros(self.lib.n_joints), self.pi) + self.lib.known_torque(q)
        )
        steps = round(self._settings.delay_s / self._settings.step_s)
        # Until the first torque arrives the brakes hold what that torque will be.
        self._commands: deque[Array] = deque([self._link] * (steps + 1), maxlen=steps + 1)
        self._now = self._read()

    def state(self) -> Sample:
        """Newest sample."""
        return self._sample(*self._now)

    def begin(self, motion: DriverMotion) -> None:
        """Start a motion at rest, with noise of its own: a log does not depend on earlier ones."""
        shown = motion.at(self.lib, np.linspace(0.0, motion.duration, _SHOWN))[0]
        digest = crc32(np.ascontiguousarray(shown).tobytes(), round(1e6 * motion.duration))
        self._rng = np.random.default_rng(np.random.SeedSequence([self._seed, 2, digest]))
        self._friction = self._new_friction()
        self.place(shown[0])

    def exchange(self, reference: Reference) -> Sample:
        """Let the controller follow one reference for a period."""
        if self._start == np.inf:
            self._start = self._time
        if self._has("dead"):
            self._time += TIMEOUT
            raise NoSampleError(f"expected a sample within {TIMEOUT:g} s, got none")
        self._advance(reference)
        return self._sample(*self._now)

    def stop(self) -> None:
        """Hold the present position by the controller until the arm is at rest."""
        here = self.position
        still = np.zeros(self.lib.n_joints)
        for _ in range(round(_BRAKE_S * self.rate_hz)):
            self._advance(Reference(here, still, still))

    @property
    def position(self) -> Array:
        """True position, (n,) [rad, m]."""
        return self._plant.restored(np.array(self._plant.q))

    @property
    def gains(self) -> Array:
        """True gains of the torque sensors, (n,)."""
        return self._calibration.gain

    @property
    def velocity(self) -> Array:
        """True velocity, (n,) [rad/s, m/s]."""
        return self._plant.restored(np.array(self._plant.dq))

    def _new_friction(self) -> SimulatedFriction:
        settings = self._settings
        return SimulatedFriction(settings.friction, settings.step_s, self._plant.places)

    def _read(self) -> tuple[Array, Array]:
        plant = self._plant
        # The rows of noise are used again after four seconds; they are far from correlated.
        seen = self._encoders.read(self._ticks % _NOISE_ROWS, np.array(plant.q), plant.dq)
        self._ticks += 1
        q, dq = (plant.restored(np.array(part)) for part in seen)
        return q, dq

    def _advance(self, reference: Reference) -> None:
        """Computed torque with the bodies of the URDF for one period, and the state at its end."""
        s, lib, plant, (q, dq) = self._settings, self.lib, self._plant, self._now
        u = reference.ddq + s.damping * (reference.dq - dq) + s.stiffness * (reference.q - q)
        tau = lib.inverse_dynamics(q, dq, u, lib.pi0) + s.rotor * u + lib.known_torque(q)
        command = plant.sorted(np.clip(tau, -self._effort, self._effort))
        now_q, now_dq, h = plant.q, plant.dq, plant.step_s
        rotor = plant.sorted(s.rotor)
        joint = -1 if self._fault is None else self._fault.joint
        at = plant.sorted(1.0 * (np.arange(lib.n_joints) == joint))  # of a fault
        is_stuck = self._has("stuck")
        push = at * self._fault.size if self._fault and self._has("collision") else 0.0
        link = self._link
        for j in range(self._substeps):
            self._commands.append(command)
            applied = self._commands[0]
            f, slope = self._friction.advance(now_q, now_dq, self._link)
            plant.damping[:] = np.where(is_stuck * at > 0, _STUCK, slope)
            plant.applied[:] = applied - f + slope * now_dq + push
            before = np.array(now_dq)
            plant.advance()
            if j == 0:
                link = applied - rotor * (now_dq - before) / h
        self._link = link
        self._time += 1 / self.rate_hz
        if not np.isfinite(now_q).all():
            raise SimulationError("the virtual robot diverged; lower the gains of its controller")
        self._now = self._read()

    def _sample(self, q: Array, dq: Array) -> Sample:
        sensors = self._settings.sensors
        link = self._plant.restored(self._link)
        tau = measured_torque(link[None], sensors, self._calibration, self._rng)[0]
        jump = self._fault.size if self._fault is not None and self._has("clock") else 0.0
        return Sample(self._time + jump, self._time, q, dq, tau)

    def _has(self, kind: str) -> bool:
        fault = self._fault
        since = self._time - self._start
        return fault is not None and fault.kind == kind and since >= fault.at - 1e-9


def _open(lib: Library, settings: DriverSettings) -> Driver:
    if settings.address:
        raise SimulationError(
            f"the virtual robot has no address, got '{settings.address:.40}'; give --driver virtual"
        )
    return VirtualDriver(lib, seed=settings.seed, truth_seed=settings.truth_seed)


VIRTUAL = DriverKind("virtual", "the virtual robot, the default", _open)
