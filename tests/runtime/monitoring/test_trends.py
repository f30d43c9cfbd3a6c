"""Trends of a history: slopes over time and temperature, and the page that shows them."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.monitoring.trends import ALPHA, MONTH, slope_of, trends_of
from tests.runtime.conftest import Command

START = datetime(2026, 1, 5, tzinfo=UTC)
DRIFT, WARM = 2.0, -0.4
"""Friction of joint 2 over time [%/month], gain of joint 4 over temperature [%/°C]."""


def history(count: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """One check a week: friction of joint 2 grows, the gain of joint 4 follows the temperature."""
    entries = []
    for week in range(count):
        when, warm = START + timedelta(weeks=week), 20 + 10 * rng.uniform()
        means = {
            ("friction", "joint2"): DRIFT * 7 * week / MONTH,
            ("friction", "joint3"): 0.0,
            ("sensor gain", "joint4"): WARM * (warm - 25),
        }
        sizes = []
        for (group, where), mean in means.items():
            size = mean + rng.normal()
            interval = [size - 1.96, size + 1.96]
            sizes.append(
                {"group": group, "where": where, "size": size, "interval": interval, "unit": "%"}
            )
        entries.append(
            {
                "checked": "2027-01-01T00:00:00+00:00",
                "recorded": when.isoformat(),
                "temperature": warm,
                "model_hash": "0" * 64,
                "result_sha256": "1" * 64,
                "log": f"week {week}",
                "changed": week == 3,
                "p_value": 0.5,
                "sentence": f"week {week}: no change",
                "sizes": sizes,
            }
        )
    return entries


def test_slope_and_deviation_are_those_of_numpy() -> None:
    """Oracle: polyfit with weights, unscaled where χ² is below N − 2 and scaled above."""
    rng = np.random.default_rng(0)
    x, sigma = rng.uniform(0, 10, size=12), rng.uniform(0.5, 2.0, size=12)
    for noise in (0.3, 3.0):
        y = 1.0 - 0.2 * x + noise * sigma * rng.normal(size=12)
        slope = slope_of(x, y, sigma)
        kind = "unscaled" if noise < 1 else True
        (value, offset), covariance = np.polyfit(x, y, 1, w=1 / sigma, cov=kind)
        assert slope.value == pytest.approx(value, rel=1e-9)
        assert slope.offset == pytest.approx(offset, rel=1e-9)
        half = (slope.interval[1] - slope.interval[0]) / 2
        assert half == pytest.approx(2.228139 * np.sqrt(covariance[0, 0]), rel=1e-6)


def test_without_a_trend_none_is_significant() -> None:
    """Oracle: p-values of 3000 slopes without a trend are below 0.05 in at most 5 %, + 3 σ."""
    rng = np.random.default_rng(1)
    seen = []
    for _ in range(3000):
        sigma = rng.uniform(0.5, 2.0, size=8)
        seen.append(slope_of(np.arange(8.0), sigma * rng.normal(size=8), sigma).p_value)
    assert np.mean(np.array(seen) < 0.05) < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 3000)


def test_slopes_of_a_history_are_recovered() -> None:
    """Oracle: both slopes that we made lie within their intervals; the third is not significant."""
    entries = history(30, np.random.default_rng(2))
    rest = [dict(entries[0], result_sha256="2" * 64)]
    trends = trends_of([*rest, *reversed(entries)])
    assert trends.others == 1
    assert trends.logs[0] == "week 0"
    time, temperature = trends.axes
    assert time.x == pytest.approx(7 * np.arange(30) / MONTH, rel=1e-9)
    by_name = {(each.group, each.where): each for each in trends.series}
    drift = time.slope(by_name["friction", "joint2"])
    assert drift.interval[0] < DRIFT < drift.interval[1]
    assert drift.p_value < ALPHA / 6
    warm = temperature.slope(by_name["sensor gain", "joint4"])
    assert warm.interval[0] < WARM < warm.interval[1]
    assert warm.p_value < ALPHA / 6
    assert time.slope(by_name["friction", "joint3"]).p_value > ALPHA / 6


def test_too_few_logs_have_no_slope() -> None:
    """Property: three logs, or one temperature only, give no slope."""
    three = np.arange(3.0)
    assert slope_of(three, three, np.ones(3)) is None
    assert slope_of(np.ones(9), np.ones(9), np.ones(9)) is None


def test_the_page_of_a_history(command: Command, tmp_path: Path) -> None:
    """Property: names both trends, shows every group over both quantities, loads nothing else."""
    lines = [json.dumps(each) for each in history(30, np.random.default_rng(2))]
    (tmp_path / "h.jsonl").write_text("\n".join(lines) + "\n")
    ran = command("report", "h.jsonl")
    assert ran.code == 0, ran.err
    page = (tmp_path / "h.html").read_text()
    assert "Friction of joint2 changes with time by +" in page
    assert "Sensor gain of joint4 changes with temperature by -" in page
    for title in ("Friction over time", "Sensor gain over temperature", "Verdicts", "2026-01-05"):
        assert title in page
    assert page.count("<svg") == 4
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert command("report", "h.jsonl", "--out", "h.jsonl").code == 2
    assert (tmp_path / "h.jsonl").read_text() == "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    "damage", [{"sizes": 3}, {"recorded": "yesterday"}, {"temperature": "warm"}, {"sizes": [{}]}]
)
def test_damaged_entries_are_refused(damage: dict[str, Any]) -> None:
    """Property: one sentence."""
    entries = history(4, np.random.default_rng(0))
    with pytest.raises(RecordingError, match="history is damaged"):
        trends_of([*entries[:3], entries[3] | damage])
    with pytest.raises(RecordingError, match="no entry"):
        trends_of([])
