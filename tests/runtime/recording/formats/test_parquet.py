"""Parquet and libfranka's CSV → recordings; the files are pyarrow's, the header libfranka's."""

import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runtime.errors import RecordingError
from runtime.recording import Recording, read_recording, write_recording
from runtime.recording.recipes.recipe_file import recipe_from_table
from runtime.recording.streamed import open_streamed
from tests.runtime.logs import motion


def columns(n: int = 400) -> dict[str, np.ndarray]:
    t, q, dq = motion(n)
    named = {"t": t}
    for key, values in (("q", q), ("dq", dq), ("tau", 3.0 + q)):
        named |= {f"{key}{j + 1}": values[:, j] for j in range(2)}
    return named


def lists(n: int = 400) -> dict[str, pa.Array]:
    t, q, dq = motion(n)
    fixed = pa.FixedSizeListArray.from_arrays(pa.array(q.ravel()), 2)
    return {"t": pa.array(t), "q": fixed, "dq": pa.array(dq.tolist())}


def test_columns_and_lists_give_the_same_bits(tmp_path):
    """Oracle: pyarrow's columns, and its lists, are read to the last bit over row groups."""
    t, q, dq = motion()
    for told in (columns(), lists()):
        pq.write_table(pa.table(told), tmp_path / "x.parquet", row_group_size=77)
        recording = read_recording(tmp_path / "x.parquet")
        assert np.array_equal(recording.t, t)
        assert np.array_equal(recording.q, q)
        assert np.array_equal(recording.dq, dq)
    assert recording.tau is None


def test_streamed_columns_are_copied_once(tmp_path):
    """Oracle: the bits of the log in memory; a recording holds the columns where they were put."""
    table = pa.table(columns())
    pq.write_table(table, tmp_path / "x.parquet", row_group_size=77)
    whole, log = read_recording(tmp_path / "x.parquet"), open_streamed(tmp_path / "x.parquet")
    raw = log.numbers(30, 330)
    part = log.recording_of(raw)
    for kind, key in (("position", "q"), ("velocity", "dq"), ("torque", "tau")):
        values = getattr(part, key)
        assert np.array_equal(values, getattr(whole, key)[30:330])
        assert np.shares_memory(values, raw[kind].values)
        assert values.flags.f_contiguous
        assert not values.flags.writeable
    pq.write_table(pa.table(lists()), tmp_path / "lists.parquet", row_group_size=77)
    held = open_streamed(tmp_path / "lists.parquet").block(30, 330)
    assert np.array_equal(held.q, whole.q[30:330])
    assert held.q.flags.c_contiguous


def test_round_trip_and_what_pyarrow_sees(tmp_path):
    """Oracle: what we write pyarrow reads, and we read it back to the bit."""
    t, q, dq = motion()
    first = Recording(t=t, q=q, dq=dq, tau=q + 1.0)
    write_recording(first, tmp_path / "x.parquet")
    table = pq.read_table(tmp_path / "x.parquet")
    assert table.column_names == ["t", "q1", "q2", "dq1", "dq2", "tau1", "tau2"]
    assert np.array_equal(table["tau2"].to_numpy(), q[:, 1] + 1.0)
    second = read_recording(tmp_path / "x.parquet")
    assert np.array_equal(second.tau, first.tau)
    assert [p.name for p in tmp_path.iterdir()] == ["x.parquet"]


def test_a_recipe_names_columns_units_and_signs(tmp_path):
    """Oracle: degrees, milliseconds, float32, nulls and signs are settled as in a CSV."""
    t, q, _ = motion()
    tau = pa.array([None if i == 5 else 2.0 for i in range(400)])
    told = {
        "stamp": np.round(t * 1e3).astype(np.int64),
        "J1": np.degrees(q[:, 0]),
        "J2": np.degrees(q[:, 1]),
        "M1": tau,
        "M2": np.full(400, 2.0, dtype=np.float32),
    }
    pq.write_table(pa.table(told), tmp_path / "x.parquet")
    table = {
        "time": {"column": "stamp", "unit": "ms"},
        "position": {"columns": ["J1", "J2"], "unit": "deg"},
        "torque": {"columns": ["M1", 4], "unit": "N*m", "sign": -1},
    }
    recording = read_recording(tmp_path / "x.parquet", recipe_from_table(table))
    assert np.delete(q, 5, axis=0) == pytest.approx(recording.q, abs=1e-14)  # rounding of π/180
    assert (recording.tau == -2.0).all()
    assert len(recording) == 399
    assert recording.rate_hz == pytest.approx(100.0)


