"""Text → recordings: what is read is what was meant."""

import contextlib
import io
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runtime.errors import RecordingError
from runtime.recording import read_recording
from runtime.recording.consistency import unwrap
from tests.runtime.logs import HEADER, csv_text, motion, written


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


def test_quoted_cells_hold_separators(tmp_path):
    """Oracle: the log with a remark in quotes beside it, and with decimal commas in quotes."""
    t, q, dq = motion()
    head, *lines = csv_text(t, q, dq).splitlines()
    noted = "\n".join([f"{head},note", *(f'{line},"ok, ""fine"""' for line in lines)])
    german = [",".join(f'"{cell.replace(".", ",")}"' for cell in x.split(",")) for x in lines]
    for text in (noted, "\n".join([head, *german])):
        recording = read_recording(written(tmp_path, text))
        assert np.array_equal(recording.q, q)
        assert np.array_equal(recording.t, t)


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
        "us as s": ("a.csv", csv_text(1e6 * t, q, dq), "time looks like us: .*and at 1"),
        "ns as s": ("a.csv", csv_text(1e9 * t, q, dq), "time looks like ns: .*and at 1"),
        "s as ms": ("a.csv", csv_text(1e-3 * t, q, dq), "time looks like s declared as ms"),
        "binary": ("a.csv", bytes(range(256)) * 8, "expected to be UTF-8 text"),
        "UTF-16": ("a.csv", good.encode("utf-16"), "expected to be UTF-8 text"),
        "NULs": ("a.csv", b"t,q1\n\0\0\0\0", "expected to be UTF-8 text"),
        "suffix": ("a.foo", "x", "ends in .csv, .txt"),
        "truncated NPZ": ("a.npz", archive[: len(archive) // 2], "truncated or not an NPZ"),
        "empty NPZ": ("a.npz", b"", "truncated or not an NPZ"),
        "text NPZ": ("a.npz", b"not a zip", "pickled|truncated or not an NPZ"),
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


def test_states_drawn_at_random_are_not_unwrapped():
    """Property: where rows are no motion, a difference near one turn means nothing."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (500, 3))
    kept, jumps = unwrap(q)
    assert not jumps.any()
    assert kept is q
