"""What `predict` speaks of: a motion, the noise of its torque, and what is known before."""

from dataclasses import dataclass, replace

import numpy as np

from runtime.cli.predict_tables import torque_noise
from runtime.errors import IdentificationError
from runtime.excitation.search.information import NOISE, information
from runtime.identification.expected_accuracy import (
    Expected,
    Knowledge,
    MotionSamples,
    Noise,
    expected,
    noise_of,
)
from runtime.identification.expected_accuracy.earlier_logs import information_of_logs
from runtime.library import Array, Library
from runtime.recording import read_recording


@dataclass(frozen=True, slots=True)
class Situation:
    """A motion, its noise, and what is known before."""

    lib: Library
    moved: MotionSamples
    noise: Array
    unit: float
    from_residuals: bool
    known: Knowledge

    def expected(self, more: MotionSamples | None = None, seconds: float = 0.0) -> Expected:
        """σ of the motion, and of some more seconds of another one."""
        statistics = self.moved.statistics(self.lib, self.noise)
        if more is not None:
            statistics = statistics.merged(more.statistics(self.lib, self.noise, seconds))
        found = expected(self.lib, statistics, self.known, self.unit, self.moved.columns)
        if self.known.payload_only and found.payload is None:
            raise IdentificationError(
                f"'{self.moved.name}' does not tell all ten parameters of a payload; give a motion "
                "that turns the last link about all axes (excite --payload-only designs one)"
            )
        return found

    def sentence(self) -> str:
        """What is taken for granted."""
        low, high = self.noise.min(), self.noise.max()
        size = f"{low:.3g}" + ("" if low == high else f"–{high:.3g}")
        origin = " (RMS of the log's residuals)" if self.from_residuals else ""
        count = len(self.moved.samples)
        worth = f", worth {count / self.unit:.0f} independent ones" if self.unit > 1 else ""
        earlier = ", earlier logs counted" if self.known.earlier is not None else ""
        beside = ", ".join(self.moved.columns) or "none"
        return (
            f"{self.moved.name}: {self.moved.seconds:.3g} s, {count} samples{worth}; torque noise "
            f"{size} N·m{origin}; friction beside: {beside}{earlier}"
        )

    def facts(self) -> dict[str, object]:
        """The same for JSON files."""
        count = len(self.moved.samples)
        return {
            "robot": self.lib.name,
            "motion": self.moved.name,
            "seconds": self.moved.seconds,
            "rate_hz": self.moved.rate,
            "n_samples": count,
            "n_eff": count / self.unit,
            "torque_noise": self.noise.tolist(),
            "noise_from_residuals": self.from_residuals,
            "friction": list(self.moved.columns),
            "earlier_logs_count": self.known.earlier is not None,
        }


def situation_of(
    lib: Library,
    moved: MotionSamples,
    noise: str | None,
    earlier: list[str] | None,
    payload_only: bool,
) -> Situation:
    """What the options say, and where they say nothing, what the log's residuals do.

    Args:
        lib: the robot.
        moved: the motion.
        noise: of the torque, N·m, as --noise.
        earlier: logs that are recorded already.
        payload_only: only the last link is unknown.

    Raises:
        RuntimeFault: the noise or an earlier log is none.
    """
    given = None if noise is None else information(lib, torque_noise(noise, lib.n_joints)).noise
    own: Noise | None = noise_of(lib, moved)
    known = replace(Knowledge.of(lib), payload_only=payload_only)
    if own is not None:
        known = replace(known, pi=own.pi)
    sigma = given if given is not None else own.sigma if own is not None else None
    if sigma is None:
        sigma = np.full(lib.n_joints, NOISE)
    if earlier:
        logs = [read_recording(log, joints=lib.joint_names) for log in earlier]
        known = replace(known, earlier=information_of_logs(lib, logs, sigma, moved.columns))
    unit = own.inflation if own is not None else 1.0
    return Situation(lib, moved, sigma, unit, given is None and own is not None, known)
