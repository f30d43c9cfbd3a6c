"""Estimate of the drives of a robot: delay, encoder bias, armature and friction of every joint."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.identification.result_record import Delay, DrivePart, DriveValues, plain
from runtime.library import Array

COLUMNS = {
    "armature": ("rotor",),
    "viscous": ("viscous",),
    "coulomb": ("coulomb", "dahl"),
    "offset": ("offset",),
}
"""Key of a drive in result.json → friction column; one of them is fitted. Both columns of dry
friction are ±1 in steady motion."""
BIAS_PRIOR = 0.02
"""Standard deviation of the prior of an encoder bias [rad, m]: the residual of a calibration by
hand, a degree."""
STROKE_PRIOR = 0.5  # of the prior of ln z_c of a joint about that of all joints
DETERMINED = 0.5  # σ of an encoder bias over that of its prior below which a motion is informative


def places_of(columns: tuple[str, ...]) -> dict[str, int]:
    """Key of a drive → place of its column, where it is fitted."""
    return {
        key: columns.index(name)
        for key, names in COLUMNS.items()
        for name in names
        if name in columns
    }


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """Quantities of the drives that are estimated beside the parameters."""

    delay: bool = False  # whether a delay is estimated
    per_joint: bool = False  # one delay per joint instead of one for the log
    bias: bool = False  # whether the encoder biases are estimated
    strokes: bool = False  # whether the strokes of friction with a memory are estimated


@dataclass(frozen=True, slots=True, eq=False)
class DriveFit:
    """Drives of a robot with standard deviations; NaN where a value is not determined."""

    delay: Array  # d, (1,) for the log or (n,) per joint [s]; empty where it was not estimated
    delay_sigma: Array  # of the same shape [s]
    bias: Array  # b of q_true = q + b, (n,) [rad, m]; NaN where it was not estimated
    bias_sigma: Array  # (n,) [rad, m]

    @classmethod
    def unknown(cls, joints: int) -> "DriveFit":
        """Neither delay nor biases."""
        gaps = np.full(joints, np.nan)
        return cls(np.zeros(0), np.zeros(0), gaps, gaps)

    @classmethod
    def of_all(cls, logs: "Sequence[DriveFit]") -> "DriveFit":
        """The delay of a single log, and the biases by all of them."""
        known, prior = np.array([each.bias_sigma**-2.0 for each in logs]), BIAS_PRIOR**-2.0
        # The prior counts once; the σ of a log whose blocks scatter may exceed that of the prior.
        precision = prior + np.maximum(known - prior, 0.0).sum(axis=0)
        mean = np.sum([each.bias for each in logs] * known, axis=0) / precision
        first = logs[0] if len(logs) == 1 else cls.unknown(len(mean))
        return cls(first.delay, first.delay_sigma, mean, precision**-0.5)

    @property
    def sentence(self) -> str:
        """The delay in words."""
        value, sigma = 1e3 * self.delay, 1e3 * self.delay_sigma
        if not value.size:
            return "the log does not determine a delay, and none was taken; record a faster motion"
        if len(value) > 1:
            return f"delays of the torques of the joints {', '.join(f'{x:.1f}' for x in value)} ms"
        return f"delay of the torque {value[0]:.2f} ± {sigma[0]:.2g} ms"

    def verdicts(self) -> tuple[str, ...]:
        """Per joint: whether gravity and motion determine the encoder bias."""
        return tuple(
            "not estimated"
            if not np.isfinite(sigma)
            else "identified"
            if sigma < DETERMINED * BIAS_PRIOR
            else "not identifiable from this motion"
            for sigma in self.bias_sigma
        )

    def delay_parts(self) -> Delay | tuple[Delay, ...] | None:
        """`delay_s` of result.json: one delay, one per joint, or None."""
        each = tuple(
            Delay(value=plain(d), sigma=plain(s))
            for d, s in zip(self.delay, self.delay_sigma, strict=True)
        )
        return each[0] if len(each) == 1 else each or None

    def delay_of_log(self, name: str) -> Delay:
        """The delay as that of one of several logs."""
        known = self.delay.tolist(), self.delay_sigma.tolist()
        value, sigma = (each if len(each) > 1 else each[0] if each else None for each in known)
        return Delay(name=name, value=value, sigma=sigma)

    def parts(
        self, joints: tuple[str, ...], phi: Array, spread: Array | None, columns: tuple[str, ...]
    ) -> tuple[DrivePart, ...]:
        """`drive` of result.json; φ and its standard deviations, (n, k)."""
        place, gaps = places_of(columns), np.full(len(joints), np.nan)
        sigma = {
            key: gaps if spread is None or key not in place else spread[:, place[key]]
            for key in COLUMNS
        }
        # A value without σ is not determined.
        values = {
            key: np.where(np.isfinite(known), phi[:, place[key]], np.nan) if key in place else gaps
            for key, known in sigma.items()
        }
        return DrivePart.from_columns(
            joint=joints,
            **values,
            encoder_bias=self.bias,
            sigma=DriveValues.from_columns(**sigma, encoder_bias=self.bias_sigma),
            encoder_bias_verdict=self.verdicts(),
        )
