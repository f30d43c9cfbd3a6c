"""Files without a header: columns are assigned by their content and shown by number."""

import tomllib

import numpy as np
import pytest

from runtime.inspection import inspect_log
from runtime.inspection.checks.columns import blocks_by_content, meaning
from runtime.inspection.checks.file_layout import draft
from runtime.recording import read_recording

ORDERS = {
    "usual": ("t", "q", "dq", "tau"),
    "torque first": ("tau", "q", "dq", "counter", "t"),
    "milliseconds": ("counter", "ms", "q", "constant", "tau"),
    "velocity first": ("dq", "q", "tau", "t"),
    "accelerations": ("t", "tau", "ddq", "q", "dq"),
    "commands": ("t", "command", "q", "dq", "tau"),
    "pose before": ("t", "pose", "q", "tau"),
    "pose between": ("t", "q", "pose", "dq", "tau"),
    "pose behind": ("t", "q", "tau", "pose"),
    "temperature before": ("t", "warm", "q", "dq", "tau"),
    "temperature between": ("t", "q", "dq", "warm", "tau"),
    "temperature behind": ("t", "q", "dq", "tau", "warm"),
}
KINDS = {"t": "time", "ms": "time", "q": "position", "dq": "velocity", "tau": "torque"}
KINDS |= {"ddq": "acceleration"}


@pytest.fixture(scope="module")
def signals(clean):
    """Signals of a log of seven joints, with the noise of encoders on the positions."""
    noise = np.random.default_rng(3).normal(0, 1e-5, clean.q.shape)
    dq = np.gradient(clean.q, clean.t, axis=0)
    turn = np.sin(clean.q[:, :4])
    pose = [np.cos(clean.q[:, :3]), turn / np.linalg.norm(turn, axis=1, keepdims=True)]
    return {
        "t": clean.t[:, None],
        "ms": 1e3 * clean.t[:, None],
        "counter": np.arange(len(clean))[:, None],
        "warm": 30 + np.sin(clean.t)[:, None],
        "constant": np.full((len(clean), 1), 3.0),
        "q": clean.q + noise,
        "command": clean.q,
        "pose": np.round(np.hstack(pose), 6),
        "dq": dq,
        "ddq": np.gradient(dq, clean.t, axis=0),
        "tau": clean.tau,
    }


@pytest.mark.parametrize("order", ORDERS.values(), ids=ORDERS)
def test_columns_are_recognised_by_content(order, signals) -> None:
    """Oracle: the order in which the columns were written; commands and counters are not used."""
    n = signals["q"].shape[1]
    blocks = blocks_by_content(np.column_stack([signals[name] for name in order]), n)
    assert [block.kind for block in blocks] == [KINDS.get(name, "") for name in order]
    assert [k for block in blocks for k in block.columns] == list(
        range(sum(signals[name].shape[1] for name in order))
    )
    units = [block.unit for block in blocks if block.kind == "time"]
    assert units == ["ms" if "ms" in order else "s"]


def test_a_pose_in_mm_is_no_position() -> None:
    """Oracle: the order in which the columns were written. One of six joints moves, the others have
    the noise of encoders; a column of flags and an unplugged sensor stand behind.
    """
    rng, t = np.random.default_rng(5), 0.008 * np.arange(800)
    turn = 100 * np.sin(0.5 * t)
    q = np.column_stack([turn, *np.tile([[30.0], [-160.0], [55.0], [-90.0], [5.0]], 800)])
    x, y = 900 * np.cos(np.radians(turn)), 900 * np.sin(np.radians(turn))
    pose = np.column_stack([x, y, np.full((800, 3), 170.0), turn])
    pose[:, 2:5] += 0.1 * np.sin(np.radians(turn))[:, None]
    torque = np.column_stack([np.sign(np.cos(0.5 * t)), *np.full((5, 800), 8.0)])
    wrench = np.full((800, 6), -7.0)
    noisy = [each + rng.normal(0, size, each.shape) for each, size in ((q, 2e-3), (torque, 0.1))]
    more = [wrench + rng.normal(0, 0.5, wrench.shape), np.zeros((800, 6)), np.arange(800) > 5]
    table = np.column_stack([1e3 * t, noisy[0], pose, noisy[1], *more])
    kinds = [block.kind for block in blocks_by_content(table, 6) if len(block.columns) > 1]
    assert kinds == ["position", "", "torque", ""]


def test_short_and_odd_files_are_left_to_the_order(signals) -> None:
    """Property: nothing is concluded from few rows or from columns that are no blocks of n."""
    table = np.column_stack([signals["q"], signals["tau"]])
    assert blocks_by_content(table[:10], 7) == ()
    assert blocks_by_content(table, 6) == ()
    table[50, 3] = 1e300  # its square overflows, and warnings are errors
    assert blocks_by_content(table, 7) == ()


