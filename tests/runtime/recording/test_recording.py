"""Recordings: what is written is read again, and shapes and derivatives are checked."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from runtime.errors import RecordingError, RuntimeFault
from runtime.recording import Recording, read_recording, write_recording
from runtime.recording import recording as recordings
from runtime.recording.consistency import check_consistency
from runtime.recording.recording import require_clock
from tests.runtime.logs import motion

finite = st.floats(-1e8, 1e8, allow_subnormal=True)


@settings(max_examples=40, deadline=None)
@given(
    q=arrays(np.float64, st.tuples(st.integers(1, 6), st.integers(1, 4)), elements=finite),
    steps=st.lists(st.floats(1e-6, 1e3), min_size=5, max_size=5),
    suffix=st.sampled_from([".csv", ".npz"]),
    optional=st.booleans(),
)
def test_round_trip_is_exact(tmp_path_factory, q, steps, suffix, optional):
    """Property: writing and reading gives the same bits back, whatever the numbers."""
    q = np.unwrap(q, axis=0) if np.abs(q).max() < 100 else q
    t = np.concatenate([[0.25], 0.25 + np.cumsum(steps)])[: len(q)]
    extra = {"ddq": q * 0.3, "tau": -q / 3} if optional else {}
    first = Recording(t=t, q=q, **extra)
    path = tmp_path_factory.mktemp("round") / f"log{suffix}"
    write_recording(first, path)
    second = read_recording(path)
    jumps = any("Unwrapped" in sentence for sentence in second.history)
    for key in ("t", "ddq", "tau", *([] if jumps else ["q"])):
        a, b = getattr(first, key), getattr(second, key)
        assert (a is None and b is None) or np.array_equal(a, b)
    assert second.dq is None
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_npz_carries_columns_names_and_history(tmp_path):
    """Property: an NPZ gives back everything that travels with the data."""
    t, q, dq = motion()
    columns = np.stack([dq, np.ones_like(dq), q], axis=-1)
    first = Recording(
        t=t,
        q=q,
        dq=dq,
        columns=columns,
        column_names=("viscous", "offset", "x"),
        name="demo",
        joint_names=("a", "b"),
        history=("Made.",),
    )
    write_recording(first, tmp_path / "x.npz")
    second = read_recording(tmp_path / "x.npz")
    assert np.array_equal(second.columns, columns)
    assert second.column_names == first.column_names
    assert (second.name, second.joint_names) == ("demo", ("a", "b"))
    assert second.history[0] == "Made."
    assert len(second.source["x.npz"]) == 64


def test_recording_is_read_only_and_counts(tmp_path):
    """Property: data cannot be changed behind the history, and the caller's array stays his."""
    t, q, dq = motion()
    recording = Recording(t=t, q=q, dq=dq)
    with pytest.raises(ValueError, match="read-only"):
        recording.q[0, 0] = 1.0
    q[0, 0] += 0.0
    assert (len(recording), recording.n_joints) == (400, 2)
    assert recording.duration == pytest.approx(3.99)
    assert recording.rate_hz == pytest.approx(100.0)
    part = recording.take(slice(0, 10), "First ten.")
    assert (len(part), part.history) == (10, ("First ten.",))
    with pytest.raises(RecordingError, match="no sample is left"):
        recording.take(np.zeros(400, dtype=bool), "None.")


def test_missing_file_folder_without_recipe_and_bad_target(tmp_path):
    """Property: paths that lead nowhere say so, and what to give instead."""
    with pytest.raises(RecordingError, match=r"no file or folder .*known data sets .*panda_gaz"):
        read_recording(tmp_path / "nothing.csv")
    with pytest.raises(RecordingError, match=r"has no recipe.*write .*recipe.toml"):
        read_recording(tmp_path)
    t, q, _ = motion()
    with pytest.raises(RecordingError, match=r"ends in .csv, .npz, .parquet, got 'x.mat'"):
        write_recording(Recording(t=t, q=q), tmp_path / "x.mat")
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(RuntimeFault, match="cannot write"):
        write_recording(Recording(t=t, q=q), tmp_path / "file" / "x.csv")


