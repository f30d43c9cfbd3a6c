"""Text parsed at once: the numbers, and the messages, of a reader that looks at every line."""

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording.formats import text_tables
from runtime.recording.formats.text_tables import FLAT, RowForm, csv_table, flat_table, plain_rows

ROWS = "t,a,b\n0.1,-1e-3,nan\n0.2, 4 ,1e400\n0.30000000000000004,5,6\n"
ODD = {
    "plain": ROWS,
    "line ends of Windows": ROWS.replace("\n", "\r\n"),
    "no last line end": ROWS.rstrip(),
    "bare cell": ROWS + "0.4,7,\n",
    "short line": ROWS + "0.4,7\n0.5,1,1,1\n" + "0.6,1,2\n" * 40,
    "underscore": ROWS + "0.4,1,7_0\n",
    "quotes": ROWS + '"0.4","1","2"\n',
    "comment and header": ROWS + "# x\nt,a,b\n\n0.5,1,2\n",
    "other line ends": ROWS + "0.4,1,2\x0b\n0.5,1,2\x85\n",
    "semicolons": ROWS.replace(",", ";"),
    "decimal commas": "t;a;b\n0,1;2;3\n0,2;2,5;3\n",
    "text before the header": "made by hand\n" + ROWS,
}


@pytest.mark.parametrize("reader", ["pyarrow", "NumPy"])
@pytest.mark.parametrize("name", ODD)
def test_a_table_is_that_of_single_lines(name: str, reader: str, monkeypatch) -> None:
    """Property: values to the bit, line numbers and remarks, by either parser."""
    if reader == "pyarrow":
        pytest.importorskip("pyarrow")
        monkeypatch.setattr(text_tables, "LONG", 0)
    at_once = csv_table(ODD[name], ("b", "t", "t"), "log.csv")
    monkeypatch.setattr(text_tables, "plain_rows", lambda *_: None)
    by_line = csv_table(ODD[name], ("b", "t", "t"), "log.csv")
    assert np.array_equal(at_once.values, by_line.values, equal_nan=True)
    assert np.array_equal(at_once.lines, by_line.lines)
    assert at_once.remarks == by_line.remarks


@pytest.mark.parametrize("odd", ["7,1", "x,1,2", "# a comment", "t,a,b", ""])
def test_an_odd_line_costs_only_its_part(odd: str, monkeypatch) -> None:
    """Property: the table of single lines, but cells near the odd line only are read singly."""
    monkeypatch.setattr(text_tables, "SIZES", (4000, 200))
    singly = []
    number_in = text_tables.number_in
    rows = [f"0.{k},{k},-{k}e-3" for k in range(2000)]
    for place in (0, 777, 2000):
        text = "\n".join(["t,a,b", *rows[:place], odd, *rows[place:]]) + "\n"
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(text_tables, "number_in", lambda *a: singly.append(a) or number_in(*a))
            at_once = csv_table(text, ("b", "t"), "log.csv")
        assert len(singly) <= 2 * (200 / len("0.1,1,-1e-3\n") + 1)
        singly.clear()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(text_tables, "plain_rows", lambda *_: None)
            by_line = csv_table(text, ("b", "t"), "log.csv")
        assert np.array_equal(at_once.values, by_line.values, equal_nan=True)
        assert np.array_equal(at_once.lines, by_line.lines)
        assert at_once.remarks == by_line.remarks


def test_whole_numbers_are_parsed_at_once() -> None:
    """Property: a table without oddities needs no second look, by either parser."""
    body = ROWS.partition("\n")[2]
    for long in (0, len(body) + 1):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(text_tables, "LONG", long)
            values = plain_rows(body, RowForm("t,a,b", True, ",", 3, [0, 1]))
        assert values is not None
        assert values[-1, 0] == 0.1 + 0.2


