"""Curves of the report: thinned to what a panel shows, with round ticks, inside their panels."""

import re

import numpy as np
import pytest

from runtime.outputs.report.decimation import thinned
from runtime.outputs.report.panels import Panel, curve, span, ticks
from runtime.outputs.report.result_figures import torques


@pytest.mark.parametrize("count", [200, 201, 399, 1000, 12_345, 1_000_003])
def test_thinning_keeps_the_ends_of_every_bin(count: int) -> None:
    """Property: at most three points per two requested; extremes of any 1 % of the curve stay."""
    rng = np.random.default_rng(count)
    t, y = np.arange(count) / 7, rng.normal(size=count)
    short_t, short_y = thinned(t, y, 200)
    assert len(short_t) <= 404  # bins of a whole number of samples are at most twice as many
    assert np.all(np.diff(short_t) > 0)
    assert np.all(np.isin(short_y, y))
    assert (short_t[0], short_t[-1]) == (t[0], t[-1])
    # A bin is at most 1 % of the samples long, so every window of 2 % holds a whole one.
    for start in range(0, count - count // 50, max(1, count // 50)):
        window = slice(start, start + count // 50 + 1)
        shown = short_y[(short_t >= t[window][0]) & (short_t <= t[window][-1])]
        assert shown.size or count < 1000
    assert {y.min(), y.max()} <= set(short_y)


@pytest.mark.parametrize(
    ("ends", "most", "labels"),
    [
        ((-1.2, 3.9), 6, ["−1", "0", "1", "2", "3"]),
        ((0.0, 0.011), 5, ["0.0000", "0.0025", "0.0050", "0.0075", "0.0100"]),
        ((12.6, 20.9), 5, ["14", "16", "18", "20"]),
        ((-0.6, 0.4), 4, ["−0.50", "−0.25", "0.00", "0.25"]),
        ((2e7, 6e7), 5, ["2e+07", "3e+07", "4e+07", "5e+07", "6e+07"]),
    ],
)
def test_ticks_are_round_numbers(ends: tuple[float, float], most: int, labels: list[str]) -> None:
    """Oracle: by hand; steps of 1, 2, 2.5 or 5 times a power of ten, as many digits as needed."""
    at, shown = ticks(ends, most)
    assert shown == labels
    assert len(at) == len(labels)


def test_curves_stay_inside_their_panel() -> None:
    """Property: the path of a curve spans its panel exactly where its scale is that of the data."""
    t, y = np.linspace(3.0, 9.0, 5000), np.sin(np.linspace(0.0, 30.0, 5000))
    panel = Panel(40.0, 10.0, 300.0, 64.0, (3.0, 9.0), span([y], margin=0.0))
    numbers = np.array(re.findall(r"-?\d+\.\d\d", curve(panel, t, y, "--after")), dtype=float)
    x, v = numbers[::2], numbers[1::2]
    assert (x.min(), x.max(), v.min(), v.max()) == (40.0, 340.0, 10.0, 74.0)


def test_curves_over_one_abscissa_look_for_pauses_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: seven joints have 35 curves; the median of a million steps takes 10 ms."""
    calls = []
    plain = np.median
    monkeypatch.setattr(np, "median", lambda x: (calls.append(len(x)), plain(x))[1])
    t, (a, b, c) = np.linspace(0.0, 9.0, 1000), np.random.default_rng(0).normal(size=(3, 1000, 2))
    torques(["one", "two"], ["N*m", "N*m"], t, a, b, c)
    assert calls == [999]


def test_thinning_keeps_peaks_and_shows_pauses() -> None:
    t = np.arange(10_000) * 0.01
    t[5000:] += 30.0
    y = np.zeros(10_000)
    y[[17, 7777]] = 5.0, -9.0
    short_t, short_y = thinned(t, y, 200)
    assert len(short_t) < 250
    assert np.nanmax(short_y) == 5.0
    assert np.nanmin(short_y) == -9.0
    gap = np.flatnonzero(np.isnan(short_y))
    assert gap.size == 1
    assert short_t[gap[0] - 1] == t[4999]
    assert short_t[gap[0] + 1] == t[5000]
    np.testing.assert_array_equal(thinned(t[:50], y[:50], 200), (t[:50], y[:50]))