def table_of(**changes: object) -> pa.Table:
    told = columns() | changes
    return pa.table({key: values for key, values in told.items() if values is not None})


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (table_of(q1=["x"] * 400), "'q1' is expected to hold real numbers, but is of type string"),
        (table_of(q1=None), "columns t, q1"),
        (table_of(tau2=None), "expected to have tau1 … tau2"),
        (table_of(t=None), "columns t, but t is missing"),
        (table_of().slice(0, 0), "holds no rows"),
        (pa.table({**lists(2), "q": [[1.0], [2.0, 3.0]]}), "of one length"),
        (pa.table({**lists(2), "q": [[1.0, 2.0], None]}), "of one length"),
        (pa.table({**lists(2), "t": pa.array([[], []], pa.list_(pa.float64()))}), "above 0"),
    ],
)
def test_tables_that_are_no_log(tmp_path, table, message):
    """Property: wrong types, missing columns and ragged lists are one sentence."""
    pq.write_table(table, tmp_path / "x.parquet")
    with pytest.raises(RecordingError, match=message):
        read_recording(tmp_path / "x.parquet")


def test_rows_that_no_log_has(tmp_path):
    """Property: ten million constant rows in 100 kB are refused before they are decoded."""
    zeros = pa.array(np.zeros(10_000_000))
    pq.write_table(pa.table({"t": zeros, "q1": zeros}), tmp_path / "x.parquet")
    assert (tmp_path / "x.parquet").stat().st_size < 100_000
    with pytest.raises(RecordingError, match="states 10000000 rows"):
        read_recording(tmp_path / "x.parquet")


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    """Oracle: without pyarrow the sentence says what to install."""
    write_recording(Recording(*motion()[:2]), tmp_path / "x.parquet")
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(RecordingError, match=r"pip install 'symgen\[logs\]'"):
        read_recording(tmp_path / "x.parquet")


@settings(max_examples=100, deadline=None)
@given(
    places=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=4),
    cut=st.one_of(st.none(), st.floats(0, 1)),
)
def test_damaged_files_are_one_sentence(tmp_path_factory, places, cut):
    """Property: whatever bytes are changed, a recording comes out or one sentence."""
    folder = tmp_path_factory.mktemp("damaged")
    pq.write_table(pa.table(columns(50)), folder / "x.parquet")
    data = bytearray((folder / "x.parquet").read_bytes())
    for place, value in places:
        data[int(place * (len(data) - 1))] = value
    if cut is not None:
        data = data[: int(cut * len(data))]
    (folder / "x.parquet").write_bytes(bytes(data))
    try:
        recording = read_recording(folder / "x.parquet")
    except RecordingError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert np.isfinite(recording.q).all()


def franka_csv(folder: Path, n: int = 100) -> tuple[Path, np.ndarray]:
    """A log with the columns of libfranka's logToCSV, in its order and spacing."""

    def names(name: str, count: int = 7) -> str:
        return ", ".join(f"{name}[{i}]" for i in range(count))

    state = ("q", "q_d", "dq", "dq_d", "tau_J", "tau_ext_hat_filtered")
    command = (("q_d", 7), ("dq_d", 7), ("O_T_EE_d", 16), ("O_dP_EE_d", 6), ("tau_J_d", 7))
    header = "time, success_rate, " + ",".join(names(f"state.{name}") for name in state)
    header += "," + ",".join(names(f"cmd.{name}", count) for name, count in command)
    width = header.count(",") + 1
    rows = np.random.default_rng(3).normal(size=(n, width))
    t = np.arange(n)
    rows[:, 0] = 5000 + t
    phase = np.outer(1e-3 * t, 1.0 + np.arange(7))
    rows[:, 2:9], rows[:, 16:23] = np.sin(phase), (1.0 + np.arange(7)) * np.cos(phase)
    lines = [",".join(f"{value:.17g}" for value in row) for row in rows]
    path = folder / "franka.csv"
    path.write_text("\n".join([header, *lines]) + "\n")
    return path, rows


def test_libfranka_logs_need_no_recipe(tmp_path):
    """Oracle: q, dq and the measured tau_J of logToCSV, in ms; commanded columns stay out.

    Source of the header: libfranka, src/log.cpp.
    """
    path, rows = franka_csv(tmp_path)
    recording = read_recording(path)
    assert recording.t == pytest.approx(rows[:, 0] * 1e-3)
    assert np.array_equal(recording.q, rows[:, 2:9])
    assert np.array_equal(recording.dq, rows[:, 16:23])
    assert np.array_equal(recording.tau, rows[:, 30:37])
    assert recording.ddq is None