def test_a_narrow_table_is_refused_as_before() -> None:
    """Property: the message of a header that does not fit its rows."""
    with pytest.raises(RecordingError, match="3 of 3 rows have another number of cells"):
        csv_table("t,a,b,c\n1,2,3\n1,2,3\n1,2,3\n", ("t",), "log.csv")


@pytest.mark.parametrize("odd", ["", "2_0", "x", "1\x0c2"])
def test_flat_text_is_that_of_single_lines(odd: str, monkeypatch) -> None:
    """Property: one number per line; a line that is none keeps its place as NaN."""
    text = "title\n1\n2.5\r\n" + odd + "\n-3e-5\n4\n"
    at_once = flat_table(text, 2, "log.txt")
    monkeypatch.setattr(text_tables, "plain_rows", lambda *_: None)
    by_line = flat_table(text, 2, "log.txt")
    assert np.array_equal(at_once.values, by_line.values, equal_nan=True)
    assert at_once.remarks == by_line.remarks


def test_numbers_are_those_of_python() -> None:
    """Oracle: `float`, to the bit, one number per line and in columns."""
    rng = np.random.default_rng(3)
    values = rng.standard_normal(4000) * 10.0 ** rng.integers(-12, 12, 4000)
    cells = [f"{x:.{k % 17}{'efg'[k % 3]}}" for k, x in enumerate(values)]
    cells[::500] = ["-0.0", "nan", "12", "-inf", "-.5", "3.", "4.9e-324", "9e400"]
    expected = np.array(list(map(float, cells)))
    flat = plain_rows("\n".join(cells), FLAT)
    assert flat is not None
    assert flat.tobytes() == expected.tobytes()
    lines = [";".join(cells[k : k + 4]) for k in range(0, len(cells), 4)]
    table = plain_rows("\n".join(lines), RowForm(lines[0], False, ";", 4, [3, 1, 1]))
    assert table is not None
    assert table.tobytes() == expected.reshape(-1, 4)[:, [3, 1, 1]].tobytes()


@pytest.mark.parametrize(
    "odd",
    ["1-2\n\n", "1 2\n\n", "\n1+2\n", "1.5.5\n\n", "1\v\n2\n", "0x1p3\n", "1e5e\n", "\u0662x\n"],
)
def test_two_numbers_in_a_line_do_not_make_up_for_an_empty_one(odd: str) -> None:
    """Property: as many numbers as lines, but not one in each, or text that is no number."""
    assert plain_rows("1.5\n" * 40 + odd, FLAT) is None
    assert plain_rows(odd + "1.5\n" * 40, FLAT) is None


def test_empty_lines_alone_hold_no_numbers() -> None:
    """Property: without the warning by which NumPy says that it read none."""
    assert plain_rows("\n" * 40, FLAT) is None


def test_decimals_are_those_of_python() -> None:
    """Oracle: `float`, to the bit, for 1 to 8 digits on either side of the point."""
    rng = np.random.default_rng(8)
    whole, after = rng.integers(1, 9, (2, 20000))
    digits = [[str(k) for k in row] for row in rng.integers(0, 10, (20000, 16))]
    cells = [
        f"{'-' if k % 3 else ''}{''.join(row[:a])}.{''.join(row[8 : 8 + b])}"
        for k, (row, a, b) in enumerate(zip(digits, whole, after, strict=True))
    ]
    cells[::100] = ["1e-05"] * 200
    cells[:4] = ["-0.000", "99999999.99999999", "9007199.254740993", "3"]
    parsed = plain_rows("\n".join(cells), FLAT)
    assert parsed is not None
    assert parsed.tobytes() == np.array(list(map(float, cells))).tobytes()


@pytest.mark.parametrize("odd", ["1_0.5", "1.5.5", "-", ".", "1/5", "1:5.0", "\xb2.5"])
def test_other_cells_are_refused(odd: str) -> None:
    """Property: what the reader of single lines must judge is not read as a number."""
    for place in (0, 20, 40):
        cells = ["1.5"] * 40
        cells.insert(place, odd)
        assert plain_rows("\n".join(cells), FLAT) is None
