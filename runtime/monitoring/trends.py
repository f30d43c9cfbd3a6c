"""History of checks of a robot, one JSON object per line, and trends over time and temperature.

    y_i = a + s x_i + N(0, f σ_i²)   by weighted least squares, f = max(1, χ² / (N − 2))

for the estimated size y_i of one change in log i, with its standard deviation σ_i. A slope is
significant where its p-value (Student's t), times the number of slopes, is below `ALPHA`.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import stdtr, stdtrit

from runtime.common.files import text_of
from runtime.errors import RecordingError
from runtime.estimators.regression.samples import NORMAL_95
from runtime.library import Array

KEYS = ("checked", "model_hash", "log", "changed", "p_value")
ALPHA = 0.01  # probability that a history without a trend shows one
MONTH = 365.25 / 12  # days of a month
LEAST_LOGS = 4  # smallest number of logs for a slope
LARGEST_SIZE = 1e12


def read_history(path: Path) -> list[dict[str, Any]]:
    """Entries of a history in the order of the file; none where it does not exist."""
    if not os.path.lexists(path):
        return []
    try:
        entries = [json.loads(line) for line in text_of(path).splitlines() if line.strip()]
        if not all(isinstance(each, dict) and set(KEYS) <= set(each) for each in entries):
            raise ValueError
    except (OSError, ValueError, RecursionError):
        raise RecordingError(
            f"expected a history of watch in '{path}' (one JSON object per line), got another "
            "file; name another one with --history"
        ) from None
    return entries


def append_history(path: Path, entries: list[dict[str, Any]]) -> None:
    """Append entries to a history; what it has is kept as it is."""
    read_history(path)
    lines = "".join(f"{json.dumps(each, ensure_ascii=False)}\n" for each in entries)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab") as file:
            file.write(lines.encode())
    except OSError as error:
        raise RecordingError(
            f"cannot append to '{path}' ({error.strerror}); name another file with --history"
        ) from None


@dataclass(frozen=True, slots=True)
class Series:
    """Estimated size of one change in all logs of a history."""

    group: str  # part of the robot
    where: str  # joint or link; "" for the whole robot
    unit: str  # of the sizes
    at: tuple[int, ...]  # number of the check of each entry, (N,)
    size: Array  # estimates, (N,)
    sigma: Array  # their standard deviations, (N,)


@dataclass(frozen=True, slots=True)
class Slope:
    """Slope of a series."""

    value: float  # per unit of x
    interval: tuple[float, float]  # its 95 % interval
    p_value: float  # of no slope
    offset: float  # a, at x = 0


@dataclass(frozen=True, slots=True)
class TrendAxis:
    """Quantity over which changes have slopes."""

    word: str  # name
    unit: str  # of it
    x: Array  # of each log; NaN where it is not known

    def slope(self, series: Series) -> Slope | None:
        """Slope of a series; None where it is not determined."""
        x = self.x[list(series.at)]
        known = np.isfinite(x)
        return slope_of(x[known], series.size[known], series.sigma[known])


@dataclass(frozen=True, slots=True)
class Trends:
    """History of one model."""

    logs: tuple[str, ...]  # names of the logs, in order of their dates
    days: Array  # date of each log, days since 1970-01-01
    temperature: Array  # of each log [°C]; NaN where it is not known
    changed: tuple[bool, ...]  # whether the log showed a change
    sentences: tuple[str, ...]  # verdict of each log
    series: tuple[Series, ...]  # estimated changes
    others: int  # number of checks of other models, which are left out

    @property
    def axes(self) -> tuple[TrendAxis, ...]:
        """Time since the first log, and the temperature where it is known of a log."""
        time = TrendAxis("time", "month", (self.days - self.days[0]) / MONTH)
        warmth = TrendAxis("temperature", "°C", self.temperature)
        return (time, warmth) if np.isfinite(self.temperature).any() else (time,)


def trends_of(entries: Sequence[dict[str, Any]]) -> Trends:
    """Series of a history, of the model that was checked last."""
    if not entries:
        raise RecordingError(
            "the history has no entry; make one with: watch RESULT LOG --history FILE"
        )
    try:
        model = entries[-1].get("result_sha256")
        kept = [each for each in entries if each.get("result_sha256") == model]
        kept.sort(key=_day)
        values: dict[tuple[str, str, str], list[tuple[int, float, float]]] = {}
        for k, entry in enumerate(kept):
            for each in entry.get("sizes", ()):
                size, (low, high) = float(each["size"]), map(float, each["interval"])
                sigma = (high - low) / (2 * NORMAL_95)
                if not (abs(size) < LARGEST_SIZE and 0 < sigma < LARGEST_SIZE):
                    continue
                key = (str(each["group"]), str(each["where"]), str(each["unit"]))
                values.setdefault(key, []).append((k, size, sigma))
        warm = [entry.get("temperature") for entry in kept]
        return Trends(
            tuple(str(entry["log"]) for entry in kept),
            np.array([_day(entry) for entry in kept]),
            np.array([np.nan if each is None else float(each) for each in warm]),
            tuple(bool(entry["changed"]) for entry in kept),
            tuple(str(entry.get("sentence", "")) for entry in kept),
            tuple(
                Series(*key, at, np.array(size), np.array(sigma))
                for key, rows in values.items()
                for at, size, sigma in [zip(*rows, strict=True)]
            ),
            len(entries) - len(kept),
        )
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise RecordingError(
            f"an entry of the history is damaged (no valid {error}); correct or remove its line"
        ) from None


def slope_of(x: Array, y: Array, sigma: Array) -> Slope | None:
    """Slope of estimates over x."""
    if len(x) < LEAST_LOGS or not np.ptp(x) > 0:
        return None
    (value, offset), covariance = np.polyfit(x, y, 1, w=1 / sigma, cov="unscaled")
    rest, freedom = (y - offset - value * x) / sigma, len(x) - 2
    deviation = np.sqrt(max(1.0, float(rest @ rest) / freedom) * covariance[0, 0])
    half = float(stdtrit(freedom, 0.975) * deviation)
    p_value = 2 * float(stdtr(freedom, -abs(value) / deviation))
    return Slope(float(value), (value - half, value + half), p_value, float(offset))


def _day(entry: dict[str, Any]) -> float:
    """Date of the log, else of the check, in days since 1970-01-01."""
    when = datetime.fromisoformat(str(entry.get("recorded") or entry["checked"]))
    when = when if when.tzinfo else when.replace(tzinfo=UTC)
    return when.timestamp() / 86400
