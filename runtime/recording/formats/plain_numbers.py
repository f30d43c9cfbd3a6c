"""Rows of plain numbers, parsed at once.

Only text in which every line has as many cells, and every wanted cell is a number for `float`, is
parsed here. Anything else is left to `text_tables`, which looks at each line and names a bad one.
"""

import warnings
from array import array
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from runtime.recording.formats.decimals import decimals
from runtime.recording.formats.tables import FloatArray

LONG = 2**22
"""Number of characters from which pyarrow, where it is installed, repays its import."""
PIECE = 2**16
"""Number of characters that are divided into lines at once."""
MANY = 4
"""A row of up to so many times the wanted cells is parsed as a whole."""
_BLANKS = frozenset(b" \t\n\v\f\r")
LINES = 512
"""Number of lines whose cells are held at once; a cell takes five times its text."""


def plain_numbers(text: str) -> FloatArray | None:
    """Numbers of lines with one number each."""
    parsed = _parsed(text.removesuffix("\n"), "\n")
    if parsed is not None:
        return parsed
    if "_" in text:  # float reads 1_0 as 10
        return None
    numbers, start = array("d"), 0
    try:
        while start < len(text):
            end = text.find("\n", start + PIECE) + 1 or len(text)
            numbers.extend(map(float, text[start:end].splitlines()))
            start = end
    except ValueError:
        return None
    return np.frombuffer(numbers, dtype=np.float64)


def _parsed(text: str, separator: str) -> FloatArray | None:
    """Cells in pieces, to the bit as by `float` in half of its time."""
    data, mark = text.encode(errors="replace"), separator.encode()
    pieces, start = [], 0
    while start <= len(data):
        end = data.find(mark, start + PIECE)
        piece = data[start:] if end < 0 else data[start:end]
        numbers = decimals(piece, mark)
        if numbers is None:
            numbers = _by_numpy(piece, mark)
        if numbers is None:
            return None
        pieces.append(numbers)
        start = len(data) + 1 if end < 0 else end + 1
    return np.concatenate(pieces)


def _by_numpy(text: bytes, separator: bytes) -> FloatArray | None:
    """Cells of any form by NumPy's parser; arguments and result as for `_parsed`."""
    # NumPy takes any white space, or none, for a separator that is white space. Without other
    # white space and empty cells, as many numbers as cells means one number in each.
    if any(mark in text for mark in _BLANKS - set(separator)) or 2 * separator in text:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # of NumPy, for text that is no number
        try:
            numbers = np.fromstring(text, sep=separator.decode())
        except (ValueError, DeprecationWarning):
            return None
    is_whole = len(numbers) == text.count(separator) + 1 and not text.startswith(separator)
    return numbers if is_whole else None


def plain_rows(
    text: str, lines: Iterator[str], separator: str, width: int, picks: Sequence[int]
) -> FloatArray | None:
    """Chosen columns of a text of numbers."""
    if "_" in text:
        return None
    if len(text) >= LONG and (parsed := _by_pyarrow(text, separator, width, picks)) is not None:
        return parsed
    tables = []
    while part := list(islice(lines, LINES)):
        if any(line.count(separator) != width - 1 for line in part):
            return None
        whole = separator.join(part)
        if MANY * len(picks) >= width:
            numbers = _parsed(whole, separator)
            if numbers is not None and len(numbers) == len(part) * width:
                tables.append(numbers.reshape(-1, width)[:, picks])
                continue
        cells = whole.split(separator)
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
