"""Files that a fuzzer found a way through: each is one sentence now."""

import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.errors import IdentificationError, RecordingError, RuntimeFault
from runtime.estimators.prior_file import read_prior
from runtime.experiments.report.reading import is_drawable
from runtime.experiments.storage import read_rows
from runtime.identification.payload.body import read_known_payload
from runtime.identification.saved_result import read_result
from runtime.library import Library, load
from runtime.recording import Recording, read_recording
from runtime.recording.formats import bag_messages, parquet_format
from runtime.recording.streamed import open_streamed
from scripts.fuzzing import bags, goods

ENDLESS = "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT count(x)"
ZEROS = bytes(10**6)


@pytest.fixture(scope="module")
def tiny(tiny_built: Path) -> Library:
    return load(tiny_built)


@pytest.fixture
def log(tiny: Library) -> Recording:
    return goods.motion(tiny)


def test_a_database_is_not_asked_an_endless_question(tmp_path: Path, log: Recording) -> None:
    """Property: a view in the place of a table is refused, whatever its query is."""
    bags.ros2(tmp_path / "bag", bags.payloads(log, "cdr"))
    with sqlite3.connect(tmp_path / "bag" / "bag.db3") as database:
        database.executescript(
            f"DROP TABLE schema; CREATE VIEW schema AS {ENDLESS} AS schema_version FROM n"
        )
    database.close()
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(tmp_path / "bag")


@pytest.mark.parametrize("deep", ["[" * 3000, "- " * 3000])
def test_yaml_is_as_deep_as_ros_writes_it(tmp_path: Path, log: Recording, deep: str) -> None:
    """Property: what a parser would take the square of is refused before it begins."""
    bags.ros2(tmp_path / "bag", bags.payloads(log, "cdr"))
    with sqlite3.connect(tmp_path / "bag" / "bag.db3") as database:
        database.execute("UPDATE topics SET offered_qos_profiles = ?", (deep,))
    database.close()
    for place in ("bag", "bag/bag.db3"):
        with pytest.raises(RecordingError, match="longer or deeper"):
            read_recording(tmp_path / place)


def test_a_message_is_no_longer_than_a_robot(tmp_path: Path) -> None:
    """Property: of five million bytes nobody asks what they say."""
    told = [(bags.START, bytes(5 * 10**6))]
    (tmp_path / "log.mcap").write_bytes(bags.mcap(told, "json"))
    with pytest.raises(RecordingError, match="a message has 5000000 bytes"):
        read_recording(tmp_path / "log.mcap")


