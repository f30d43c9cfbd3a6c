"""Low-pass, derivatives and decimation of a preparation, held against the single steps."""

import numpy as np
import pytest
from scipy import signal

from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction.model import add_columns, columns
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.filters import low_pass
from runtime.recording.preprocessing.segments import (
    decimate,
    differentiate,
    resample,
    segments,
    trim,
)
from runtime.recording.settings import COLUMNS, JointMotion
from tests.runtime.signals import sine, with_hole

BUTTERWORTH = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=100.0)


@pytest.mark.parametrize("cutoff", [2.1, 21.0, 300.0])
def test_low_pass_is_scipys_on_every_stretch(cutoff):
    """Oracle: `sosfiltfilt` of each stretch between holes, padded by less than its length."""
    data = with_hole(with_hole(sine(1.0), 1.0, 1.5), 1.53, 1.6)
    lengths = [part.stop - part.start for part in segments(data.t)]
    assert min(lengths) == 30
    sections = signal.butter(4, 2.0 * cutoff / data.rate_hz, output="sos")
    done = low_pass(data, cutoff)
    padding = max(15, int(np.ceil(4000.0 / cutoff)))
    for part in segments(data.t):
        short = min(padding, part.stop - part.start - 1)
        expected = signal.sosfiltfilt(sections, data.q[part], axis=0, padlen=short)
        np.testing.assert_allclose(done.q[part], expected, rtol=1e-12, atol=1e-12)


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
    motions = (
        JointMotion(*(s * dq, s * q, s * ddq), signals=dict.fromkeys(COLUMNS[name].signals, s * q))
        for s in (1.0, 2.0)
    )
    one, two = (columns(motion, terms) for motion in motions)
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
