"""Preprocessing against signals known in closed form; nothing may look across a hole."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runtime.errors import RecordingError
from runtime.preprocessing import (
    Preparation,
    Split,
    decimate,
    differentiate,
    drop_rest,
    low_pass,
    moving_average,
    prepare,
    repair_clock,
    resample,
    savitzky_golay,
    segments,
    split,
    trim,
)
from runtime.recording import Friction, Recording


def sine(hz: float, rate: float = 1000.0, seconds: float = 4.0, **more) -> Recording:
    t = np.arange(round(rate * seconds)) / rate
    w = 2 * np.pi * hz
    q = np.stack([np.sin(w * t), np.cos(w * t)], axis=1)
    dq = w * np.stack([np.cos(w * t), -np.sin(w * t)], axis=1)
    return Recording(t=t, q=q, dq=dq, **more)


def with_hole(recording: Recording, first: float, last: float) -> Recording:
    keep = (recording.t < first) | (recording.t >= last)
    return recording.take(keep, "Cut a hole.")


def middle(recording: Recording, seconds: float = 1.0) -> np.ndarray:
    t = recording.t
    return (t > t[0] + seconds) & (t < t[-1] - seconds)


@pytest.mark.parametrize("hz", [1.0, 5.0, 10.0, 14.0, 40.0])
def test_low_pass_gain_and_phase(hz):
    """Oracle: a sine leaves with gain 1/(1 + (f/f_c)⁸) and without delay, below, at, above f_c.

    The tolerance is the warping of the bilinear transform at 1 kHz (tan(πf/f_s) against πf/f_s).
    """
    data = sine(hz)
    inside = middle(data)
    filtered = low_pass(data, 10.0)
    warped = np.tan(np.pi * hz / 1000.0) / np.tan(np.pi * 10.0 / 1000.0)
    gain = 1.0 / (1.0 + warped**8)
    assert gain == pytest.approx(1.0 / (1.0 + (hz / 10.0) ** 8), rel=0.05, abs=1e-5)
    np.testing.assert_allclose(filtered.q[inside], gain * data.q[inside], atol=2e-5)


def test_low_pass_treats_all_signals_alike():
    """Property: a relation τ = a q + b dq + Cφ between signals survives the filter exactly."""
    data = sine(3.0)
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(len(data), 2, 2))
    tau = 2.0 * data.q - 0.1 * data.dq + columns @ [0.3, -0.7]
    data = data.replace(tau=tau, ddq=data.q, columns=columns, column_names=("a", "b"))
    for step in (
        lambda r: low_pass(r, 20.0),
        lambda r: moving_average(r, 0.051),
        lambda r: savitzky_golay(r, 0.051),
        lambda r: resample(r, 730.0, 0.01),
    ):
        f = step(data)
        np.testing.assert_allclose(
            f.tau, 2.0 * f.q - 0.1 * f.dq + f.columns @ [0.3, -0.7], atol=1e-11
        )
        assert not np.array_equal(f.columns, columns)
        assert len(f.history) == 1


def test_low_pass_keeps_constants_and_lines_up_to_the_ends():
    """Oracle: the odd padding makes the filter exact on straight lines, ends included."""
    t = np.arange(2000) / 1000.0
    data = Recording(t=t, q=np.stack([3.0 * t - 1.0, np.full_like(t, 7.0)], axis=1))
    np.testing.assert_allclose(low_pass(data, 10.0).q, data.q, atol=1e-5)
    np.testing.assert_allclose(moving_average(data, 0.051).q, data.q, atol=1e-11)


def test_moving_average_gain():
    """Oracle: the mean over 51 samples multiplies a sine by the Dirichlet kernel, phase 0."""
    data = sine(7.0)
    smooth = moving_average(data, 0.051)
    x = np.pi * 7.0 / 1000.0
    gain = np.sin(51 * x) / (51 * np.sin(x))
    inside = middle(data)
    np.testing.assert_allclose(smooth.q[inside], gain * data.q[inside], atol=1e-12)
    assert "51 samples" in smooth.history[0]


def test_savitzky_golay_is_exact_on_polynomials():
    """Oracle: degree 4 reproduces a quartic, and its derivatives fill dq and ddq."""
    t = np.arange(500) / 100.0
    p = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3, -0.05])
    data = savitzky_golay(Recording(t=t, q=p(t)[:, None]), 0.21, 4)
    np.testing.assert_allclose(data.q[:, 0], p(t), rtol=1e-9)
    np.testing.assert_allclose(data.dq[:, 0], p.deriv()(t), atol=1e-8)
    np.testing.assert_allclose(data.ddq[:, 0], p.deriv(2)(t), atol=1e-6)
    measured = savitzky_golay(Recording(t=t, q=p(t)[:, None], dq=p.deriv()(t)[:, None]), 0.21, 4)
    np.testing.assert_allclose(measured.ddq[:, 0], p.deriv(2)(t), atol=1e-8)


def test_differentiation_error_falls_as_h_squared():
    """Derivative: halving the step divides the error by four, ends included."""
    errors = []
    for rate in (100.0, 200.0, 400.0):
        t = np.arange(round(2 * rate) + 1) / rate
        done = differentiate(Recording(t=t, q=np.sin(3 * t)[:, None]))
        errors.append(
            (
                np.abs(done.dq[:, 0] - 3 * np.cos(3 * t)).max(),
                np.abs(done.ddq[:, 0] + 9 * np.sin(3 * t))[5:-5].max(),
            )
        )
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert (ratios > 3.7).all()
    assert (ratios < 4.3).all()


def test_measured_derivatives_are_kept_unless_asked():
    """Property: differentiate fills in; only from_position overrides a measurement."""
    data = sine(1.0).replace(ddq=np.full((4000, 2), 5.0))
    assert differentiate(data).dq is data.dq
    assert differentiate(data).ddq is data.ddq
    anew = differentiate(data.replace(dq=np.zeros((4000, 2))), from_position=True)
    np.testing.assert_allclose(anew.dq, data.dq, atol=1e-3)


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


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    repeats=st.floats(0.0, 0.2),
    skips=st.floats(0.0, 0.2),
    quantum=st.sampled_from([0.0, 1e-6]),
)
def test_clock_repair_recovers_the_exact_clock(seed, repeats, skips, quantum):
    """Property: a 1 kHz motion logged with repeats, skips and jitter gets its own clock back."""
    rng = np.random.default_rng(seed)
    truth = np.arange(3000) * 1e-3
    kept = rng.random(3000) >= skips
    kept[0] = True
    truth = truth[kept]
    q = np.stack([np.sin(2 * truth), 0.8 * np.cos(3 * truth)], axis=1)
    dq = np.stack([2 * np.cos(2 * truth), -2.4 * np.sin(3 * truth)], axis=1)
    if quantum:
        q = np.round(q / quantum) * quantum
    again = np.repeat(np.arange(len(truth)), 1 + (rng.random(len(truth)) < repeats))
    stamps = truth[again] + 1e-3 * (np.diff(again, prepend=-1) == 0)
    stamps = np.sort(stamps + rng.uniform(0.0, 0.8e-3, len(again)))
    stamps += 1e-7 * np.arange(len(again))
    log = Recording(t=stamps, q=q[again], dq=dq[again], tau=rng.normal(size=(len(again), 2)))
    fixed = repair_clock(log, 1e-3)
    assert len(fixed) == len(truth)
    np.testing.assert_allclose(fixed.t - fixed.t[0], truth - truth[0], atol=1e-9)


def test_clock_at_rest_follows_the_log():
    """Oracle: where the robot stands (q still changes by noise) the logged time counts ticks."""
    rng = np.random.default_rng(2)
    t = np.arange(2000) * 1e-3
    t = np.delete(t, rng.choice(np.arange(1, 1999), 300, replace=False))
    q = np.stack([1e-6 * rng.normal(size=len(t)), np.ones(len(t))], axis=1)
    dq = 1e-3 * rng.normal(size=q.shape)
    jittered = t + rng.uniform(-2e-4, 2e-4, len(t))
    fixed = repair_clock(Recording(t=jittered, q=q, dq=dq), 1e-3)
    np.testing.assert_allclose(fixed.t - fixed.t[0], t - t[0], atol=1e-9)


def test_clock_that_cannot_be_is_refused():
    """Property: no dq, no motion, or a dq of other units is told instead of a wrong clock."""
    data = sine(1.0)
    with pytest.raises(RecordingError, match="from dq, but there is none"):
        repair_clock(data.replace(dq=None), 1e-3)
    with pytest.raises(RecordingError, match="never moves"):
        repair_clock(data.replace(q=np.zeros_like(data.q)), 1e-3)
    with pytest.raises(RecordingError, match=r"runs 7\.\d* s, but the log 3.999 s"):
        repair_clock(data.replace(dq=data.dq / 2), 1e-3)


def test_resample_fills_small_gaps_and_keeps_large_ones():
    """Oracle: linear motion comes back exactly on the grid; the hole is where it was."""
    rng = np.random.default_rng(3)
    t = np.arange(1000) * 1e-2 + rng.uniform(-2e-3, 2e-3, 1000)
    t[0] = 0.0
    keep = np.ones(1000, dtype=bool)
    keep[[100, 101, 300]] = False
    keep[500:540] = False
    q = np.stack([2.0 * t, 1.0 - t], axis=1)
    data = resample(Recording(t=t[keep], q=q[keep]), 100.0, 0.05)
    np.testing.assert_allclose(data.q, np.stack([2 * data.t, 1 - data.t], axis=1), atol=1e-12)
    np.testing.assert_allclose(data.t * 100.0, np.round(data.t * 100.0), atol=1e-9)
    assert len(segments(data.t)) == 2
    assert "1 longer ones left as holes" in data.history[0]
    assert len(data) >= 958
    with pytest.raises(RecordingError, match=r"more than 1\.5 steps"):
        resample(data, 100.0, 0.015)


def test_decimate_keeps_one_clock_for_all_segments():
    """Oracle: instants are multiples of the new step, before and after a hole; values unchanged."""
    data = with_hole(sine(1.0), 1.003, 1.777)
    slow = decimate(data, 100.0)
    np.testing.assert_allclose(slow.t * 100.0, np.round(slow.t * 100.0), atol=1e-9)
    np.testing.assert_array_equal(slow.q, data.q[np.isin(data.t, slow.t)])
    assert len(segments(slow.t)) == 2
    assert "Kept every 10. instant" in slow.history[-1]
    other = decimate(sine(1.0), 300.0)
    assert other.rate_hz == pytest.approx(300.0)
    np.testing.assert_allclose(other.q[:, 0], np.sin(2 * np.pi * other.t), atol=1e-5)
    with pytest.raises(RecordingError, match="1000 Hz or less, got 2000 Hz"):
        decimate(data, 2000.0)


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


def test_uneven_clock_is_never_filtered():
    """Property: filters and decimation refuse a jittering clock and say what to set."""
    rng = np.random.default_rng(4)
    t = np.arange(500) * 1e-2 + rng.uniform(0, 3e-3, 500)
    data = Recording(t=t, q=np.sin(t)[:, None])
    steps = (
        lambda: low_pass(data, 5.0),
        lambda: moving_average(data, 0.1),
        lambda: savitzky_golay(data, 0.1),
        lambda: decimate(data, 20.0),
    )
    for step in steps:
        with pytest.raises(RecordingError, match="set max_gap_s to resample first"):
            step()
    with pytest.raises(RecordingError, match="between 0 and 500 Hz"):
        low_pass(sine(1.0), 500.0)
    with pytest.raises(RecordingError, match="widen window_s"):
        savitzky_golay(sine(1.0), 0.003)


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


def test_coulomb_column_is_filtered_after_tanh():
    """Oracle: the filtered column is the filter of tanh(dq/ε), not tanh of the filtered dq."""
    data = sine(1.0)
    prepared = prepare(
        data, Preparation(filter="butterworth", cutoff_hz=10.0), Friction(("coulomb",), 0.05)
    )
    by_hand = low_pass(data.replace(q=np.tanh(data.dq / 0.05)), 10.0).q
    np.testing.assert_allclose(prepared.columns[..., 0], by_hand, atol=1e-12)
    assert np.abs(np.tanh(prepared.dq / 0.05) - by_hand).max() > 0.05


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
