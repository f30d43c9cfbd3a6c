"""Curves of the report: thinned to what a panel shows."""

import numpy as np
import pytest

from runtime.outputs.report.canvas import thinned
from runtime.outputs.report.figures import torques


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
