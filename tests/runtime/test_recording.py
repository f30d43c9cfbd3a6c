"""Files → recordings: what is read is what was meant, and what cannot be read says why."""

import contextlib
import io
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from runtime.errors import RecordingError, RuntimeFault
from runtime.recording import (
    Recipe,
    Recording,
    check_consistency,
    read_recording,
    write_recording,
)
from runtime.recording.consistency import unwrap
from runtime.recording.recipe_file import recipe_from_table

HEADER = "t,q1,q2,dq1,dq2,tau1,tau2"


def motion(n: int = 400, rate: float = 100.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(n) / rate
    q = np.stack([np.sin(2 * t), 0.5 * np.cos(3 * t)], axis=1)
    dq = np.stack([2 * np.cos(2 * t), -1.5 * np.sin(3 * t)], axis=1)
    return t, q, dq


def csv_text(t, q, dq, tau=None, header: str = HEADER, separator: str = ",") -> str:
    tau = np.ones_like(q) if tau is None else tau
    rows = np.hstack([t[:, None], q, dq, tau])
    lines = [separator.join(f"{value:.17g}" for value in row) for row in rows]
    return "\n".join([header.replace(",", separator), *lines]) + "\n"


def written(folder: Path, content: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


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


def test_garbage_repeated_header_bad_rows_and_truncated_end(tmp_path):
    """Oracle: the rows that are whole come through, and the history names the other lines."""
    t, q, dq = motion()
    lines = csv_text(t, q, dq).splitlines()
    lines[10] = lines[10].replace(",", ",7,", 1)  # one cell too many, line 12 of the file
    lines[20] = lines[20].rsplit(",", 1)[0] + ",1e293"
    lines[30] = "Segmentation fault (core dumped)"
    lines[40] = "1e293," + lines[40].split(",", 1)[1]
    lines.insert(200, HEADER)
    lines[-1] = lines[-1][:20]
    text = "\n".join(["controller 4.2 started", "", *lines])
    recording = read_recording(written(tmp_path, text))
    told = " ".join(recording.history)
    assert len(recording) == 395
    assert "Dropped 5 of 400 rows" in told
    assert "lines 13, 23, 33, 43, 404" in told
    assert "1 repeated headers" in told
    assert "2 lines before the header" in told
    good = np.delete(np.arange(400), [9, 19, 29, 39, 399])
    assert np.array_equal(recording.q, q[good])
    assert np.array_equal(recording.t, t[good])


def test_semicolons_and_decimal_commas(tmp_path):
    """Oracle: the same log in the continental dialect gives the same recording, and says so."""
    t, q, dq = motion()
    text = csv_text(t, q, dq, separator=";").replace(".", ",")
    recording = read_recording(written(tmp_path, text))
    assert np.array_equal(recording.q, q)
    assert np.array_equal(recording.dq, dq)
    assert any("semicolons" in sentence for sentence in recording.history)


@pytest.mark.parametrize("header", ["# t\tq1\tq2", "noise 1 2\nt\tq1\tq2", "#t q1 q2"])
def test_tabs_blanks_and_commented_headers(tmp_path, header):
    """Oracle: the dialects of numpy.savetxt and of spreadsheets give the same numbers."""
    t, q, _ = motion()
    separator = "\t" if "\t" in header else " "
    rows = [separator.join(f"{x:.17g}" for x in row) for row in np.column_stack([t, q])]
    recording = read_recording(written(tmp_path, "\n".join([header, *rows]), "a.txt"))
    assert np.array_equal(recording.q, q)
    assert np.array_equal(recording.t, t)


def test_recipe_with_a_rate_or_column_numbers(tmp_path):
    """Oracle: a log without a clock takes the stated rate; one without a header, column numbers."""
    t, q, dq = motion()
    path = written(tmp_path, csv_text(t, q, dq).replace("t,q1", "x,q1", 1))
    recording = read_recording(path, recipe_from_table({"time": {"rate_hz": 50.0}}))
    np.testing.assert_allclose(recording.t, 2 * t, atol=1e-12)
    assert recording.dq is None or any("0.5 at joint 1" in s for s in recording.history)
    bare = written(tmp_path, "started\n" + csv_text(t, q, dq).split("\n", 1)[1], "bare.csv")
    table = {
        "time": {"column": 0, "unit": "s"},
        "position": {"columns": [2, 1], "unit": "rad"},
    }
    swapped = read_recording(bare, recipe_from_table(table))
    assert np.array_equal(swapped.q, q[:, ::-1])
    assert swapped.recipe is not None


def test_rows_written_twice_are_left_out(tmp_path):
    """Oracle: a row with the stamp and the values of the row before adds nothing."""
    t, q, dq = motion()
    lines = csv_text(t, q, dq).splitlines()
    lines.insert(50, lines[50])
    recording = read_recording(written(tmp_path, "\n".join(lines)))
    assert np.array_equal(recording.t, t)
    assert any("1 rows that were written twice" in sentence for sentence in recording.history)


def test_wrapped_angles_are_unwrapped(tmp_path):
    """Oracle: an angle folded into ±π comes back as it was, and the history counts the jumps."""
    t, _, _ = motion()
    q = np.stack([3.0 * t - 1.0, np.sin(t)], axis=1)
    dq = np.stack([np.full_like(t, 3.0), np.cos(t)], axis=1)
    folded = (q + np.pi) % (2 * np.pi) - np.pi
    recording = read_recording(written(tmp_path, csv_text(t, folded, dq)))
    np.testing.assert_allclose(recording.q, q, atol=1e-12)
    assert any("Unwrapped 2 jumps" in s and s.endswith("joints 1.") for s in recording.history)


def npz_bytes(**arrays_: object) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays_)
    return buffer.getvalue()


def malformed() -> dict[str, tuple[str, bytes, str]]:
    """Name → (file name, content, what the message must say)."""
    t, q, dq = motion()
    good = csv_text(t, q, dq)
    lines = good.splitlines()
    unsorted_ = [*lines[:100], lines[50], *lines[100:]]
    archive = npz_bytes(t=t, q=q, dq=dq)
    objects = npz_bytes(t=t, q=np.array([{"a": 1}] * 400, dtype=object))
    nan_rows = [
        line if i % 3 != 2 else line.rsplit(",", 1)[0] + ",nan" for i, line in enumerate(lines)
    ]
    huge = [
        line if i % 3 != 2 else line.rsplit(",", 1)[0] + ",1e293" for i, line in enumerate(lines)
    ]
    cases: dict[str, tuple[str, str | bytes, str]] = {
        "empty file": ("a.csv", "", "a.csv is empty"),
        "blank file": ("a.csv", "\n\n  \n", "a.csv is empty"),
        "header only": ("a.csv", HEADER + "\n", "a header but no rows below"),
        "no header": ("a.csv", "\n".join(lines[1:]), "header line with the columns q1"),
        "wrong width": ("a.csv", good.replace(",tau1,tau2", ""), "names 5 columns.*mostly 7"),
        "missing time": ("a.csv", good.replace("t,q1", "x,q1", 1), "columns t, but t is missing"),
        "missing column": ("a.csv", good.replace("tau2", "foo"), "tau1 … tau2 .* tau2 does not"),
        "missing joint": ("a.csv", good.replace("q2,dq1", "q3,dq1"), "q2 does not match"),
        "extra joint": ("a.csv", good.replace(",tau2", ",tau3"), "tau2 does not match"),
        "column twice": ("a.csv", good.replace(",q2", ",q1", 1), "'q1' twice"),
        "NaN rows": ("a.csv", "\n".join(nan_rows), "133 of 400 rows are corrupt .*lines 3, 6"),
        "1e293 rows": ("a.csv", "\n".join(huge), "133 of 400 rows are corrupt"),
        "unsorted": ("a.csv", "\n".join(unsorted_), r"from 0.98 s to 0.49 s at row 99"),
        "degrees": ("a.csv", csv_text(t, np.rad2deg(q), dq), "positions look like degrees.*57.3"),
        "deg/s": ("a.csv", csv_text(t, q, np.rad2deg(dq)), "velocities look like degrees"),
        "ms as s": ("a.csv", csv_text(1e3 * t, q, dq), "time looks like ms: .*0.001.*and at 1"),
        "s as ms": ("a.csv", csv_text(1e-3 * t, q, dq), "time looks like s declared as ms"),
        "binary": ("a.csv", bytes(range(256)) * 8, "expected to be UTF-8 text"),
        "UTF-16": ("a.csv", good.encode("utf-16"), "expected to be UTF-8 text"),
        "NULs": ("a.csv", b"t,q1\n\0\0\0\0", "expected to be UTF-8 text"),
        "suffix": ("a.mat", "x", "ends in .npz, .csv"),
        "truncated NPZ": ("a.npz", archive[: len(archive) // 2], "truncated or no NPZ"),
        "empty NPZ": ("a.npz", b"", "truncated or no NPZ"),
        "text NPZ": ("a.npz", b"not a zip", "pickled|truncated or no NPZ"),
        "pickle as NPZ": ("a.npz", pickle.dumps({"t": 1}), "pickled Python objects"),
        "object array": ("a.npz", objects, "pickled Python objects"),
        "no q": ("a.npz", npz_bytes(t=t, x=q), "expected to hold the array 'q'"),
        "no t": ("a.npz", npz_bytes(q=q), "expected to hold the array 't'"),
        "joint-major": ("a.npz", npz_bytes(t=t, q=q.T), "that samples are rows"),
        "complex": ("a.npz", npz_bytes(t=t, q=q + 0j), "real numbers.*complex128"),
        "3D": ("a.npz", npz_bytes(t=t, q=q[:, :, None]), "samples, joints"),
        "tau width": ("a.npz", npz_bytes(t=t, q=q, tau=q[:, :1]), "tau of the shape"),
        "time 2D": ("a.npz", npz_bytes(t=q, q=q), "one column of time, got 2"),
    }
    return {
        name: (file, text.encode() if isinstance(text, str) else text, match)
        for name, (file, text, match) in cases.items()
    }


@pytest.mark.parametrize("case", malformed())
def test_malformed_files_say_what_is_wrong(tmp_path, case):
    """Property: bad input is one sentence of RecordingError, never a traceback of a library."""
    file, content, match = malformed()[case]
    path = written(tmp_path, content, file)
    with pytest.raises(RecordingError, match=match) as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@settings(max_examples=150, deadline=None)
@given(data=st.binary(max_size=300), cut=st.integers(0, 3000), npz=st.booleans())
def test_no_bytes_crash_the_reader(tmp_path_factory, data, cut, npz):
    """Property: any damage to a file gives a recording or a RecordingError, nothing else."""
    t, q, dq = motion(40)
    whole = npz_bytes(t=t, q=q, dq=dq) if npz else csv_text(t, q, dq).encode()
    damaged = whole[:cut] + data + whole[cut + len(data) :]
    path = written(tmp_path_factory.mktemp("fuzz"), damaged, "a.npz" if npz else "a.csv")
    with contextlib.suppress(RecordingError):
        assert np.isfinite(read_recording(path).q).all()


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


def raw_folder(tmp_path: Path, order: tuple[int, ...] = (0, 1)) -> Path:
    t, q, _ = motion()
    written(tmp_path, "\n".join(f"{x:.17g}" for x in np.rad2deg(q).ravel()), "q.txt")
    tau = np.stack([np.cos(t), np.sin(t)], axis=1)[:, order]
    written(tmp_path, csv_text(t, tau, tau, header="ms,a,b,c,d,e,f"), "tau.csv")
    return tmp_path


def gear_recipe(**torque: object) -> Recipe:
    return recipe_from_table(
        {
            "time": {"rate_hz": 100.0},
            "position": {
                "file": "q.txt",
                "layout": "flat",
                "width": 2,
                "unit": "deg",
                "offset": [90.0, 0.0],
            },
            "torque": {"file": "tau.csv", "columns": ["a", "b"], "unit": "N*m", **torque},
            "gear": {"matrix": [[2.0, 0.0], [1.0, -4.0]]},
        }
    )


def test_recipe_settles_units_order_sign_and_gear(tmp_path):
    """Oracle: q = R⁻¹x + offset and τ = Rᵀx by hand, with degrees, another order and a sign."""
    t, q, _ = motion()
    recipe = gear_recipe(order=[1, 0], sign=[1, -1])
    recording = read_recording(raw_folder(tmp_path), recipe)
    x = np.stack([np.sin(t), -np.cos(t)], axis=1)
    expected_q = np.stack([q[:, 0] / 2, (q[:, 0] / 2 - q[:, 1]) / 4], axis=1)
    np.testing.assert_allclose(recording.q, expected_q + np.array([np.pi / 2, 0.0]), atol=1e-14)
    np.testing.assert_allclose(
        recording.tau, np.stack([2 * x[:, 0] + x[:, 1], -4 * x[:, 1]], axis=1), atol=1e-14
    )
    assert recording.rate_hz == pytest.approx(100.0)
    assert any("gear" in s and "signs" in s and "reordered" in s for s in recording.history)
    assert recording.recipe is recipe


def test_power_is_the_same_on_both_sides_of_the_gear(tmp_path):
    """Property: τᵀdq = τ_mᵀdq_m, the principle of virtual work, for the matrices of a recipe."""
    t, q, dq = motion()
    np.savez(tmp_path / "m.npz", t=t, q=q, dq=dq, tau=np.cos(q))
    recipe = recipe_from_table({"gear": {"matrix": [[30.0, 0.0], [20.0, -50.0]]}})
    recording = read_recording(tmp_path / "m.npz", recipe)
    motor = np.sum(np.cos(q) * dq, axis=1)
    np.testing.assert_allclose(np.sum(recording.tau * recording.dq, axis=1), motor, atol=1e-13)


def test_files_of_unlike_length_and_bad_flat_lines(tmp_path):
    """Oracle: a bad number spoils its sample only; a cut file costs its last samples."""
    folder = raw_folder(tmp_path)
    lines = (folder / "q.txt").read_text().splitlines()
    lines[21] = "1.2.3"
    written(folder, "\n".join(["# started", *lines[:-3]]), "q.txt")
    recording = read_recording(folder, gear_recipe())
    assert len(recording) == 397
    np.testing.assert_allclose(np.diff(recording.t)[9], 0.02)
    told = " ".join(recording.history)
    assert "Dropped 3 of 400 rows" in told
    assert "last sample was cut short" in told
    written(folder, "\n".join(lines[:100]), "q.txt")
    with pytest.raises(RecordingError, match="position 50, torque 400"):
        read_recording(folder, gear_recipe())


def test_folder_with_its_own_recipe_and_missing_file(tmp_path):
    """Property: recipe.toml inside a folder is found, and a file it names must be there."""
    t, q, _ = motion()
    np.savez(tmp_path / "run7.npz", stamp=1e3 * t, angle=q)
    text = """
    run = "7"
    [time]
    file = "run{run}.npz"
    key = "stamp"
    unit = "ms"
    [position]
    file = "run{run}.npz"
    key = "angle"
    unit = "rad"
    """
    written(tmp_path, text, "recipe.toml")
    recording = read_recording(tmp_path)
    np.testing.assert_allclose(recording.t, t, atol=1e-15)
    assert recording.name == tmp_path.name
    with pytest.raises(RecordingError, match=r"cannot read run8.npz .*No such file"):
        read_recording(tmp_path, run="8")
    one = read_recording(tmp_path / "run7.npz", tmp_path / "recipe.toml")
    assert np.array_equal(one.q, q)


def test_changed_published_file_is_told(tmp_path):
    """Property: bytes that are not the pinned ones are a warning in the history."""
    t, q, dq = motion()
    path = written(tmp_path, csv_text(t, q, dq))
    table = {"name": "x", "source": {"sha256": {"log.csv": "0" * 64}}}
    recording = read_recording(path, recipe_from_table(table))
    assert "not the published file that recipe 'x' pins" in recording.history[-1]


def test_states_drawn_at_random_are_not_unwrapped():
    """Property: where rows are no motion, a difference near one turn means nothing."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (500, 3))
    kept, jumps = unwrap(q)
    assert not jumps.any()
    assert kept is q