@pytest.fixture
def thrifty(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousandth of what a log may become, so that bombs are small."""
    monkeypatch.setattr(bag_messages, "SLACK", 2**16)


def ros1_bomb(folder: Path, log: Recording, codec: str) -> Path:
    (folder / "log.bag").write_bytes(bags.ros1([(bags.START, ZEROS)], codec))
    return folder / "log.bag"


def ros2_bomb(folder: Path, log: Recording, mode: str) -> Path:
    bags.ros2(folder / "bag", [(bags.START, ZEROS)], mode)
    return folder / "bag"


@pytest.mark.usefixtures("thrifty")
@pytest.mark.parametrize(
    ("bomb", "how"),
    [(ros1_bomb, "BZ2"), (ros1_bomb, "LZ4"), (ros2_bomb, "MESSAGE"), (ros2_bomb, "FILE")],
)
def test_bags_are_inflated_within_bounds(
    tmp_path: Path, log: Recording, bomb: Callable[..., Path], how: str
) -> None:
    """Property: a piece that becomes thousands of times as long is no piece of a log."""
    with pytest.raises(RecordingError, match=r"holds more than|expands to more than"):
        read_recording(bomb(tmp_path, log, how))


@pytest.mark.parametrize("codec", ["", "BZ2", "LZ4"])
def test_good_bags_are_inflated_as_before(tmp_path: Path, log: Recording, codec: str) -> None:
    """Oracle: the same positions, however they are compressed."""
    (tmp_path / "log.bag").write_bytes(bags.ros1(bags.payloads(log, "ros1"), codec))
    assert np.array_equal(read_recording(tmp_path / "log.bag").q, log.q)


@pytest.mark.parametrize("mode", ["NONE", "MESSAGE", "FILE"])
def test_good_folders_are_inflated_as_before(tmp_path: Path, log: Recording, mode: str) -> None:
    """Oracle: as for ROS 1."""
    bags.ros2(tmp_path / "bag", bags.payloads(log, "cdr"), mode)
    assert np.array_equal(read_recording(tmp_path / "bag").q, log.q)


def test_texts_are_characters(tmp_path: Path) -> None:
    """Property: NumPy makes strings that Python cannot print; they are refused at the door."""
    name = np.frombuffer(np.array([0x7FFFFFFF, 65, 66], dtype=np.uint32).tobytes(), dtype="<U3")
    np.savez(tmp_path / "log.npz", t=np.arange(9.0), q=np.ones((9, 2)), name=name)
    with pytest.raises(RecordingError, match="expected to be an NPZ of number arrays"):
        read_recording(tmp_path / "log.npz")


def test_columns_have_names_of_their_own(tmp_path: Path, log: Recording) -> None:
    """Property: of two columns of one name nobody knows which is meant."""
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    table = pa.table({"t": log.t, "q1": log.q[:, 0]}).append_column("q1", pa.array(log.q[:, 0]))
    pq.write_table(table, tmp_path / "log.parquet")
    with pytest.raises(RecordingError, match="several columns called 'q1'"):
        read_recording(tmp_path / "log.parquet")
    with pytest.raises(RecordingError, match="several columns called 'q1'"):
        open_streamed(tmp_path / "log.parquet").block(0, 5)


def test_a_table_of_rows_is_no_larger_than_any(tmp_path: Path, monkeypatch: Any) -> None:
    """Property: a few bytes that claim millions of rows are not made into objects."""
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    monkeypatch.setattr(parquet_format, "MOST_CELLS", 1000)
    table = pa.table({"airm": pa.nulls(1001, pa.float64())}).replace_schema_metadata(
        {"config_hash": "mark"}
    )
    pq.write_table(table, tmp_path / "rows.parquet")
    with pytest.raises(RecordingError, match="states 1001 cells, more than 1000"):
        parquet_format.rows_of(tmp_path / "rows.parquet")
    assert read_rows(tmp_path / "rows.parquet", "mark") is None
    pq.write_table(table.slice(1), tmp_path / "rows.parquet")
    assert len(read_rows(tmp_path / "rows.parquet", "mark") or ()) == 1000


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("link = 3.5", "link expects a table, got 3.5; correct it"),
        ("[link]\nrod = [1.0]", r"link\.rod expects a table, got \[1.0\]; correct it"),
        ("[link.rod]\nsymmetry = [['xy']]", "rod.symmetry"),
    ],
)
def test_entries_of_a_prior_are_tables(
    tmp_path: Path, tiny: Library, text: str, words: str
) -> None:
    """Property: whatever stands in the place of a table is told."""
    (tmp_path / "prior.toml").write_text(text)
    with pytest.raises(IdentificationError, match=words):
        read_prior(tmp_path / "prior.toml", tiny)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"mass": 1, "mass": 2, "com": [0, 0, 0]}', "[1]"])
def test_a_known_payload_says_one_thing(tmp_path: Path, text: str) -> None:
    """Property: depth, and a mass that stands twice, are no payload."""
    (tmp_path / "payload.json").write_text(text)
    with pytest.raises(RecordingError, match="holds no payload"):
        read_known_payload(str(tmp_path / "payload.json"))


@pytest.mark.parametrize("value", ["NaN", "Infinity", "1e308"])
def test_a_result_holds_numbers_of_an_arm(tmp_path: Path, value: str) -> None:
    """Property: nothing is computed with a π that is none."""
    pi = ", ".join([value, *["1.0"] * 9])
    head = '{"robot": "tiny", "method": "map", "joints": ["swing"], "units": ["N*m"]'
    head += ', "recording": {"history": []}, "links": [], "consistent": true'
    errors = '"before": [null], "after": [null], "before_overall": null, "after_overall": null'
    rms = '"before": [0.0], "after": [0.0]'
    head += f', "torque_error_percent": {{{errors}}}, "torque_rms": {{{rms}}}'
    (tmp_path / "result.json").write_text(f'{head}, "pi": [{pi}], "friction": null}}')
    with pytest.raises(RecordingError, match="holds no valid result"):
        read_result(tmp_path)
    (tmp_path / "result.json").write_text(
        (tmp_path / "result.json").read_text().replace(value, "1.0")
    )
    assert read_result(tmp_path).pi.sum() == 10.0


def test_a_film_needs_a_tree_and_numbers(tmp_path: Path, tiny: Library) -> None:
    """Property: joints in a ring end, and numbers, entities and meshes that are none are told."""
    pytest.importorskip("viser")
    from runtime.outputs.viewer.shapes import look_of

    def look(text: str) -> str:
        (tmp_path / "r.urdf").write_text(text)
        return look_of(tiny, tmp_path / "r.urdf").sentence

    ring = "".join(
        f'<link name="{a}"><visual/></link><joint name="{a}{b}" type="fixed">'
        f'<parent link="{a}"/><child link="{b}"/></joint>'
        for a, b in ("xy", "yx")
    )
    assert "no visual shapes" in look(f"<robot>{ring}</robot>")
    rod = '<robot><link name="rod"><visual>{}<geometry>{}</geometry></visual></link></robot>'
    (tmp_path / "a.dae").write_text("<COLLADA>")
    (tmp_path / "a.obj").write_text("v 0 0 0\nf 1 2 3\n")
    for mesh in ("a.dae", "a.obj"):
        assert "no mesh could be read" in look(rod.format("", f'<mesh filename="{mesh}"/>'))
    assert "expected 3 numbers below 10000, got" in look(rod.format("", '<box size="1e300 1 1"/>'))
    for bad in (rod.format('<origin xyz="1 2"/>', ""), f"<!DOCTYPE robot []>{rod}"):
        with pytest.raises(RuntimeFault, match="is not a URDF"):
            look(bad)


ONE, TWO = np.ones(5), np.ones((5, 2))


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        ("band", (ONE, ONE, ONE), (ONE, ONE)),
        ("loglog", (ONE, ONE, ONE), (ONE, ONE, TWO)),
        ("path", (np.ones((5, 3)),), (TWO,)),
        ("motion", (ONE, TWO, TWO, TWO, TWO), (ONE, TWO, TWO, TWO)),
        ("lines", (ONE, TWO, TWO), (ONE, ONE[:3])),
        ("lines", (ONE, ONE * np.nan), (ONE, ONE * 1e308)),
        ("table", (), (np.ones(()),)),
    ],
)
def test_a_figure_is_drawn_of_series_that_fit(kind: str, good: Any, bad: Any) -> None:
    """Property: shapes are judged before matplotlib meets them."""
    names = ("a", "b", "c", "d", "e")
    assert is_drawable(kind, good, names[: len(good)])
    assert not is_drawable(kind, bad, names[: len(bad)])


def test_positions_of_no_joint_are_refused(tmp_path: Path) -> None:
    """Property: lists without a number in the place of positions; the column is named."""
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    lists = pa.array([[]] * 9, pa.list_(pa.float64()))
    table = {"t": pa.array(np.arange(9.0)), "q": lists, "tau": pa.array(np.ones((9, 2)).tolist())}
    pq.write_table(pa.table(table), tmp_path / "log.parquet")
    with pytest.raises(RecordingError, match="of one length above 0"):
        read_recording(tmp_path / "log.parquet")
