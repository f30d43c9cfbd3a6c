"""Drivers: how a motion reaches a robot and its samples come back, under guards.

The loop is written here once; an adapter of a robot provides `state`, `exchange` and `stop`, and
`begin` and `end` where its interface needs them. The robot is stopped at the first sample that a
guard refuses, where no sample arrives, and on any error, Ctrl-C included; the samples up to there
are kept.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from runtime.errors import SimulationError
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import JoinedMotion, sample_times
from runtime.library import Array, Library
from runtime.recording import Recording

START = 0.05
"""Largest distance from the start of a motion at which it begins [rad, m]: friction holds an arm
without integral action some hundredths away."""
DriverMotion = Trajectory | JoinedMotion


@dataclass(frozen=True, slots=True)
class Sample:
    """One sample of a robot."""

    t: float  # clock of the robot [s]
    arrived: float  # clock of the driver when the sample came [s]
    q: Array  # q, dq, tau: (n,) measured positions, velocities, torques [rad, m; N·m, N]
    dq: Array
    tau: Array


@dataclass(frozen=True, slots=True)
class Reference:
    """Commanded motion before a sample: q_d, dq_d, ddq_d, (n,) each."""

    q: Array
    dq: Array
    ddq: Array


@dataclass(frozen=True, slots=True)
class Stop:
    """Why a motion ended early."""

    guard: str  # name of the guard, "connection" or "interrupt"
    sentence: str  # what was expected and what came
    seconds: float  # time since the start of the motion, by the clock of the driver [s]


class Guard(Protocol):
    """A condition that every sample must fulfil."""

    name: str

    def refusal(self, sample: Sample, reference: Reference) -> str | None:
        """Sentence on why the motion must stop; None lets it go on.

        Args:
            sample: newest sample.
            reference: commanded before it.

        Returns:
            The sentence, or None.
        """


class NoSampleError(SimulationError):
    """No sample arrived in time."""


@dataclass(slots=True)
class Streamed:
    """Samples of one motion, and why it ended early."""

    samples: list[Sample] = field(default_factory=list)  # in the order of arrival
    stop: Stop | None = None  # None for a motion that was completed

    def recording(self, lib: Library, name: str) -> Recording:
        """The samples as a log."""
        if not self.samples:
            raise SimulationError(
                "the robot sent no sample; check its connection, then repeat the command"
            )
        t = np.array([each.t for each in self.samples])
        q, dq, tau = (np.array([getattr(s, k) for s in self.samples]) for k in ("q", "dq", "tau"))
        history = [f"Recorded {len(t)} samples by a driver."]
        if not (np.diff(t) > 0).all():  # a log needs time that increases
            t = np.array([each.arrived for each in self.samples])
            history.append("Time is that of arrival, since the clock of the robot went back.")
        if self.stop is not None:
            history.append(f"Stopped by {self.stop.guard}: {self.stop.sentence}.")
        # To the nanosecond: what is beyond is rounding, which depends on when the driver began.
        t, names = np.round(t - t[0], 9), lib.joint_names
        return Recording(t, q, dq, None, tau, name=name, joint_names=names, history=tuple(history))


class Driver(ABC):
    """A robot that follows motions.

    Attributes:
        lib: library of the robot.
        rate_hz: rate of commands and samples [Hz].
    """

    def __init__(self, lib: Library, rate_hz: float) -> None:
        self.lib = lib
        self.rate_hz = rate_hz

    def clock(self) -> float:
        """Clock of the driver [s], which never goes back; by default that of this computer."""
        return time.monotonic()

    @abstractmethod
    def state(self) -> Sample:
        """Newest sample of the robot at rest; `NoSampleError` where none arrives in time."""

    @abstractmethod
    def exchange(self, reference: Reference) -> Sample:
        """Command the reference of this period and return the next sample, else `NoSampleError`."""

    @abstractmethod
    def stop(self) -> None:
        """Brake to rest and hold; called once, also where the connection is lost."""

    def begin(self, motion: DriverMotion) -> None:  # noqa: B027
        """Prepare for a motion from where it stands, else `NoSampleError`; by default nothing."""

    def end(self) -> None:  # noqa: B027
        """Finish a motion that was completed; by default nothing."""

    def close(self) -> None:  # noqa: B027
        """Close the connection; by default nothing."""

    def references(self, motion: DriverMotion) -> Iterator[Reference]:
        """References of a motion in their order, one per period, up to its end."""
        q, dq, ddq, _ = motion.at(self.lib, sample_times(motion.duration, self.rate_hz))
        for row in zip(q, dq, ddq, strict=True):
            yield Reference(*row)

    def stream(
        self,
        trajectory: DriverMotion,
        on_sample: Callable[[Sample], None] = lambda _: None,
        guards: Sequence[Guard] = (),
    ) -> Streamed:
        """Let the robot follow a motion.

        Args:
            trajectory: from rest to rest, one or several in a row.
            on_sample: called with every sample before the guards.
            guards: asked in this order; the first refusal stops the robot.

        Returns:
            Samples, and why the motion ended early.

        Raises:
            SimulationError: the robot is not at the start of the motion.
        """
        self._require_start(trajectory.at(self.lib, np.zeros(1))[0][0])
        done, start, is_complete = Streamed(), self.clock(), False

        def stopped(guard: str, sentence: str) -> Stop:
            return Stop(guard, sentence, self.clock() - start)

        try:
            self.begin(trajectory)
            for reference in self.references(trajectory):
                sample = self.exchange(reference)
                done.samples.append(sample)
                on_sample(sample)
                for guard in guards:
                    sentence = guard.refusal(sample, reference)
                    if sentence is not None:
                        done.stop = stopped(guard.name, sentence)
                        return done
            self.end()
            is_complete = True
        except NoSampleError as error:
            done.stop = stopped("connection", str(error))
        except KeyboardInterrupt:
            done.stop = stopped("interrupt", "the user pressed Ctrl-C")
        finally:
            if not is_complete:
                self.stop()
        return done

    def _require_start(self, start: Array) -> None:
        away = np.abs(self.state().q - start)
        if not away.max() <= START:
            j = int(np.argmax(np.nan_to_num(away, nan=np.inf)))
            raise SimulationError(
                f"expected the robot at the start of the motion, and {self.lib.joint_names[j]} is "
                f"{away[j]:.3g} rad or m away; move it there first"
            )
