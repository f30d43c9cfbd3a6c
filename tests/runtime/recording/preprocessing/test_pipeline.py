"""Preprocessing as a whole: nothing looks across a hole, parts are disjoint, history is told."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.errors import RecordingError
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.filters import low_pass, moving_average, savitzky_golay
from runtime.recording.preprocessing.parts import prepared_parts, split
from runtime.recording.preprocessing.segments import (
    differentiate,
    drop_rest,
    resample,
    segments,
    trim,
)
from tests.runtime.signals import sine, with_hole

STEPS = {
    "differentiate": lambda r: differentiate(r.replace(dq=None)),
    "low_pass": lambda r: low_pass(r, 10.0),
    "moving_average": lambda r: moving_average(r, 0.1),
    "savitzky_golay": lambda r: savitzky_golay(r.replace(dq=None), 0.1),
    "prepare": lambda r: prepare(
        r.replace(dq=None),
        Preparation(filter="butterworth", cutoff_hz=10.0, max_gap_s=0.01, trim_s=0.05),
        Friction(("viscous", "coulomb")),
    ),
    "resample": lambda r: resample(r, 500.0, 0.01),
}


@pytest.mark.parametrize("step", STEPS)
def test_no_step_looks_across_a_hole(step):
    """Property: what stands after a hole never changes what comes out before it.

    The part after the hole is moved by 100 rad; were it seen, the part before would change.
    """
    data = with_hole(sine(1.0), 1.7, 2.3)
    moved = data.replace(q=data.q + 100.0 * (data.t[:, None] > 2.0))
    one, two = STEPS[step](data), STEPS[step](moved)
    before = one.t < 2.0
    for key in ("q", "dq", "ddq", "columns"):
        a, b = getattr(one, key), getattr(two, key)
        if a is not None:
            np.testing.assert_array_equal(a[before], b[before])
    assert not ((one.t > 1.75) & (one.t < 2.25)).any()
    after = one.t > 2.0
    np.testing.assert_allclose(two.q[after], one.q[after] + 100.0, atol=1e-6)


def test_segments_define_holes():
    """Oracle: more than 1.5 median steps is a hole, less is jitter; nothing is lost."""
    t = np.array([0.0, 1.0, 2.0, 3.4, 4.4, 6.0, 7.0])
    assert segments(t) == [slice(0, 5), slice(5, 7)]
    assert segments(t[:1]) == [slice(0, 1)]


def test_short_segments_are_dropped_aloud():
    """Property: a segment too short for a filter goes, and the history says so."""
    data = with_hole(with_hole(sine(1.0), 2.0, 3.0), 3.005, 3.5)
    filtered = low_pass(data, 10.0)
    assert len(filtered) == len(data) - 5
    assert "Dropped 1 segments with fewer than 15 samples (5 rows)" in filtered.history[-2]


def test_trim_and_drop_rest():
    """Oracle: every segment loses both ends; a row goes only if every joint is slow."""
    data = trim(with_hole(sine(1.0), 1.0, 2.0), 0.1)
    assert [len(data.t[part]) for part in segments(data.t)] == [800, 1800]
    dq = np.array([[0.0, 0.0], [0.03, 0.0], [0.01, -0.05], [0.019, -0.019]])
    rested = drop_rest(Recording(t=np.arange(4.0), q=dq, dq=dq), 0.02)
    assert rested.t.tolist() == [1.0, 2.0]
    assert "Dropped 2 rows at rest" in rested.history[0]
    with pytest.raises(RecordingError, match="no sample is left"):
        drop_rest(Recording(t=np.arange(4.0), q=dq, dq=dq), 1.0)


@given(cuts=st.lists(st.floats(0.01, 0.99), min_size=2, max_size=2, unique=True))
def test_split_parts_are_disjoint_and_whole(cuts):
    """Property: adjoining parts hold every sample once and in order."""
    a, b = sorted(cuts)
    data = sine(1.0, rate=200.0)
    try:
        parts = split(data, Split((0.0, a), (a, b), (b, 1.0)))
    except RecordingError as error:
        assert b - a < 0.01, error  # noqa: PT017
        return
    np.testing.assert_array_equal(np.concatenate([part.t for part in parts]), data.t)
    assert [part.name for part in parts] == ["train", "validation", "test"]


def test_a_rebuilt_clock_loses_no_row_at_the_ends_of_a_log():
    """Oracle: prepared rows 2.3 ms early stay at the beginning of the log; within it two go."""
    data = sine(1.0, rate=1000.0)
    shares = Split((0.0, 0.5), (0.5, 0.75), (0.75, 1.0))
    raw = split(data, shares)
    early = prepared_parts(
        data, shares, Preparation(), lambda part, _: part.replace(t=part.t - 0.0023)
    )
    assert [len(a) - len(b) for a, b in zip(raw, early, strict=True)] == [0, 2, 2]
    assert early[0].t[0] == data.t[0] - 0.0023


def test_split_without_samples_is_told():
    """Property: a part that falls into a hole is an error, not an empty array."""
    data = with_hole(sine(1.0), 1.0, 3.0)
    with pytest.raises(RecordingError, match=r"no sample is left .* the validation part"):
        split(data, Split((0.0, 0.2), (0.4, 0.5), (0.6, 1.0)))


def test_prepare_does_nothing_by_default():
    """Oracle: a complete recording without a recipe passes unchanged, to the bit."""
    data = sine(1.0).replace(ddq=np.zeros((4000, 2)), tau=np.ones((4000, 2)))
    done = prepare(data)
    assert done.history == ()
    for key in ("t", "q", "dq", "ddq", "tau"):
        assert np.array_equal(getattr(done, key), getattr(data, key))


@pytest.mark.parametrize("name", ["butterworth", "average", "savitzky-golay"])
@pytest.mark.parametrize("measured", [True, False])
def test_prepare_recovers_the_motion(name, measured):
    """Oracle: through every filter, dq, ddq and the viscous column are those of the sine."""
    data = sine(0.5, seconds=8.0)
    w = np.pi
    rng = np.random.default_rng(5)
    noise = 1e-6 * rng.normal(size=data.q.shape)
    data = data.replace(q=data.q + noise, dq=data.dq if measured else None, tau=-w * data.q)
    preparation = Preparation(
        filter=name, cutoff_hz=10.0, window_s=0.051, rate_hz=100.0, trim_s=0.5, rest_speed=0.02
    )
    done = prepare(data, preparation, Friction(("viscous", "offset")))
    gain = np.exp(-((w * 0.051) ** 2) / 24) if name == "average" else 1.0
    exact = -w * w * np.stack([np.sin(w * done.t), np.cos(w * done.t)], axis=1)
    np.testing.assert_allclose(
        done.dq, gain * w * np.cos(w * done.t[:, None] + [0, np.pi / 2]), atol=2e-3
    )
    np.testing.assert_allclose(done.ddq, gain**2 * exact, atol=0.03)
    np.testing.assert_allclose(done.tau, gain * -w * exact / (-w * w), atol=1e-3)
    np.testing.assert_allclose(done.columns[..., 0], done.dq, atol=5e-3)
    np.testing.assert_allclose(done.columns[..., 1], 1.0, atol=1e-9)
    assert done.rate_hz == pytest.approx(100.0)


def test_history_tells_every_step_in_order():
    """Property: the history is the pipeline, one sentence per step."""
    preparation = Preparation(
        clock_tick=1e-3, max_gap_s=0.02, filter="butterworth", cutoff_hz=10.0,
        derivative="position", trim_s=0.1, rate_hz=100.0, rest_speed=0.02,
    )  # fmt: skip
    done = prepare(sine(1.0), preparation, Friction(("viscous",)))
    words = [sentence.split()[0] for sentence in done.history]
    assert words == [
        "Dropped", "Rebuilt", "Resampled", "Set", "Low-passed", "Differentiated",
        "Differentiated", "Added", "Low-passed", "Trimmed", "Kept", "Dropped",
    ]  # fmt: skip
