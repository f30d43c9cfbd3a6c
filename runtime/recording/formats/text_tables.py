"""Text of a log → a table of numbers: CSV, and flat text with one number per line.

A block of lines is parsed at once by pyarrow or NumPy, and line by line where one of them is odd: a
comment, a repeated header or a corrupt row costs the single lines of its block, not of the file. A
corrupt row stays in its place as NaN, so that files which belong together by row number stay
aligned; the reader drops it. Units, signs and order are left to `reader`.
"""

import csv
import json
import zlib
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array, Integers
from runtime.recording.formats.tables import EXPANSION, MAX_CORRUPT, SLACK, Columns, LogTable

SHOWN = 60  # largest number of characters of a line in a message
GZIP = b"\x1f\x8b"  # first bytes of gzip data
SIZES = 2**24, 2**18  # characters that are parsed at once: first, and again where a line is odd
LONG = 2**22  # number of characters from which pyarrow, where it is installed, repays its import
PIECE = 2**14  # number of characters that are divided at once; a short line takes 30 times its text


@dataclass(frozen=True, slots=True)
class RowForm:
    """Form of the rows of a table."""

    reference: str  # header, or the first row where there is none
    is_titled: bool  # whether the reference is a header
    separator: str | None  # of cells; None for blanks
    width: int  # number of cells
    picks: list[int]  # indices of the columns that are read
    keeps_all: bool = False  # whether empty lines and comments are rows, corrupt ones


FLAT = RowForm("", False, ";", 1, [0], keeps_all=True)  # one number per line; `;` is in none


@dataclass(frozen=True, slots=True, eq=False)
class RowBlock:
    """Rows of some lines."""

    values: Array  # (N, m) numbers; a corrupt row is NaN
    lines: Integers  # (N,) line of the file of each row
    widths: Counter[int]  # number of rows by number of cells
    repeated: int  # number of repeated headers
    count: int  # number of lines, with those that are no rows


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
        header, first = -1, _first_numeric(lines_of(text), name, columns)
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
    blocks = list(row_blocks(text, behind(text, first), first + 1, form, SIZES))
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
    blocks = row_blocks(text, behind(text, first), first + 1, FLAT, SIZES)
    numbers = np.concatenate([block.values[:, 0] for block in blocks])
    count, rest = divmod(len(numbers), width)
    remarks = [f"{name}: {first} lines before the first number were skipped."] * (first > 0)
    if rest:
        remarks.append(f"{name}: the last sample was cut short ({rest} of {width} numbers).")
    values = numbers[: count * width].reshape(count, width)
    return LogTable(values, first + 1 + width * np.arange(count), tuple(remarks))


def list_table(text: str, column: str | int, name: str) -> LogTable:
    """Column of a CSV whose cells are JSON lists of numbers; a corrupt row is NaN."""
    first = 0 if isinstance(column, int) else find_header(lines_of(text), (column,), name)
    header = next(islice(lines_of(text), first, None))
    titles, separator = cells_of(header)
    place = titles.index(column) if isinstance(column, str) else column
    lists, lines = list[list[float]](), list[int]()
    for line, each in enumerate(islice(lines_of(text), first, None), first + 1):
        if not each.strip() or each.strip().startswith("#") or each.strip() == header.strip():
            continue
        cells = split_cells(each, separator)
        lists.append(numbers_in(cells[place]) if place < len(cells) else [])
        lines.append(line)
    width, count = Counter(map(len, lists)).most_common(1)[0] if lists else (0, 0)
    if not width or count < (1.0 - MAX_CORRUPT) * len(lists):
        raise RecordingError(
            f"{name} is expected to have lists of numbers of one length, such as [0.1, 0.2], in "
            f"the column {column!r}; leave cells out of the recipe for cells of one number"
        )
    values = np.array([each if len(each) == width else [np.nan] * width for each in lists])
    return LogTable(values, np.array(lines, dtype=np.int64))


def numbers_in(cell: str) -> list[float]:
    """The numbers of a cell that is a JSON list; empty for any other."""
    try:
        values = json.loads(cell) if cell.startswith("[") else []
        return [float(value) for value in values]
    except (ValueError, TypeError, RecursionError):
        return []


def _first_numeric(lines: Iterable[str], name: str, columns: Columns = ()) -> int:
    """Index of the first line with numbers in the columns that are read."""
    most = max((k for k in columns if isinstance(k, int)), default=-1)
    for index, line in enumerate(lines):
        cells = cells_of(line)[0]
        if -1 < most < len(cells):
            cells = [cells[k] for k in columns if isinstance(k, int)]
        if cells and all(np.isfinite(number_in(cell)) for cell in cells):
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


def lines_of(text: str) -> Iterator[str]:
    """Lines of a text as `splitlines` divides it, in pieces."""
    return chain.from_iterable(piece.splitlines() for piece in _pieces(text, 0, PIECE))


