"""Rows of plain numbers, parsed at once.

Only text in which every line has as many cells, and every wanted cell is a number for `float`, is
parsed here. Anything else is left to `text_tables`, which looks at each line and names a bad one.
"""

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from runtime.recording.formats.decimals import decimal_rows
from runtime.recording.formats.tables import FloatArray

LONG = 2**22
"""Number of characters from which pyarrow, where it is installed, repays its import."""
PIECE = 2**16
"""Number of characters that are divided into lines at once."""
LINES = 512
"""Number of lines whose cells are held at once; a cell takes five times its text."""


def plain_numbers(text: str) -> FloatArray | None:
    """Numbers of lines with one number each.

    Args:
        text: lines as `splitlines` divides them.

    Returns:
        (N,); None where a line is something else.
    """
    if "_" in text:  # float reads 1_0 as 10
        return None
    blocks = []
    for piece in _pieces(text):
        rows = decimal_rows(piece, "\n", 1, (0,))
        try:
            blocks.append(np.array(list(map(float, piece.splitlines()))) if rows is None else rows)
        except ValueError:
            return None
    return np.concatenate(blocks, axis=None) if blocks else np.empty(0)


def _pieces(text: str) -> Iterator[str]:
    """Whole lines, about `PIECE` characters at a time."""
    start = 0
    while start < len(text):
        end = text.find("\n", start + PIECE) + 1 or len(text)
        yield text[start:end]
        start = end


def plain_rows(
    text: str, lines: Iterator[str], separator: str, width: int, picks: Sequence[int]
) -> FloatArray | None:
    """Chosen columns of a text of numbers.

    Args:
        text: rows without a header.
        lines: of the same text.
        separator: of cells.
        width: number of cells of every line.
        picks: indices of the columns.

    Returns:
        (N, len(picks)); None where a line has another width or a cell is not a number.
    """
    if "_" in text:
        return None
    if len(text) >= LONG and (parsed := _by_pyarrow(text, separator, width, picks)) is not None:
        return parsed
    tables = []
    for piece in _pieces(text):
        if (rows := decimal_rows(piece, separator, width, picks)) is None:
            break
        tables.append(rows)
    else:
        return np.concatenate(tables) if tables else None
    tables = []
    while part := list(islice(lines, LINES)):
        if any(line.count(separator) != width - 1 for line in part):
            return None
        cells = separator.join(part).split(separator)
        try:
            columns = [np.array(list(map(float, cells[pick::width]))) for pick in picks]
        except ValueError:
            return None
        tables.append(np.stack(columns, axis=1))
    return np.concatenate(tables) if tables else None


def _by_pyarrow(text: str, separator: str, width: int, picks: Sequence[int]) -> FloatArray | None:
    """The same by a parser in C++ with a thread per core; None where it is not installed."""
    try:
        import pyarrow as pa
        from pyarrow import csv
    except ImportError:
        return None
    names = [str(k) for k in range(width)]
    wanted = [names[pick] for pick in picks]
    try:
        table = csv.read_csv(
            pa.py_buffer(text.encode()),
            csv.ReadOptions(column_names=names),
            csv.ParseOptions(delimiter=separator, quote_char=False, ignore_empty_lines=False),
            csv.ConvertOptions(
                check_utf8=False,
                column_types=dict.fromkeys(names, pa.float64()),
                null_values=[],
                include_columns=list(dict.fromkeys(wanted)),
            ),
        )
    except pa.ArrowInvalid:
        return None
    out = np.empty((table.num_rows, len(picks)))
    for k, name in enumerate(wanted):
        out[:, k] = table.column(name).to_numpy()
    return out
