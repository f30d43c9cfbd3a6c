"""Rows of a text, block by block: numbers at once, and the lines of a block with an odd one singly.

A comment, a repeated header or a corrupt row costs the single lines of its block, not of the file.
"""

from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from runtime.recording.formats.plain_numbers import plain_numbers, plain_rows
from runtime.recording.formats.tables import FloatArray

BLOCK, PART = 2**24, 2**18
"""Numbers of characters that are parsed at once: first, and again where a line is odd."""
PIECE = 2**14
"""Number of characters that are divided at once; a short line takes 30 times its text."""


class RowForm(NamedTuple):
    """Form of the rows of a table.

    Attributes:
        reference: header, or the first row where there is none.
        is_titled: whether the reference is a header.
        separator: of cells; None for blanks.
        width: number of cells.
        picks: indices of the columns that are read.
    """

    reference: str
    is_titled: bool
    separator: str | None
    width: int
    picks: list[int]


@dataclass(frozen=True, slots=True, eq=False)
class RowBlock:
    """Rows of some lines.

    Attributes:
        values: (N, m) numbers; a corrupt row is NaN.
        lines: (N,) line of the file of each row.
        widths: number of rows by number of cells.
        repeated: number of repeated headers.
        count: number of lines, with those that are no rows.
    """

    values: FloatArray
    lines: NDArray[np.int64]
    widths: Counter[int]
    repeated: int
    count: int


def lines_of(text: str) -> Iterator[str]:
    """Lines of a text as `splitlines` divides it, in pieces."""
    for piece in _pieces(text, 0, PIECE):
        yield from piece.splitlines()


def behind(text: str, count: int) -> int:
    """Place behind the first lines of a text."""
    start = 0
    for piece in _pieces(text, 0, PIECE):
        ends = [len(line) for line in piece.splitlines(keepends=True)[:count]]
        start, count = start + sum(ends), count - len(ends)
        if not count:
            break
    return start


def row_blocks(text: str, start: int, line: int, form: RowForm) -> Iterator[RowBlock]:
    """Rows of a text in their order."""
    for piece in _pieces(text, start, BLOCK):
        for block in _blocks(piece, line, form):
            line += block.count
            yield block


def _blocks(text: str, line: int, form: RowForm, is_part: bool = False) -> Iterator[RowBlock]:
    plain = None
    if form.separator is not None:
        plain = plain_rows(text, lines_of(text), form.separator, form.width, form.picks)
    if plain is not None:
        count = len(plain)
        lines = line + np.arange(count)
        yield RowBlock(plain, lines, Counter({form.width: count}), 0, count)
    elif not is_part:
        for piece in _pieces(text, 0, PART):
            for block in _blocks(piece, line, form, is_part=True):
                line += block.count
                yield block
    else:
        yield _single_lines(text, line, form)


def _single_lines(text: str, line: int, form: RowForm) -> RowBlock:
    rows, numbers = array("d"), array("q")  # a list of lists takes four times the memory
    widths: Counter[int] = Counter()
    repeated = count = 0
    corrupt = [np.nan] * len(form.picks)
    header = form.reference.strip() if form.is_titled else None
    for count, each in enumerate(lines_of(text), 1):
        stripped = each.strip()
        if not stripped or stripped.startswith("#"):
            continue
        if stripped == header:
            repeated += 1
            continue
        cells = split_cells(each, form.separator)
        widths[len(cells)] += 1
        good = len(cells) == form.width
        rows.extend([number_in(cells[i], form.separator) for i in form.picks] if good else corrupt)
        numbers.append(line + count - 1)
    values = np.array(rows, dtype=np.float64).reshape(-1, len(form.picks))
    return RowBlock(values, np.array(numbers, dtype=np.int64), widths, repeated, count)


def flat_numbers(text: str, start: int) -> FloatArray:
    """Numbers of a text with one per line."""
    return np.concatenate([_flat(piece) for piece in _pieces(text, start, BLOCK)])


def _flat(text: str, is_part: bool = False) -> FloatArray:
    numbers = plain_numbers(text)
    if numbers is not None:
        return numbers
    if not is_part:
        return np.concatenate([_flat(piece, is_part=True) for piece in _pieces(text, 0, PART)])
    return np.array([number_in(line.strip(), None) for line in lines_of(text)])


def _pieces(text: str, start: int, size: int) -> Iterator[str]:
    """Whole lines of about a size; they end at a line feed."""
    while start < len(text):
        end = text.find("\n", start + size) + 1 or len(text)
        yield text[start:end]
        start = end


def split_cells(line: str, separator: str | None) -> list[str]:
    """Cells of a line without blanks and quotes."""
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def number_in(cell: str, separator: str | None) -> float:
    """The number in a cell, or NaN."""
    if "," in cell and separator != ",":
        cell = cell.replace(",", ".") if cell.count(",") == 1 and "." not in cell else ""
    if "_" in cell:
        return np.nan
    try:
        return float(cell)
    except ValueError:
        return np.nan
