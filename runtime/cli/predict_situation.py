"""Input of `predict`: a motion, the noise of its torque, and the knowledge before it."""

from dataclasses import dataclass, replace

import numpy as np

from runtime.cli.planned_noise import TorqueNoise, planned_noise
from runtime.errors import IdentificationError
from runtime.excitation.search.information import NOISE
from runtime.identification.expected_accuracy.expected import (
    Expected,
    Knowledge,
    expected,
    gain_slopes,
    torque_of_gains,
)
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    Noise,
    information_of_logs,
    noise_of,
)
from runtime.library import Array, Library
from runtime.library.torque_units import common_unit, torque_units
from runtime.recording import read_recording

_MOMENTUM = "; rows of momentum, which show more than the rows of energy that the recipe states"


@dataclass(frozen=True, slots=True)
class Situation:
    """A motion or log, the noise of its torque, and the knowledge before it.

    Attributes:
        lib: library of the robot.
        moved: samples of the motion.
        noise: σ of the torque, (n,) N·m.
        unit: samples per independent sample, at least 1.
        from_residuals: whether `noise` is from the residuals of the motion itself.
        planned: noise that was given, or that of a planned motion.
        known: prior and earlier logs.
    """

    lib: Library
    moved: MotionSamples
    noise: Array
    unit: float
    from_residuals: bool
    planned: TorqueNoise
    known: Knowledge

    def expected(self, more: MotionSamples | None = None, seconds: float = 0.0) -> Expected:
        """Expected accuracy of the motion, and of some seconds of another motion after it."""
        statistics = self.moved.statistics(self.lib, self.noise)
        if more is not None:
            statistics = statistics.merged(more.statistics(self.lib, self.noise, seconds))
        sigmas = expected(self.lib, statistics, self.known, self.unit, self.moved.columns)
        if self.known.payload_only and sigmas.payload is None:
            raise IdentificationError(
                f"'{self.moved.name}' does not determine all ten parameters of a payload; give a "
                "motion that turns the last link about all axes (excite --payload-only designs one)"
            )
        return sigmas

    def with_gains(self, torque: Array, gain_error: float, unseen: Array) -> Array:
        """σ of the torque of motions that are not in the log, errors of the torque gains included.

        torque (n,), unseen (n, n_b, n_b) → (n,).
        """
        lib = self.lib
        slopes = gain_slopes(lib, self.moved, self.noise, self.known, self.unit)
        return np.hypot(torque, torque_of_gains(lib, slopes, gain_error, unseen))

    def sentence(self) -> str:
        """Sentence on duration, samples, noise and unknowns."""
        low, high = self.noise.min(), self.noise.max()
        size = f"{low:.3g}" + ("" if low == high else f"–{high:.3g}")
        origin = " (RMS of the log's residuals)" if self.from_residuals else ""
        if self.planned.log is not None and not self.from_residuals:
            origin = f" (RMS of the residuals of {self.planned.log})"
        count = len(self.moved.samples)
        effective = (
            f", as good as {count / self.unit:.0f} independent ones" if self.unit > 1 else ""
        )
        earlier = ", earlier logs counted" if self.known.earlier is not None else ""
        beside = ", ".join(self.moved.columns) or "none"
        rows = _MOMENTUM if self.moved.replaces_power else ""
        unit = common_unit(torque_units(self.lib.manifest))
        return (
            f"{self.moved.name}: {self.moved.seconds:.3g} s, {count} samples{effective}; torque "
            f"noise {size} {unit}{origin}; friction columns: {beside}{earlier}{rows}"
        )

    def facts(self) -> dict[str, object]:
        """The same as JSON-ready values."""
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
            "noise_log": None if self.from_residuals else self.planned.log,
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
    """Situation of the options; the noise is by default that of the log's residuals."""
    given = None if noise is None else planned_noise(lib, noise, moved.columns)
    planned = given or TorqueNoise(np.full(lib.n_joints, NOISE))
    residual_noise: Noise | None = noise_of(lib, moved)
    known = replace(Knowledge.of(lib), payload_only=payload_only)
    if residual_noise is not None:
        known = replace(known, pi=residual_noise.pi, error=residual_noise.error)
    from_residuals = given is None and residual_noise is not None
    sigma = residual_noise.sigma if from_residuals and residual_noise is not None else planned.sigma
    if earlier:
        logs = [read_recording(log, joints=lib.joint_names) for log in earlier]
        known = replace(known, earlier=information_of_logs(lib, logs, sigma, moved.columns))
    unit = planned.rows_per_independent(moved.rate)
    if residual_noise is not None and planned.log is None:
        unit = residual_noise.inflation
    return Situation(lib, moved, sigma, unit, from_residuals, planned, known)
