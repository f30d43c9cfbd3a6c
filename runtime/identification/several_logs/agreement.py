"""Comparison of several logs that were fitted together: leave-one-out errors, repeatability."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.identification.metrics import TorqueError
from runtime.identification.result_record import (
    Delay,
    LeftOutPart,
    RepeatabilityPart,
    SessionsPart,
)
from runtime.library import Array

AGREEING = 2.0
"""Ratio of spread to expected spread below which logs agree; with three logs the ratio itself
scatters by a third."""


@dataclass(frozen=True, slots=True)
class LeftOutLog:
    """Torque errors on one log of the result of all others.

    Attributes:
        name: name of the log.
        before: torque error of the URDF.
        after: torque error of the result of the others, with their mean offset.
        with_offset: the same with the offset of this log, which is the mean of its residual.
        alone: overall error of the fit to this log alone on the same rows, %.
    """

    name: str
    before: TorqueError
    after: TorqueError
    with_offset: TorqueError
    alone: float


@dataclass(frozen=True, slots=True)
class LogAgreement:
    """Comparison of several logs that were fitted together.

    Attributes:
        names: names of the logs.
        carried: mass of the known payload of every log, kg.
        samples: training rows per log.
        offsets: torque offsets of each log in the joint fit, (logs, n) N·m or N; None without
            offset columns.
        left_out: leave-one-out errors, one per log.
        masses: link masses identified from every log alone, (logs, n) kg.
        spread: standard deviation of each base parameter over the logs, (n_b,).
        expected_spread: the same predicted by the covariances of the single fits, (n_b,).
        shared: pairs of logs with equal rows, and their share.
        delays: name, delay and standard deviation of every log [s]; None where not estimated.
    """

    names: tuple[str, ...]
    carried: tuple[float, ...]
    samples: tuple[int, ...]
    offsets: Array | None
    left_out: tuple[LeftOutLog, ...]
    masses: Array
    spread: Array
    expected_spread: Array
    delays: tuple[dict[str, Any], ...] | None = None
    shared: tuple[tuple[str, str, float], ...] = ()

    @property
    def ratio(self) -> float:
        """Root mean square of spread over expected spread."""
        known = self.expected_spread > 0
        return float(np.sqrt(np.mean((self.spread[known] / self.expected_spread[known]) ** 2)))

    def sharing(self) -> str:
        """Which logs hold the same rows."""
        pairs = (
            f"{a} and {b} share {100 * share:.0f} % of their rows" for a, b, share in self.shared
        )
        return ", ".join(pairs)

    def sentence(self) -> str:
        """One sentence on whether the logs agree within their noise."""
        if self.shared:
            return f"{self.sharing()}: logs with common rows do not show whether results repeat"
        verdict = (
            "the logs agree within their noise"
            if self.ratio < AGREEING
            else "the logs differ by more than noise: temperature, cables, a payload or a clock "
            "changed between them"
        )
        return (
            f"the base parameters of single logs spread {self.ratio:.2g} times as much as their "
            "covariances predict, link masses up to "
            f"{float(np.std(self.masses, axis=0, ddof=1).max()):.2g} kg; {verdict}"
        )

    def part(self) -> SessionsPart:
        """The part `sessions` of result.json."""
        return SessionsPart(
            names=self.names,
            payload_kg=self.carried,
            train_samples=self.samples,
            offsets=None if self.offsets is None else tuple(map(tuple, self.offsets.tolist())),
            delay_s=None if self.delays is None else tuple(Delay(**each) for each in self.delays),
            leave_one_out=tuple(
                LeftOutPart(
                    name=log.name,
                    before_overall=log.before.overall,
                    after_overall=log.after.overall,
                    log_offset_overall=log.with_offset.overall,
                    single_log_overall=log.alone,
                    rms=tuple(log.after.rms.tolist()),
                )
                for log in self.left_out
            ),
            repeatability=RepeatabilityPart(
                masses=tuple(map(tuple, self.masses.tolist())),
                mass_spread=tuple(np.std(self.masses, axis=0, ddof=1).tolist()),
                beta_spread=tuple(self.spread.tolist()),
                beta_sigma_expected=tuple(self.expected_spread.tolist()),
                ratio=self.ratio,
                sentence=self.sentence(),
            ),
        )