def test_the_recipe_names_the_columns_by_number(lib, signals, clean, tmp_path) -> None:
    """Oracle: the log itself; the finding holds the table."""
    order = ORDERS["torque first"]
    log = tmp_path / "bare.csv"
    np.savetxt(log, np.column_stack([signals[name] for name in order]), delimiter=",")
    inspection = inspect_log(log, lib)
    assert inspection.plan.position.columns == tuple(range(7, 14))
    assert inspection.plan.torque.columns == tuple(range(7))
    np.testing.assert_array_equal(inspection.recording.tau, clean.tau)  # written with 18 digits
    (finding,) = [f for f in inspection.findings if f.kind == "columns_by_content"]
    rows = finding.evidence["table"]
    assert [row["signal"] for row in rows] == ["torque", "position", "velocity", None, "time"]
    assert "torque 0–6, position 7–13, velocity 14–20, time 22" in finding.sentence


def test_the_table_is_printed(command, lib, signals, tmp_path) -> None:
    """Property: numbers, signal and reason of every column, and what to do."""
    table = np.column_stack([signals[name] for name in ORDERS["milliseconds"]])
    np.savetxt(tmp_path / "bare.csv", table, delimiter=" ")
    ran = command("inspect", "bare.csv", "--robot", lib.folder)
    assert ran.code == 1
    assert "columns by content, counted from 0" in ran.out
    assert "row counter" in ran.out


@pytest.mark.parametrize("names", [("q", "dq", "ddq"), ("q", "ddq", "tau"), ("q", "tau", "ddq")])
def test_accelerations_are_no_torque(signals, names) -> None:
    """Oracle: the order in which the columns were written, without torque or without velocity."""
    n = signals["q"].shape[1]
    blocks = blocks_by_content(np.column_stack([signals["t"], *(signals[k] for k in names)]), n)
    kinds = {"q": "position", "dq": "velocity", "ddq": "acceleration", "tau": "torque"}
    assert [block.kind for block in blocks] == ["time", *(kinds[name] for name in names)]


def test_lists_in_cells_are_proposed_and_read(lib, clean, tmp_path) -> None:
    """Property: a table with one JSON list per signal and row is read by the proposed recipe."""
    rows = zip(clean.t.tolist(), clean.q.tolist(), clean.tau.tolist(), strict=True)
    lines = [f'{t},"{q}","{tau}"' for t, q, tau in rows]
    lines[5] = lines[5].replace("]", "")  # a corrupt row
    path = tmp_path / "lists.csv"
    path.write_text("\n".join(["stamp,joint_positions,efforts", *lines]))
    plan, _ = draft(path, lib.joint_names)
    assert plan.position.cells == plan.torque.cells == "json"
    log = read_recording(path, plan)
    assert np.array_equal(log.q, np.delete(clean.q, 5, axis=0))
    assert np.array_equal(log.tau, np.delete(clean.tau, 5, axis=0))


@pytest.mark.parametrize(
    ("title", "kind", "unit"),
    [
        ("Achse1 Winkel [deg]", "position", "deg"),
        ("Achse1 Geschwindigkeit [rad/s]", "velocity", "rad/s"),
        ("Drehmoment 3 [N·m]", "torque", "N*m"),
        ("c1 (A)", "torque", "A"),
        ("Zeit [ms]", "time", "ms"),
        ("c1", "", ""),
        ("Druck 1 [bar]", "", ""),
    ],
)
def test_a_unit_in_brackets_names_the_signal(title: str, kind: str, unit: str) -> None:
    """Property: of titles whose words are unknown; another unit names nothing."""
    read = meaning(title)
    assert (read.kind, read.unit) == (kind, unit)


@pytest.mark.parametrize(
    ("title", "kind", "unit"),
    [
        ("motor_current_1_mA", "torque", "mA"),
        ("torque_1_mNm", "torque", "mN*m"),
        ("J1_trq_Nm", "torque", "N*m"),
        ("GearTorque.A1", "torque", ""),
        ("AIPos.A1", "position", ""),
        ("J1_vel_dps", "velocity", "deg/s"),
        ("ActTorque_J1_pct", "torque", "rated"),
        ("Torque J1 [%]", "torque", "rated"),
        ("actual_TCP_speed_0", "", ""),
        ("TCP speed 0 [rad/s]", "", ""),
    ],
)
def test_units_and_words_of_makers(title: str, kind: str, unit: str) -> None:
    """Property: mA is no A, an axis A1 no ampere, and per cent no N·m."""
    read = meaning(title)
    assert (read.kind, read.unit) == (kind, unit)


