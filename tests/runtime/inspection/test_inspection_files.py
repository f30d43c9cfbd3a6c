"""runtime.inspection: the traps of clocks, rows and columns are named.

The clean log is the bundled simulation (another program made it); each trap is put into it, or
is in a published log or model as it is. What is expected is what was put in.
"""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from runtime import Recording, write_recording
from runtime.inspection import inspect_log, recipe_text
from runtime.library import Library
from tests.runtime.diagnosis import EXAMPLE, kinds, require_no_warning, sentences


def test_2_repeated_rows_and_a_jittering_clock(lib: Library, shared_data: Path) -> None:
    """Real data: 6 % stale rows; the proposed clock is that of the bundled recipe."""
    result = inspect_log(shared_data / "data" / "panda_gaz", lib, bare=True)
    assert set(sentences(result)) == {"repeated_rows"}
    assert "repeated_rows" in kinds(result)
    assert result.plan.preparation.clock_tick == 1e-3
    assert result.plan.preparation.max_gap_s == 0.02


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6)])
def test_2_time_in_another_unit(lib, clean, saved, tmp_path, unit, factor) -> None:
    """Property: computed from dq, and handled by the recipe."""
    log = saved(clean, t=clean.t * factor)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"time_unit"}
    assert result.plan.time.unit == unit
    require_no_warning(result, log, lib, tmp_path)


def test_2_irregular_stamps(lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: 8/12 ms steps are jitter; the recipe brings them onto a grid."""
    keep = np.ones(len(clean), dtype=bool)
    t = clean.t + 1e-3 * (np.arange(len(clean)) % 2)
    log = saved(clean, t=t[keep])
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"jitter"}
    assert result.plan.preparation.max_gap_s is not None
    require_no_warning(result, log, lib, tmp_path)


def test_2_holes_and_dropped_ticks(lib: Library, clean: Recording, saved) -> None:
    """Property: a second is a hole, single rows are ticks; both are counted."""
    keep = np.ones(len(clean), dtype=bool)
    keep[400:500] = False
    keep[[50, 150, 250]] = False
    arrays = {key: getattr(clean, key)[keep] for key in ("t", "q", "dq", "tau")}
    result = inspect_log(saved(clean, **arrays), lib)
    assert {"holes", "dropped_ticks"} <= set(sentences(result))
    evidence = {f.kind: f.evidence for f in result.findings}
    assert evidence["holes"]["count"] == 1
    assert evidence["holes"]["longest_s"] == pytest.approx(1.01)
    assert evidence["dropped_ticks"]["count"] == 3


def test_2_no_clock_at_all(lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: the rate follows from Δq = dq Δt; without dq it has to be given."""
    log = saved(clean, t=None)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"missing_clock"}
    assert result.plan.time.rate_hz == pytest.approx(100.0, rel=0.02)
    require_no_warning(result, log, lib, tmp_path)
    silent = inspect_log(saved(clean, t=None, dq=None), lib)
    # Nothing is stated about speeds and times, such as rest, that a made-up clock would give.
    assert set(sentences(silent)) == {"missing_clock"}
    assert "by --settings log_rate=HZ" in sentences(silent)["missing_clock"]
    assert "# rate_hz" in recipe_text(silent)
    assert sentences(inspect_log(saved(clean, t=None, dq=None), lib, rate_hz=100.0)) == {}


def test_2_time_runs_backwards(lib: Library, clean: Recording, saved) -> None:
    """Property: two runs in one file are an error that names the row."""
    t = np.concatenate([clean.t[:500], clean.t[:501]])
    assert "at row 500" in sentences(inspect_log(saved(clean, t=t), lib))["time_backwards"]


@pytest.mark.parametrize("delay", [0.004, -0.023])
def test_2_torque_is_late(lib: Library, clean: Recording, saved, tmp_path: Path, delay) -> None:
    """Property: a delay of 0.4 and of 2.3 samples, to a tenth of a sample."""
    tau = np.stack([np.interp(clean.t - delay, clean.t, row) for row in clean.tau.T], axis=1)
    log = saved(clean, tau=tau)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"time_shift"}
    assert result.plan.preparation.torque_delay_s == pytest.approx(delay, abs=1e-3)
    require_no_warning(result, log, lib, tmp_path)


def test_9_corrupt_rows(lib: Library, clean: Recording, tmp_path: Path) -> None:
    """Property: 1e293, a cut line, garbage and repeated headers are dropped and told by line."""
    write_recording(clean, tmp_path / "log.csv")
    lines = (tmp_path / "log.csv").read_text().splitlines()
    lines[100] = lines[100].replace(lines[100].split(",")[3], "1e293")
    lines.insert(300, lines[0])
    lines[-1] = lines[-1][:40]
    (tmp_path / "log.csv").write_text("\n".join(["logger v2", *lines]))
    result = inspect_log(tmp_path / "log.csv", lib)
    assert "Dropped 2 of 1001 rows" in sentences(result)["corrupt_rows"]
    assert "corrupt_rows" in kinds(result)
    remarks = " ".join(f.sentence for f in result.findings if f.kind == "file_form")
    assert "repeated headers" in remarks
    assert "lines before the header" in remarks


