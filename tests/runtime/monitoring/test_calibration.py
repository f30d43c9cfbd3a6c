"""Thresholds that are fitted to free motion."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from runtime.library import Library
from runtime.monitoring.calibration import (
    PEAKS,
    Tail,
    fitted,
    highest,
    levels_of,
    on_other_days,
    peaks_of,
)
from runtime.monitoring.model import MonitoredModel
from runtime.monitoring.noise import levels
from runtime.monitoring.observer import contacts_of
from runtime.recording import Friction, Preparation, Recording
from tests.runtime.conftest import Command
from tests.runtime.monitoring.conftest import Monitored

RATE_HZ = 200.0


def sequence(seed: int, correlation: float = 0.9, count: int = 120_000) -> np.ndarray:
    """Gaussian sequence of variance 1."""
    noise = np.random.default_rng(seed).standard_normal(count)
    return lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], noise)


def of_sequence(x: np.ndarray) -> Tail:
    """Peaks of a sequence."""
    return highest(peaks_of(x, RATE_HZ), len(x) / RATE_HZ)


def of_heights(heights: np.ndarray, rng: np.random.Generator) -> Tail:
    """Peaks of ten minutes at random times."""
    return highest(np.array([heights, rng.uniform(0, 600.0, len(heights))]), 600.0)


def test_peaks_are_contacts() -> None:
    """Property: as many peaks above a level as contacts.

    One in ten may differ: what falls below half of a peak need not fall below half of the level.
    """
    x = np.abs(sequence(0))
    (peaks, times), t = peaks_of(x, RATE_HZ), np.arange(len(x)) / RATE_HZ
    assert np.array_equal(x[np.searchsorted(t, times - 1e-6)], peaks)
    assert (np.diff(peaks) <= 0).all()
    assert len(peaks) == PEAKS + 1
    for k in (10, 40, 90):
        level = (peaks[k] + peaks[k + 1]) / 2
        high = np.full((len(x), 1), level)
        contacts = contacts_of(t, x[:, None], high, high, ["j"], 0.0)
        assert abs(len(contacts) - k - 1) <= 0.1 * (k + 1)


def test_a_gaussian_tail_gives_the_level_of_rice() -> None:
    """Oracle: z of ten minutes' peaks against the crossings of a Gaussian sequence, mean of 12.

    z² is extrapolated by ln(100/(T ν)) = 6.4 scales, whose relative error is 1/√100 and that of ξ
    a third as large: z is known to 5 %, the mean of 12 to 1.5 %. Peaks closer than a pause count
    once, the formula counts all: at most 1 % of z.
    """
    rate = 1.0 / 3600
    tails = [fitted([of_sequence(np.abs(sequence(k)))])[0] for k in range(1, 13)]
    seen = [tail.level(rate) for tail in tails]
    (right,) = levels(rate, np.array([0.9]), RATE_HZ)
    assert np.mean(seen) == pytest.approx(right, rel=0.04)
    assert all(abs(tail.shape) < 0.3 for tail in tails)  # three standard deviations of ξ


def test_peaks_of_few_motions_count_less() -> None:
    """Closed form: peaks that all lie in one of five motions have φ = 4 + 1 in place of 1.

    Of motions with counts c = 5 m for one of five, 0 else, the variance over the mean is
    4 m + 1 where c has the variance of a Poisson number beside that of the motions, m the mean:
    here m = 100/30 motions. The level of a rare alarm is higher: the tail is known less well.
    """
    rng = np.random.default_rng(0)
    heights = np.sqrt(4.0 + 2.0 * rng.exponential(size=101))
    single = of_heights(heights, rng)
    motion = 5 * rng.integers(0, 6, 101)
    few = highest(np.array([heights, 20 * (motion + rng.uniform(size=101))]), 600.0)
    assert single.cluster == pytest.approx(1.0, abs=0.6)  # (2/30)^(1/2) · 1.96 = 0.5, not below 1
    assert few.cluster == pytest.approx(4 * 100 / 30 + 1, rel=0.3)  # of 6 motions with 17 ± 4
    rate = 1.0 / 3600
    once, more = (levels_of(fitted([each]), rate)[0] for each in (single, few))
    assert 1.02 < more / once < 1.5


def test_friction_of_other_days(double: Library) -> None:
    """Closed form: of 2 N·m·s/rad at 3 rad/s the change is 6 N·m times factors of 7 %.

    200 times of 20 s know their root mean square to 5 %, of which three; within a sample of 0.1 s
    the factors turn by π/400, so that no step is above 6 · 0.07 · √2 · 5 · π/400 for draws below 5.
    A model without friction leaves a log as it is.
    """
    t = np.arange(40_000) / 10.0
    q, dq = np.zeros((len(t), 2)), np.tile([3.0, 0.0], (len(t), 1))
    log = Recording(t, q, dq, None, np.zeros_like(q))
    beta = double.base_matrix @ double.pi0
    terms, phi = Friction(("viscous",)), np.array([[2.0], [1.0]])
    rng = np.random.default_rng(0)
    for coefficients, size in ((phi, 6 * 0.07), (0 * phi, 0.0)):
        model = MonitoredModel(beta, terms, coefficients, Preparation())
        (changed,) = on_other_days(double, model, [log], rng)
        tau = changed.required("tau")
        assert np.sqrt(np.mean(tau[:, 0] ** 2)) == pytest.approx(size, rel=0.15)
        assert np.abs(np.diff(tau[:, 0])).max() <= size * np.sqrt(2) * 5 * np.pi / 400
        assert not tau[:, 1].any()


def test_bounded_residuals_need_no_gaussian_level() -> None:
    """Property: friction of bounded size has a level near its bound, far below a Gaussian tail."""
    rng = np.random.default_rng(0)
    (tail,) = fitted([of_heights(np.sqrt(rng.uniform(4.0, 9.0, 100)), rng)])
    gaussian = Tail(tail.peaks, 600.0, tail.scale, 0.0)
    rate = 1e-3 / 3600
    assert tail.shape < -0.1
    assert 3.0 < tail.level(rate) < 3.6 < gaussian.level(rate)
    assert tail.level(1.0) == tail.peaks[-1]  # more frequent than any peak that was fitted
    assert (np.diff([tail.level(r) for r in (1e-6, 1e-4, 1e-2, 1.0)]) < 0).all()


def test_observe_with_free_motion(
    command: Command, monitored: Monitored, rest_file: Path, tmp_path: Path
) -> None:
    """Property: the log to which thresholds are fitted contains as many alarms as stated.

    Its 8 s count three times, for 31 peaks are the least: of 14 expected alarms each is seen in all
    three, so that the Poisson error of a third of a log remains, 3.7, here three times.
    """
    words = ["observe", rest_file, "--model", monitored.folder, "--out", "seen", "--json"]
    words += ["--settings", "false_alarms=100 per minute", "--settings", f"calibrate={rest_file}"]
    ran = command(*words)
    assert ran.code == 2
    assert "calibrate with a longer log" in ran.err
    assert not (tmp_path / "seen").exists()
    ran = command(*words, *(2 * ["--settings", f"calibrate={rest_file}"]))
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    expected = facts["false_alarms"]["expected_in_log"]
    assert abs(facts["alarms"] - expected) < 3 * np.sqrt(expected)
    assert facts["false_alarms"]["by_stretches_per_hour"] is None  # fitted
    fit = facts["calibration"]
    assert fit["seconds"] == pytest.approx(3 * facts["seconds"])
    assert min(fit["peaks"]) >= 30


def test_minutes_of_free_motion_do_not_state_a_rate_per_hour(
    command: Command, monitored: Monitored, rest_file: Path
) -> None:
    """Oracle: without an event in T the 97.5 % bound of a Poisson rate is −ln 0.025 / T."""
    words = ["observe", rest_file, "--model", monitored.folder, "--out", "short", "--json"]
    words += 3 * ["--settings", f"calibrate={rest_file}"]
    facts = json.loads(command(*words, "--settings", "false_alarms=1 per hour").out)
    fit = facts["calibration"]
    assert fit["per_hour_95"][1] * fit["seconds"] / 3600 == pytest.approx(-np.log(0.025), rel=1e-3)
    assert any("are too few for 1 per hour" in note for note in facts["notes"])
    ran = command(*words, "--overwrite", "--settings", "false_alarms=2 per minute")
    assert not any("are too few" in note for note in json.loads(ran.out)["notes"])
