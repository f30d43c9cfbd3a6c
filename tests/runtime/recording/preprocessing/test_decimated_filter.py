"""Filters as matrix products, of rows that stay alone, held against the long way round."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from runtime.recording import Friction, Recording
from runtime.recording.friction import COLUMNS, JointMotion, add_columns, columns
from runtime.recording.preprocessing import (
    Preparation,
    decimate,
    differentiate,
    low_pass,
    pipeline,
    prepare,
    resample,
    segments,
    trim,
)
from runtime.recording.preprocessing import zero_phase as blocked
from runtime.recording.preprocessing.zero_phase import zero_phase
from tests.runtime.signals import sine, with_hole

BUTTERWORTH = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=100.0)


@settings(max_examples=40, deadline=None)
@given(
    order=st.integers(1, 6),
    cutoff=st.floats(0.004, 0.8),
    count=st.integers(60, 3000),
    period=st.sampled_from([1, 2, 7, 10, 100]),
    seed=st.integers(0, 2**16),
)
def test_zero_phase_is_scipys(order, cutoff, count, period, seed):
    """Oracle: `sosfiltfilt` itself, for any filter, length, padding and choice of rows.

    The slowest filter of order 6 turns rounding of 1e-16 into 1e-9 in scipy's own states; ours
    are nearer to what 80 bits give (1e-13 at a cut-off of 0.01).
    """
    rng = np.random.default_rng(seed)
    sections = scipy_signal.butter(order, cutoff, output="sos")
    signals = [rng.normal(3.0, 1.0, (count, m)) for m in (1, 3)]
    padding = int(rng.integers(3 * (order + 1), count))
    some = rng.random(count) < 0.1
    some[rng.integers(count) :: period] = True
    rows = np.flatnonzero(some)
    found = zero_phase(sections, signals, padding, rows, period)
    for x, y in zip(signals, found, strict=True):
        expected = scipy_signal.sosfiltfilt(sections, x, axis=0, padlen=padding)[rows]
        np.testing.assert_allclose(y, expected, atol=1e-14 / min(cutoff, 0.1) ** 3)


@pytest.mark.parametrize("padding", [1, 2, 999])
def test_zero_phase_of_few_and_many_padding_rows(padding):
    """Oracle: `sosfiltfilt` with the fewest and the most rows of odd extension, at all rows."""
    sections = scipy_signal.butter(2, 0.2, output="sos")
    x = np.random.default_rng(7).normal(size=(1000, 2))
    (y,) = zero_phase(sections, [x], padding, np.arange(1000))
    expected = scipy_signal.sosfiltfilt(sections, x, axis=0, padlen=padding)
    np.testing.assert_allclose(y, expected, atol=1e-12)


@pytest.mark.parametrize("period", [1, 2, 7, 100])
def test_zero_phase_filters_only_the_rows_it_needs(period, monkeypatch):
    """Property: a log of eight blocks or more takes the matrices, whatever the period of rows."""

    def refused(*_):
        raise AssertionError("all rows were filtered")

    monkeypatch.setattr(blocked, "both_directions", refused)
    sections = scipy_signal.butter(4, 0.1, output="sos")
    rows = np.arange(0, 2000, period)
    assert len(zero_phase(sections, [np.ones((2000, 1))], 15, rows, period)[0]) == len(rows)


def test_a_slow_filter_keeps_its_digits():
    """Oracle: the recursion in 80 bits or more: 2 Hz at 1 kHz loses no more digits than scipy does.

    With z₁ and z₂ themselves as state the error is a hundred times larger.
    """
    if np.finfo(np.longdouble).eps > 1e-18:
        pytest.skip("no long double here")
    rng = np.random.default_rng(1)
    x = 5.0 + np.cumsum(rng.normal(size=(6000, 1)), axis=0) / 100
    sections = scipy_signal.butter(4, 0.004, output="sos")
    still = scipy_signal.sosfilt_zi(sections)[:, :, None].astype(np.longdouble)
    long = np.vstack([2 * x[0] - x[2000:0:-1], x, 2 * x[-1] - x[-2:-2002:-1]])
    for _ in range(2):
        long, _ = scipy_signal.sosfilt(
            sections.astype(np.longdouble), long, axis=0, zi=still * long[0]
        )
        long = long[::-1]
    (y,) = zero_phase(sections, [x], 2000, np.arange(6000))
    usual = scipy_signal.sosfiltfilt(sections, x, axis=0, padlen=2000)
    lost, usually_lost = (np.abs(each - long[2000:-2000]).max() for each in (y, usual))
    assert lost < 2 * usually_lost


def recorded(measured: tuple[str, ...]) -> Recording:
    """Noise on what was measured; of four stretches one is too short, one has only ends."""
    rng = np.random.default_rng(2)
    data = sine(1.0, seconds=5.0)
    for hole in ((1.5, 2.2), (2.76, 3.0), (3.008, 3.05)):
        data = with_hole(data, *hole)
    noisy = {key: data.dq + rng.normal(0.0, 1e-3, data.q.shape) for key in measured}
    return data.replace(dq=None, ddq=None, tau=rng.normal(3.0, 1.0, data.q.shape)).replace(**noisy)


@pytest.mark.parametrize("measured", [("dq",), ("dq", "ddq"), ("ddq",), ()])
@pytest.mark.parametrize("rate", [500.0, 250.0, 100.0, 333.0])
def test_thinned_rows_are_those_of_the_steps_one_by_one(measured, rate):
    """Oracle: low_pass, differentiate, trim, decimate after one another: rows, numbers, history.

    1e-10: filtered rows agree to 1e-14, differentiated twice at 1 kHz.
    """
    data = recorded(measured)
    done = prepare(
        data, Preparation(filter="butterworth", cutoff_hz=20.0, rate_hz=rate, trim_s=0.3)
    )
    slow = decimate(trim(differentiate(low_pass(data, 20.0)), 0.3), rate)
    assert done.history == slow.history
    np.testing.assert_array_equal(done.t, slow.t)
    for key in ("q", "dq", "ddq", "tau"):
        expected = getattr(slow, key)
        np.testing.assert_allclose(getattr(done, key), expected, atol=1e-10, rtol=1e-10)


@pytest.mark.parametrize("measured", [("dq",), ()])
def test_thinned_rows_at_both_ends_of_a_log(measured):
    """Oracle: as above without trim, where the first and the last instant of the log stay.

    1e-8: second differences at an edge multiply rounding of 1e-15 by 5e6.
    """
    data = recorded(measured)
    data = data.take(slice(len(data) - 1 + len(data) % 2), "")
    done = prepare(data, Preparation(filter="butterworth", cutoff_hz=20.0, rate_hz=500.0))
    slow = decimate(differentiate(low_pass(data, 20.0)), 500.0)
    assert {data.t[0], data.t[-1]} <= set(done.t)
    for key in ("q", "dq", "ddq"):
        expected = getattr(slow, key)
        np.testing.assert_allclose(getattr(done, key), expected, atol=1e-8, rtol=1e-8)


def test_derivatives_are_numpys():
    """Oracle: `numpy.gradient` with edge_order 2 on every stretch, on a clock that jitters."""
    rng = np.random.default_rng(5)
    data = with_hole(sine(1.0), 1.0, 1.5)
    data = data.replace(t=data.t + 1e-4 * rng.random(len(data)), dq=None)
    done = differentiate(data)
    for part in segments(data.t):
        expected = np.gradient(data.q[part], data.t[part], axis=0, edge_order=2)
        np.testing.assert_allclose(done.dq[part], expected, atol=1e-11)


def test_only_rows_that_stay_are_filtered(monkeypatch):
    """Property: the short way is taken, and falls back where the new rate has no whole ratio."""
    taken = []
    usual = pipeline.thinned
    monkeypatch.setattr(pipeline, "thinned", lambda *a: taken.append(usual(*a)) or taken[-1])
    prepare(sine(1.0), BUTTERWORTH, Friction())
    prepare(sine(1.0), Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=300.0))
    assert [each is None for each in taken] == [False, True]


def test_linear_columns_need_no_filter():
    """Oracle: all columns filtered one by one are those of which only the bent ones were.

    1e-12: ones and velocities pass the filter as their columns would.
    """
    names = ("viscous", "coulomb", "offset", "rotor", "asymmetric")
    data = sine(1.0)
    data = data.replace(ddq=-((2 * np.pi) ** 2) * data.q)
    done = prepare(data, BUTTERWORTH, Friction(names))
    slow = decimate(low_pass(add_columns(data, Friction(names)), 10.0), 100.0)
    assert done.column_names == slow.column_names
    np.testing.assert_allclose(done.columns, slow.columns, atol=1e-12)
    few = prepare(data, BUTTERWORTH, Friction(("offset", "viscous")), Friction(("rotor",)))
    np.testing.assert_array_equal(
        few.columns, np.stack([np.ones_like(few.dq), few.dq, few.ddq], -1)
    )


def test_columns_that_came_with_the_log_stay():
    """Property: where there is no velocity to make others from, they are filtered as they are."""
    data = add_columns(sine(1.0), Friction(("coulomb",))).replace(dq=None)
    done = prepare(data, BUTTERWORTH, Friction(("viscous", "offset")))
    assert done.column_names == ("coulomb",)
    expected = decimate(low_pass(data, 10.0), 100.0).columns
    np.testing.assert_allclose(done.columns, expected, atol=1e-12)


@pytest.mark.parametrize("name", sorted(name for name in COLUMNS if COLUMNS[name].is_linear))
def test_linear_columns_are_linear(name):
    """Property: twice the motion is twice the column, or the column is constant."""
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.normal(size=(3, 20, 2))
    terms = Friction((name,), gear=((1.0, 0.5), (0.5, 1.0)))
    one, two = (columns(JointMotion(s * dq, s * q, s * ddq), terms) for s in (1.0, 2.0))
    np.testing.assert_allclose(two, one if name == "offset" else 2 * one)


@pytest.mark.parametrize("start", [0.0, 5000.0])
def test_a_uniform_clock_is_its_own_grid(start):
    """Property: rounded stamps of a uniform clock are not interpolated; jitter is."""
    data = sine(1.0)
    data = data.replace(t=start + data.t)
    same = resample(data, data.rate_hz, 3e-3)
    assert np.shares_memory(same.q, data.q)
    assert same.history == (
        "Resampled to 1000 Hz (4000 samples): 0 gaps up to 0.003 s interpolated, "
        "0 longer ones kept.",
    )
    jitter = np.where(np.arange(4000) % 3 == 1, 1e-6, 0.0)
    for other in (
        resample(data.replace(t=data.t + jitter), 1000.0, 3e-3),
        resample(data, 1000.001, 3e-3),
        resample(data.take(np.arange(4000) != 7, ""), 1000.0, 3e-3),
    ):
        assert len(other) >= 3999
        assert not np.shares_memory(other.q, data.q)
