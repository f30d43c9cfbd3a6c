"""Text of a log → a table of numbers: CSV, and flat text with one number per line.

A corrupt row stays in its place as NaN, so that files which belong together by row number stay
aligned; the reader drops it. Units, signs and order are left to `reader`.
"""

import zlib
from collections import Counter
from collections.abc import Iterable
from itertools import islice

import numpy as np

from runtime.errors import RecordingError
from runtime.recording.formats.tables import EXPANSION, MAX_CORRUPT, SLACK, Columns, LogTable
from runtime.recording.formats.text_blocks import (
    RowForm,
    behind,
    flat_numbers,
    lines_of,
    number_in,
    row_blocks,
    split_cells,
)

SHOWN = 60
"""Largest number of characters of a line in a message."""
GZIP = b"\x1f\x8b"
"""First bytes of gzip data."""


def decode(data: bytes, name: str) -> str:
    """Text of a log."""
    if data.startswith(GZIP):
        data = _expanded(data, name)
    if not data.strip():
        raise RecordingError(f"{name} is empty; expected rows of numbers, so export the log again")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise RecordingError(
            f"{name} is expected to be UTF-8 text, but holds other bytes; "
            "export it as UTF-8 CSV, or as NPZ with the suffix .npz"
        )
    return text


def _expanded(data: bytes, name: str) -> bytes:
    """Content of gzip data; a small file may expand to gigabytes, so its size is limited."""
    most = EXPANSION * len(data) + SLACK
    stream = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)  # 16: a gzip header
    try:
        content = stream.decompress(data, most + 1)
    except zlib.error as error:
        raise RecordingError(f"{name} is damaged ({error}); compress the log again") from None
    if len(content) > most:
        raise RecordingError(
            f"{name} expands to more than {most >> 20} MiB, the decompression limit for its size; "
            "give the uncompressed file"
        )
    if not stream.eof:
        raise RecordingError(f"{name} is cut short; copy or compress the log again")
    if stream.unused_data.startswith(GZIP):
        raise RecordingError(f"{name} holds several gzip members; compress the log as one file")
    return content


def cells_of(line: str) -> tuple[list[str], str | None]:
    """Cells of a line and its separator: `;`, else tab, else comma, else blanks (None)."""
    line = line.lstrip("# ")  # a header may be written as a comment
    separator = next((mark for mark in (";", "\t", ",") if mark in line), None)
    return split_cells(line, separator), separator


def find_header(lines: Iterable[str], wanted: tuple[str, ...], name: str) -> int:
    """Index of the first line whose cells contain all wanted names."""
    best: tuple[int, list[str]] = (0, list(wanted))
    first = ""
    for index, line in enumerate(lines):
        cells = cells_of(line)[0]
        first = first if index else ",".join(cells)
        missing = [column for column in wanted if column not in cells]
        if not missing:
            repeated = [cell for cell, count in Counter(cells).items() if count > 1 and cell]
            if set(repeated) & set(wanted):
                raise RecordingError(
                    f"{name} names the column {repeated[0]!r} twice in its header; name it once"
                )
            return index
        if len(wanted) - len(missing) > best[0]:
            best = (len(wanted) - len(missing), missing)
    first = first if len(first) <= SHOWN else f"{first[:SHOWN]}…"
    raise RecordingError(
        f"{name} is expected to have a header line with the columns {', '.join(wanted)}, "
        f"but {', '.join(best[1][:4])} {'is' if len(best[1]) == 1 else 'are'} missing (its first "
        f"line: {first}); rename the columns, or have a recipe proposed: "
        "python -m runtime inspect LOG --recipe-out recipe.toml"
    )


def csv_table(text: str, columns: Columns, name: str) -> LogTable:
    """Chosen columns of a CSV, by header name or by index.

    Lines before the header are skipped, repeated headers and comments (#) omitted. A row with
    another number of cells, or a cell that is not a number, is NaN. Where the separator is not the
    comma, a comma inside a number is its decimal mark.
    """
    names = tuple(column for column in columns if isinstance(column, str))
    if names:
        header = find_header(lines_of(text), names, name)
        first = header + 1
    else:
        header, first = -1, _first_numeric(lines_of(text), name)
    reference = next(islice(lines_of(text), header if names else first, None))
    titles, separator = cells_of(reference)
    picks = [titles.index(c) if isinstance(c, str) else c for c in columns]
    if max(picks) >= len(titles):
        raise RecordingError(
            f"{name} is expected to have a column {max(picks)}, but has {len(titles)} columns "
            "(counted from 0); correct the recipe"
        )
    skipped = header if names else first
    remarks = [f"{name}: {skipped} lines before the header were skipped."] * (skipped > 0)
    marks = []
    if separator not in {",", None}:
        title = {";": "semicolons", "\t": "tabs"}[separator or ""]
        marks = [f"{name}: cells are separated by {title}, a comma is a decimal mark."]
    form = RowForm(reference, bool(names), separator, len(titles), picks)
    blocks = list(row_blocks(text, behind(text, first), first + 1, form))
    _check_widths(sum((block.widths for block in blocks), Counter()), len(titles), name)
    repeated = sum(block.repeated for block in blocks)
    remarks += [f"{name}: {repeated} repeated headers were left out."] * (repeated > 0)
    values = np.concatenate([block.values for block in blocks])
    lines = np.concatenate([block.lines for block in blocks])
    return LogTable(values, lines, (*remarks, *marks))


def flat_table(text: str, width: int, name: str) -> LogTable:
    """Table of a text with one number per line; a bad line keeps its place as NaN."""
    text = text.rstrip()
    first = _first_numeric(lines_of(text), name)
    numbers = flat_numbers(text, behind(text, first))
    count, rest = divmod(len(numbers), width)
    remarks = [f"{name}: {first} lines before the first number were skipped."] * (first > 0)
    if rest:
        remarks.append(f"{name}: the last sample was cut short ({rest} of {width} numbers).")
    values = numbers[: count * width].reshape(count, width)
    return LogTable(values, first + 1 + width * np.arange(count), tuple(remarks))


def _first_numeric(lines: Iterable[str], name: str) -> int:
    for index, line in enumerate(lines):
        cells, separator = cells_of(line)
        if cells and all(np.isfinite(number_in(cell, separator)) for cell in cells):
            return index
    raise RecordingError(f"{name} holds no row of numbers; expected one, so export the log again")


def _check_widths(widths: Counter[int], expected: int, name: str) -> None:
    total = sum(widths.values())
    if not total:
        raise RecordingError(f"{name} has a header but no rows below it; export the log again")
    if widths[expected] < (1.0 - MAX_CORRUPT) * total:
        common = next(width for width, _ in widths.most_common() if width != expected)
        raise RecordingError(
            f"{name} names {expected} columns, but {total - widths[expected]} of {total} rows have "
            f"another number of cells (mostly {common}); make the header match the rows"
        )