def test_9_semicolons_and_foreign_titles(lib: Library, clean: Recording, tmp_path: Path) -> None:
    """Property: `;`, decimal commas, degrees, ms and titles of another logger, all at once."""
    degree = 180 / np.pi
    blocks = (clean.t * 1e3, clean.q * degree, clean.dq * degree, clean.tau)
    titles = ["Time [ms]"]
    for stem in ("Joint Position {} [deg]", "Joint Velocity {} [deg/s]", "Effort {}"):
        titles += [stem.format(j) for j in (2, 3, 4, 1, 5, 6, 7)]
    moved = [b[:, [1, 2, 3, 0, 4, 5, 6]] if b.ndim == 2 else b for b in blocks]
    rows = [";".join(f"{x:.9g}" for x in row) for row in np.column_stack(moved)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([";".join(titles), *rows]).replace(".", ","))
    result = inspect_log(log, lib)
    assert sentences(result) == {}  # titles tell everything
    assert result.plan.time.unit == "ms"
    np.testing.assert_allclose(result.recording.q, clean.q, atol=1e-6)
    bare = "\n".join([";".join(t.split(" [")[0] for t in titles), *rows]).replace(".", ",")
    log.write_text(bare)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"position_unit", "velocity_unit", "time_unit"}
    require_no_warning(result, log, lib, tmp_path)


@pytest.mark.parametrize("is_list", [False, True])
def test_9_titles_of_a_parquet(lib: Library, clean: Recording, tmp_path: Path, is_list) -> None:
    """Property: titles of another logger in Parquet, with stamps of ns beyond 2^53 and a text."""
    values = {"Position [deg]": clean.q * 180 / np.pi, "Velocity [rad/s]": clean.dq}
    values["Effort"] = clean.tau
    table = {"stamp_ns": (1.7e18 + clean.t * 1e9).astype(np.int64), "mode": ["RUN"] * len(clean)}
    for title, each in values.items():
        if is_list:
            table[f"Joint {title}"] = each.tolist()
        else:
            table |= {f"Joint {j} {title}": each[:, j - 1] for j in (2, 3, 4, 1, 5, 6, 7)}
    pq.write_table(pa.table(table), tmp_path / "log.parquet")
    result = inspect_log(tmp_path / "log.parquet", lib)
    assert sentences(result) == {}
    assert (result.plan.time.unit, result.plan.position.unit) == ("ns", "deg")
    np.testing.assert_allclose(result.recording.q, clean.q, atol=1e-9)
    require_no_warning(result, tmp_path / "log.parquet", lib, tmp_path)


def test_9_joints_in_another_order(lib, clean, saved, tmp_path) -> None:
    """Property: every signal in the order 1, 2, 3, 0, 4, 5, 6."""
    order = [1, 2, 3, 0, 4, 5, 6]
    log = saved(clean, **{key: getattr(clean, key)[:, order] for key in ("q", "dq", "tau")})
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"joint_order"}
    np.testing.assert_array_equal(result.recording.q, clean.q)
    require_no_warning(result, log, lib, tmp_path)


@pytest.mark.parametrize(("key", "kind"), [("dq", "velocity_order"), ("tau", "torque_order")])
def test_9_one_signal_in_another_order(lib, clean, saved, tmp_path, key, kind) -> None:
    """Property: dq and τ are each held against q."""
    order = [1, 2, 3, 0, 4, 5, 6]
    log = saved(clean, **{key: getattr(clean, key)[:, order]})
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {kind}
    np.testing.assert_array_equal(getattr(result.recording, key), getattr(clean, key))
    require_no_warning(result, log, lib, tmp_path)


@pytest.mark.parametrize("rivals", [0, 1])
def test_a_signal_of_too_few_joints_is_named(lib, clean, tmp_path, rivals) -> None:
    """Property: six torques of a seven-joint arm are told, unless a whole set is there, too."""
    n = lib.n_joints
    titles = ["t", *(f"q{j + 1}" for j in range(n)), *(f"effort_{j + 1}" for j in range(n - 1))]
    columns = [clean.t, *clean.q.T, *clean.tau[:, :-1].T]
    if rivals:
        titles += [f"tau_J[{j}]" for j in range(n)]
        columns += [*clean.tau.T]
    log = tmp_path / "six.csv"
    np.savetxt(log, np.column_stack(columns), delimiter=",", header=",".join(titles), comments="")
    result = inspect_log(log, lib)
    said = [f.sentence for f in result.findings if f.kind == "incomplete_signal"]
    assert len(said) == 1 - rivals
    assert all(f"{n - 1} columns (effort_1 … effort_{n - 1}) for {n} joints" in s for s in said)
    assert ("no_torque" in sentences(result)) == (not rivals)


def test_an_edited_recipe_is_not_overwritten(command, lib: Library, tmp_path: Path) -> None:
    """Property: the same proposal is written again, another is refused and the file stays."""
    words = ("inspect", EXAMPLE, "--robot", lib.folder, "--recipe-out", "r.toml")
    assert command(*words).code == 0
    assert command(*words).code == 0
    edited = (tmp_path / "r.toml").read_bytes() + b"# the tool was changed at noon\n"
    (tmp_path / "r.toml").write_bytes(edited)
    refused = command(*words)
    assert refused.code == 2
    assert refused.err.count("\n") == 1
    assert "exists and differs from the proposed recipe" in refused.err
    assert (tmp_path / "r.toml").read_bytes() == edited
