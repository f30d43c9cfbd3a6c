"""Text parsed at once: the numbers, and the messages, of a reader that looks at every line."""

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording.formats import plain_numbers, text_tables
from runtime.recording.formats.decimals import decimal_rows
from runtime.recording.formats.text_tables import csv_table, flat_table

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
        monkeypatch.setattr(plain_numbers, "LONG", 0)
    at_once = csv_table(ODD[name], ("b", "t", "t"), "log.csv")
    monkeypatch.setattr(text_tables, "plain_rows", lambda *_: None)
    by_line = csv_table(ODD[name], ("b", "t", "t"), "log.csv")
    assert np.array_equal(at_once.values, by_line.values, equal_nan=True)
    assert np.array_equal(at_once.lines, by_line.lines)
    assert at_once.remarks == by_line.remarks


def test_whole_numbers_are_parsed_at_once() -> None:
    """Property: a table without oddities needs no second look, by either parser."""
    body = ROWS.partition("\n")[2]
    for long in (0, len(body) + 1):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(plain_numbers, "LONG", long)
            lines = iter(body.splitlines())
            values = plain_numbers.plain_rows(body, lines, ",", 3, (0, 1))
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
    monkeypatch.setattr(text_tables, "plain_numbers", lambda *_: None)
    by_line = flat_table(text, 2, "log.txt")
    assert np.array_equal(at_once.values, by_line.values, equal_nan=True)
    assert at_once.remarks == by_line.remarks


def test_decimal_numbers_are_those_of_python() -> None:
    """Oracle: `float`, to the bit, for numbers with up to twelve digits around a point."""
    rng = np.random.default_rng(3)
    digits = ["".join(map(str, row)) for row in rng.integers(0, 10, (4000, 14))]
    cells = [f"{'-' * (k % 2)}{d[: 1 + k % 6]}.{d[6 : 7 + k % 8]}" for k, d in enumerate(digits)]
    cells[::500] = ["-0.0", "-7.25e-12", "12", "1e3", "-.5", "3.", "1234567.00000009", "9e400"]
    expected = np.array(list(map(float, cells)))
    flat = decimal_rows("\n".join(cells), "\n", 1, (0,))
    assert flat is not None
    assert flat.tobytes() == expected.tobytes()
    lines = [";".join(cells[k : k + 4]) for k in range(0, len(cells), 4)]
    table = decimal_rows("\r\n".join(lines) + "\r\n", ";", 4, (3, 1, 1))
    assert table is not None
    assert table.tobytes() == expected.reshape(-1, 4)[:, [3, 1, 1]].tobytes()


ROUND = "1.5,2.5\n" * 40


@pytest.mark.parametrize(
    "text",
    [
        *(ROUND + row for row in ("1.5\n", "1.5,2.5,3.5\n1.5\n", "1.5,2 5\n", "1.5,--2.5\n")),
        *(
            ROUND + row
            for row in ("1.5,2.5x\n", "1.5,\n", "\n", "1.5,2:5\n", "1.5,٢.5\n", "1.5,2.5\x0c")
        ),
        "1e3,2e3\n" * 40,
    ],
)
def test_other_cells_are_left_to_the_reader_of_lines(text: str) -> None:
    """Property: another width, another character or another form than digits around a point."""
    assert decimal_rows(ROUND, ",", 2, (0, 1)) is not None
    assert decimal_rows(text, ",", 2, (0, 1)) is None