def behind(text: str, count: int) -> int:
    """Place behind the first lines of a text."""
    start = 0
    for piece in _pieces(text, 0, PIECE):
        ends = [len(line) for line in piece.splitlines(keepends=True)[:count]]
        start, count = start + sum(ends), count - len(ends)
        if not count:
            break
    return start


def row_blocks(
    text: str, start: int, line: int, form: RowForm, sizes: Sequence[int]
) -> Iterator[RowBlock]:
    """Rows of a text in their order."""
    blocks: Iterable[RowBlock]
    for piece in _pieces(text, start, sizes[0]):
        plain = plain_rows(piece, form)
        if plain is not None:
            count = len(plain)
            widths = Counter({form.width: count})
            blocks = [RowBlock(plain, line + np.arange(count), widths, 0, count)]
        elif sizes[1:]:
            blocks = row_blocks(piece, 0, line, form, sizes[1:])
        else:
            blocks = [_single_lines(piece, line, form)]
        for block in blocks:
            line += block.count
            yield block


def plain_rows(text: str, form: RowForm) -> Array | None:
    """Chosen columns of a text in which each line is a row of numbers; None for any other."""
    separator, width = form.separator, form.width
    if separator is None or "_" in text:  # float reads 1_0 as 10
        return None
    if len(text) >= LONG and (parsed := _by_pyarrow(text, separator, form)) is not None:
        return parsed

    def lines() -> Iterator[str]:
        for line in lines_of(text):  # NumPy skips empty ones
            if line.count(separator) != width - 1 or not line or line.isspace():
                raise ValueError
            yield line

    try:
        return np.loadtxt(lines(), comments=None, delimiter=separator, usecols=form.picks, ndmin=2)
    except ValueError:
        return None


def _by_pyarrow(text: str, separator: str, form: RowForm) -> Array | None:
    """The same with a thread per core, in a quarter of the time; None where not installed."""
    try:
        import pyarrow as pa
        from pyarrow import csv as arrow_csv
    except ImportError:
        return None
    names = [str(k) for k in range(form.width)]
    wanted = [names[pick] for pick in form.picks]
    try:
        table = arrow_csv.read_csv(
            pa.py_buffer(text.encode()),
            arrow_csv.ReadOptions(column_names=names),
            arrow_csv.ParseOptions(delimiter=separator, quote_char=False, ignore_empty_lines=False),
            arrow_csv.ConvertOptions(
                check_utf8=False,
                column_types=dict.fromkeys(names, pa.float64()),
                null_values=[],
                include_columns=list(dict.fromkeys(wanted)),
            ),
        )
    except pa.ArrowInvalid:
        return None
    out = np.empty((table.num_rows, len(wanted)))
    for k, name in enumerate(wanted):
        out[:, k] = table.column(name).to_numpy()
    return out


def _single_lines(text: str, line: int, form: RowForm) -> RowBlock:
    rows, numbers = array("d"), array("q")  # a list of lists takes four times the memory
    widths: Counter[int] = Counter()
    repeated = count = 0
    corrupt = [np.nan] * len(form.picks)
    header = form.reference.strip() if form.is_titled else None
    for count, each in enumerate(lines_of(text), 1):
        stripped = each.strip()
        if not form.keeps_all and (not stripped or stripped.startswith("#")):
            continue
        if stripped == header:
            repeated += 1
            continue
        cells = split_cells(each, form.separator)
        widths[len(cells)] += 1
        good = len(cells) == form.width
        rows.extend([number_in(cells[i]) for i in form.picks] if good else corrupt)
        numbers.append(line + count - 1)
    values = np.array(rows, dtype=np.float64).reshape(-1, len(form.picks))
    return RowBlock(values, np.array(numbers, dtype=np.int64), widths, repeated, count)


def _pieces(text: str, start: int, size: int) -> Iterator[str]:
    """Whole lines of about a size; they end at a line feed."""
    while start < len(text):
        end = text.find("\n", start + size) + 1 or len(text)
        yield text[start:end]
        start = end


def split_cells(line: str, separator: str | None) -> list[str]:
    """Cells of a line without blanks and quotes, between which a separator divides nothing."""
    if '"' in line and separator is not None:
        try:
            (row,) = csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
        except (csv.Error, ValueError):  # a quote that is not closed, or within a cell
            row = line.split(separator)
        return [cell.strip() for cell in row]
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def number_in(cell: str) -> float:
    """The number in a cell, or NaN; a comma within quotes is a decimal mark too."""
    if "," in cell:
        cell = cell.replace(",", ".") if cell.count(",") == 1 and "." not in cell else ""
    if "_" in cell:
        return np.nan
    try:
        return float(cell)
    except ValueError:
        return np.nan