def test_a_share_of_a_rated_torque_has_unknown_gains(clean, tmp_path) -> None:
    """Property: per cent are read as currents; a clock without a known word by its content."""
    titles = ["IPOC", *(f"AIPos.A{k}" for k in range(7)), *(f"Torque J{k} [%]" for k in range(7))]
    rows = np.column_stack([4e6 + 1e3 * clean.t, clean.q, clean.tau])
    np.savetxt(tmp_path / "log.csv", rows, "%.17g", ",", header=",".join(titles), comments="")
    plan, findings = draft(tmp_path / "log.csv", ("",) * 7)
    assert plan is not None
    assert plan.time is not None
    assert (plan.time.column, plan.time.unit) == ("IPOC", "ms")
    assert plan.has_unknown_gains
    rated, clock = findings
    assert (rated.kind, clock.kind) == ("current_unit", "clock_by_content")
    assert "share of a rated torque" in rated.sentence


def test_every_joint_has_the_unit_of_its_title(clean, tmp_path) -> None:
    """Property: a slide in mm beside hinges in degrees, of titles that are read by content."""
    units = ["deg", "deg", "mm", "deg", "deg", "deg", "deg"]
    titles = ["clock_s", *(f"arm{k}_position_{unit}" for k, unit in enumerate(units))]
    titles += [f"arm{k}_effort" for k in range(7)]
    rows = np.column_stack([clean.t, clean.q, clean.tau])
    np.savetxt(tmp_path / "log.csv", rows, "%.17g", ",", header=",".join(titles), comments="")
    plan, _ = draft(tmp_path / "log.csv", ("",) * 7)
    assert plan is not None
    assert plan.position is not None
    assert plan.position.units == tuple(units)


def test_a_title_of_5000_digits_is_read() -> None:
    """Property: Python converts no text of more than 4300 digits."""
    assert meaning("q" + "1" * 5000).kind == "position"


def test_titles_that_are_not_understood_are_read_by_content(signals, tmp_path) -> None:
    """Property: the recipe names the columns, and the finding lists them."""
    names = ["a", *(f"{word}{j}" for word in ("foo", "bar", "baz") for j in range(7))]
    rows = np.column_stack([signals[name] for name in ("t", "q", "dq", "tau")])
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="")
    plan, findings = draft(path, tuple(f"joint{j}" for j in range(7)))
    assert plan is not None
    assert {k: s.columns[0] for k, s in plan.signals().items()} == {
        "position": "foo0",
        "velocity": "bar0",
        "torque": "baz0",
    }
    assert [finding.kind for finding in findings] == ["columns_by_content"]


@pytest.mark.parametrize(("before", "behind"), [("RUN,", ""), ("", ",RUN"), ("", ",")])
def test_text_and_empty_columns_are_left_out(clean, tmp_path, before: str, behind: str) -> None:
    """Oracle: the log whose rows begin or end with text, or with a separator, without a header."""
    rows = np.column_stack([clean.t, clean.q, clean.tau])
    lines = [before + ",".join(map(repr, row)) + behind for row in rows.tolist()]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    plan, findings = draft(tmp_path / "log.csv", ("",) * 7)
    assert [each.kind for each in findings] == ["columns_by_content"]
    log = read_recording(tmp_path / "log.csv", plan)
    np.testing.assert_array_equal(log.q, clean.q)
    np.testing.assert_array_equal(log.tau, clean.tau)


def test_a_torque_that_is_named_does_not_hide_the_positions(clean, tmp_path) -> None:
    """Oracle: columns of a header of which the words of the torque alone are known."""
    titles = ["Zeit", *(f"Winkel Achse {k}" for k in range(7)), *(f"tau{k}" for k in range(7))]
    rows = np.column_stack([clean.t, clean.q, clean.tau])
    np.savetxt(tmp_path / "log.csv", rows, "%.17g", ",", header=",".join(titles), comments="")
    plan, _ = draft(tmp_path / "log.csv", ("",) * 7)
    assert plan is not None
    assert plan.position is not None
    assert plan.position.columns == tuple(titles[1:8])


def test_a_recipe_to_be_filled_in_lists_the_columns(command, lib, tmp_path) -> None:
    """Property: exit code 2, a sentence that names the file, which TOML reads, or the option."""
    (tmp_path / "log.csv").write_text('when,state\n0.0,"[1, 2]"\n0.1,"[1, 3]"\n')
    ran = command("inspect", "log.csv", "--robot", lib.folder, "--recipe-out", "r.toml")
    assert ran.code == 2
    assert "'r.toml' lists the columns of the log" in ran.err
    text = (tmp_path / "r.toml").read_text()
    assert "#   1  state  [1, 2]" in text
    assert "fr3_joint7" in text
    (tmp_path / "logs").mkdir()
    (tmp_path / "log.csv").replace(tmp_path / "logs" / "part.csv")
    assert "--recipe-out" in command("inspect", "logs", "--robot", lib.folder).err
    command("inspect", "logs", "--robot", lib.folder, "--recipe-out", "folder.toml")
    assert "# part.csv holds:" in (tmp_path / "folder.toml").read_text()
    assert tomllib.loads(text) == {}
    assert command("inspect", "nope.csv", "--recipe-out", "s.toml").code == 2
    assert not (tmp_path / "s.toml").exists()
