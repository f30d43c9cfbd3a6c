"""Text logs that stay in their file: the head of one, and its rows parsed once into a spool."""

from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path

import numpy as np

from runtime.errors import RecordingError
from runtime.recording.formats.spool import Spool
from runtime.recording.formats.tables import Columns, FloatArray
from runtime.recording.formats.text_blocks import lines_of
from runtime.recording.formats.text_tables import csv_table, find_header

PIECE = 2**23
"""Number of characters that are parsed at once; a line must be shorter."""


def head_of_text(path: Path) -> str:
    """Whole lines of the first piece of a text."""
    return next(_pieces(path), "")


class CsvRows:
    """Columns of a CSV as rows of numbers; a corrupt line is NaN.

    Raises:
        RecordingError: no such columns, no text, or no room for the numbers.
    """

    def __init__(self, path: Path, kinds: Mapping[str, Columns]) -> None:
        ends = np.cumsum([0, *(len(columns) for columns in kinds.values())])
        self._places = {
            kind: slice(a, b) for kind, a, b in zip(kinds, ends, ends[1:], strict=False)
        }
        self._width = int(ends[-1])
        self._spool = Spool(path.name)
        columns = tuple(column for each in kinds.values() for column in each)
        for values in _parsed(path, columns):
            self._spool.append(values)
        self.count = self._spool.size // self._width

    def read(self, start: int, stop: int) -> dict[str, FloatArray]:
        """Rows start … stop of every kind of signal."""
        count = (stop - start) * self._width
        values = self._spool.read(start * self._width, count).reshape(-1, self._width)
        return {kind: values[:, place] for kind, place in self._places.items()}


def _parsed(path: Path, columns: Columns) -> Iterator[FloatArray]:
    names = tuple(column for column in columns if isinstance(column, str))
    header = ""
    for number, piece in enumerate(_pieces(path)):
        if number == 0 and names:
            place = find_header(lines_of(piece), names, path.name)
            header = next(islice(lines_of(piece), place, None)) + "\n"
        yield csv_table(header * (number > 0) + piece, columns, path.name).values


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
