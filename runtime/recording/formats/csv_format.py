"""Log formats of text: CSV with a header or numbered columns, and flat text, one number per line.

By the default convention a CSV has the header t, q1 … qn [, dq1 … dqn] [, ddq1 … ddqn]
[, tau1 … taun] in SI units. A CSV by libfranka's logToCSV has the header time, success_rate,
state.q[0] …, with the time in ms.
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from pathlib import Path
from typing import IO, Any

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array
from runtime.recording.formats import log_format, text_tables
from runtime.recording.formats.tables import Columns, LogTable, Spool, SpooledRows
from runtime.recording.recipes.default_convention import columns_convention, unread_columns
from runtime.recording.recipes.recipe import SI, Recipe, Signal, Time
from runtime.recording.recording import Recording

FRANKA = {"q": "position", "dq": "velocity", "tau_J": "torque"}  # column of logToCSV → its signal
HEAD, FRANKA_HEAD = 200, 50  # lines in which a header is looked for: any one, and that of logToCSV
PIECE = 2**23  # characters of a streamed text that are parsed at once; a line must be shorter


class TextReader(log_format.LogReader):
    """Reader of a CSV."""

    def text(self) -> str:
        """Text of the file, or the head of one that stays in its file."""
        if self.raw.in_place and self.raw.name.lower().endswith(".gz"):
            raise RecordingError(
                f"a log is streamed from uncompressed text, got {self.raw.name!r}; expand it, or "
                "read it as a whole with --settings stream=false"
            )
        if self.raw.in_place:
            return next(_pieces(self.raw.hashed()), "")
        return text_tables.decode(self.raw.data(), self.raw.name)

    def convention(self) -> Recipe:
        """Recipe of a header by the convention, or by logToCSV."""
        text = self.text()
        franka = _franka_convention(islice(text_tables.lines_of(text), FRANKA_HEAD))
        if franka is not None:
            return franka
        place = text_tables.find_header(text_tables.lines_of(text), ("q1",), self.raw.name)
        titles = text_tables.cells_of(next(islice(text_tables.lines_of(text), place, None)))[0]
        self.said = unread_columns(titles, self.raw.name)
        return columns_convention(titles, "csv", self.raw.name)

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Columns that a part of the recipe names.

        Args:
            kind: of signal, for messages.
            part: columns by name or index.

        Returns:
            Table of (N, m) numbers.
        """
        text, columns = self.text(), part.columns
        if not columns or columns == ("",):
            raise RecordingError(
                f"the recipe names no columns of {self.raw.name} for {kind}; write columns = [...]"
            )
        if isinstance(part, Signal) and part.cells:
            return text_tables.list_table(text, columns[0], self.raw.name)
        return text_tables.csv_table(text, columns, self.raw.name)

    def rows(self, parts: Mapping[str, Signal | Time]) -> log_format.LogRows:
        """Rows of the columns, parsed once into a spool; a corrupt line is NaN."""
        log_format.require_whole_columns(parts, self.raw.name)
        path, columns = self.raw.hashed(), [part.columns for part in parts.values()]
        ends = np.cumsum([0, *map(len, columns)])
        places = {kind: slice(a, b) for kind, a, b in zip(parts, ends, ends[1:], strict=False)}
        spool = Spool(path.name)
        for values in _parsed(path, tuple(chain.from_iterable(columns))):
            spool.append(values)
        return SpooledRows(spool, int(ends[-1]), places)

    def head(self) -> list[list[str]]:
        """Cells of the first lines that are not blank."""
        every = text_tables.lines_of(text_tables.decode(self.raw.data(), self.raw.name))
        lines = islice(every, HEAD)
        return [text_tables.cells_of(line)[0] for line in lines if line.strip()]


class FlatReader(TextReader):
    """Reader of text with one number per line."""

    convention = log_format.LogReader.convention
    rows = log_format.LogReader.rows

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Numbers of the file, `width` per sample."""
        return text_tables.flat_table(self.text(), part.width, self.raw.name)


def _parsed(path: Path, columns: Columns) -> Iterator[Array]:
    names = tuple(column for column in columns if isinstance(column, str))
    header = ""
    for number, piece in enumerate(_pieces(path)):
        if number == 0 and names:
            place = text_tables.find_header(text_tables.lines_of(piece), names, path.name)
            header = next(islice(text_tables.lines_of(piece), place, None)) + "\n"
        yield text_tables.csv_table(header * (number > 0) + piece, columns, path.name).values


def _pieces(path: Path) -> Iterator[str]:
    """The text in pieces of whole lines, without empty ones."""
    held, rest = "", ""
    try:
        with path.open(encoding="utf-8-sig") as file:
            while piece := file.read(PIECE):
                whole, mark, rest = (rest + piece).rpartition("\n")
                if (not mark and len(rest) >= PIECE) or "\0" in piece:
                    raise ValueError
                if whole.strip():
                    if held:
                        yield held
                    held = whole + mark
    except ValueError as error:
        raise RecordingError(
            f"{path.name} is expected to be UTF-8 text in lines, but holds other bytes; export it "
            "as UTF-8 CSV, or as NPZ with the suffix .npz"
        ) from error
    if held.strip() or rest.strip():
        yield held + rest  # a line that was cut short is not parsed alone


def _franka_convention(lines: Iterable[str]) -> Recipe | None:
    """Recipe of a file of logToCSV; None where no header is one of it."""
    for line in lines:
        titles = text_tables.cells_of(line)[0]
        prefix = next((p for p in ("state.", "") if f"{p}q[0]" in titles), None)
        if prefix is None or "time" not in titles:
            continue
        signals: dict[str, Any] = {}
        for key, kind in FRANKA.items():
            names = (f"{prefix}{key}[{i}]" for i in range(len(titles)))
            present = tuple(name for name in names if name in titles)
            if present:
                signals[kind] = Signal(unit=SI[kind], layout="csv", columns=present)
        return Recipe(time=Time(column="time", unit="ms", layout="csv"), **signals)
    return None


def _write(recording: Recording, file: IO[bytes]) -> None:
    titles, values = recording.titled()
    np.savetxt(file, values, fmt="%.17g", delimiter=",", header=",".join(titles), comments="")


CSV = log_format.LogFormat(
    name="csv",
    sentence="text in columns with a header, separated by comma, semicolon, tab or blanks",
    suffixes=(".csv", ".txt", ".tsv", ".csv.gz", ".txt.gz", ".tsv.gz"),
    reader=TextReader,
    write=_write,
    has_titles=True,
)
FLAT = log_format.LogFormat(
    name="flat", sentence="text with one number per line", suffixes=(), reader=FlatReader
)