def test_a_name_that_no_file_can_have_is_refused():
    """Property: the system refuses to look for it; the sentence is that of a missing file."""
    with pytest.raises(RecordingError, match="there is no file or folder '"):
        read_recording("n" * 300)


def test_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    """Property: a write that fails half-way leaves the old file and no other behind."""
    t, q, _ = motion()
    path = tmp_path / "x.csv"
    write_recording(Recording(t=t, q=q), path)
    before = path.read_bytes()

    def broken(*_: object, **__: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(np, "savetxt", broken)
    with pytest.raises(RuntimeFault, match="disk full"):
        write_recording(Recording(t=t, q=2 * q), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("fields", "match"),
    [
        ({"q": np.zeros((3, 2))}, "one row per instant"),
        ({"dq": np.zeros((4, 3))}, "expected dq of the shape"),
        ({"columns": np.zeros((4, 2, 1))}, "one name per column"),
        ({"joint_names": ("a",)}, "2 joint names, got 1"),
        ({"t": np.array([0.0, 1.0, np.nan, 3.0])}, "time that increases"),
    ],
)
def test_recording_checks_its_shapes(fields, match):
    """Property: arrays that do not belong together never become a recording."""
    good = {"t": np.arange(4.0), "q": np.zeros((4, 2))}
    with pytest.raises(RecordingError, match=match):
        Recording(**{**good, **fields})


def test_consistency_warns_of_other_factors_and_ignores_noise():
    """Oracle: a factor 2 is a warning, a factor 1 with noise and a joint at rest is silence."""
    t, q, dq = motion()
    rng = np.random.default_rng(0)
    noisy = Recording(t=t, q=q + 1e-4 * rng.normal(size=q.shape), dq=dq)
    assert check_consistency(noisy).history == ()
    still = np.array([1.0, 0.0])
    assert check_consistency(Recording(t=t, q=q * still, dq=dq * still)).history == ()
    warned = check_consistency(Recording(t=t, q=q, dq=2 * dq))
    assert "Δq/Δt over dq is 0.5 at joint 1, 0.5 at joint 2" in warned.history[0]
    far = check_consistency(Recording(t=t, q=q + 90.0))
    assert "more than four turns" in far.history[0]
    slow = check_consistency(Recording(t=1e3 * t, q=q))
    assert "check the unit of time" in slow.history[0]


def test_a_clock_is_checked_once(monkeypatch):
    """Property: fields beside t change without another look at the clock, shapes are checked."""
    checks = []
    monkeypatch.setattr(recordings, "require_clock", lambda t: checks.append(require_clock(t)))
    one = Recording(t=np.arange(5.0), q=np.zeros((5, 2)), name="x")
    two = one.replace(dq=np.ones((5, 2))).noted("Noted.")
    assert len(checks) == 1
    assert (two.name, two.history, two.dq.flags.writeable) == ("x", ("Noted.",), False)
    assert one.dq is None
    with pytest.raises(RecordingError, match="expected tau of the shape"):
        two.replace(tau=np.ones((4, 2)))
    with pytest.raises(RecordingError, match="expected time that increases"):
        two.replace(t=np.zeros(5))
    assert len(checks) == 1


def test_the_rate_is_that_of_the_present_clock():
    """Property: copies share the rate of their clock, and a new clock has its own."""
    one = Recording(t=np.arange(5.0) / 100.0, q=np.zeros((5, 2)))
    assert one.rate_hz == pytest.approx(100.0, rel=1e-12)
    assert one.noted("Noted.").rate_hz == one.rate_hz
    assert one.take(slice(0, 5, 2), "Thinned.").rate_hz == pytest.approx(50.0, rel=1e-12)
    assert one.replace(t=np.arange(5.0)).rate_hz == 1.0
