"""Gains of motor currents that a log does not state: estimates with standard deviations.

τ_j = k_j i_j        k in N·m/A or N/A
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.common.tables import significant
from runtime.library import Array

LARGEST_SIGMA = 0.1  # relative standard deviation above which a gain counts as not determined
DETERMINED = "determined"
UP_TO_FACTOR = "determined up to the common factor"
OF_URDF = "from the masses of the URDF"
UNSEEN = "not identifiable from this motion"
VERDICTS = (DETERMINED, UP_TO_FACTOR, OF_URDF, UNSEEN)


@dataclass(frozen=True, slots=True, eq=False)
class CurrentGains:
    """Estimated gains of the channels of one log."""

    channels: tuple[str, ...]  # names of the joints, or of the motors where the gear couples them
    gain: Array  # k̂, (n,) N·m/A or N/A; that of `UNSEEN` channels is the median of the others
    sigma: Array  # σ with the URDF as prior, (n,) N·m/A or N/A; NaN for `UNSEEN`
    ratio_sigma: Array  # relative σ of k_j/k_r without the URDF, (n,); NaN likewise
    reference: int  # channel r
    verdicts: tuple[str, ...]  # per channel, one of `VERDICTS`
    scale: str  # what fixes the common factor, a phrase
    common_sigma: float  # relative standard deviation of the common factor with the URDF as prior

    @classmethod
    def from_facts(cls, facts: list[dict[str, Any]], scale: str) -> "CurrentGains":
        """The gains that `facts` describe; the file does not hold σ of the common factor."""

        def column(key: str) -> Array:
            return np.array([each[key] for each in facts], dtype=float)  # null is NaN

        channels = tuple(str(each["channel"]) for each in facts)
        return cls(
            channels=channels,
            gain=column("gain"),
            sigma=column("sigma"),
            ratio_sigma=column("ratio_sigma"),
            reference=channels.index(facts[0]["ratio_to"]),
            verdicts=tuple(str(each["verdict"]) for each in facts),
            scale=scale,
            common_sigma=np.nan,
        )

    def sentences(self) -> tuple[str, ...]:
        """What the gains leave undetermined, for notes and reports."""
        percent = 100 * self.common_sigma
        first = (
            "the torque is a motor current times estimated gains, whose common factor comes from "
            f"{self.scale} and has a standard deviation of {significant(percent)} %; masses, "
            "inertias, friction and rotor inertia are proportional to the gain of their joint, and "
            "the intervals of this result do not contain its error. Errors in percent and ratios "
            "of the coefficients of one joint do not depend on it"
        )
        opposite = [n for n, k in zip(self.channels, self.gain, strict=True) if k < 0]
        signs = tuple(
            f"the gain of {name} is negative: its current counts against the direction of q"
            for name in opposite
        )
        unseen = [n for n, v in zip(self.channels, self.verdicts, strict=True) if v == UNSEEN]
        if not unseen:
            return (first, *signs)
        return (
            first,
            *signs,
            f"the currents of {', '.join(unseen)} show no torque of the links, so that their gains "
            "are not identifiable from this motion; they take the median of the others",
        )
