"""Rows and columns that take part when rows of a known 0/1 pattern are eliminated.

One row of the pattern stands for all rows of that kind, such as those of one joint. They are
eliminated into a triangular factor that is kept, column by column, by orthogonal transformations. A
transformation mixes the rows that it touches, so each of them is filled where any of them was
(George & Heath, Linear Algebra Appl. 34, 1980).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

PANEL = 8
"""Largest number of columns of a panel: they stay in the first-level cache while applied."""


@dataclass(frozen=True, slots=True)
class Panel:
    """Neighbouring columns with the same rows, each with all later ones to its right.

    Attributes:
        first: the leftmost column.
        width: number of columns, at most `PANEL`.
        rows: rows with an entry in these columns, ascending.
        columns: columns to the right of the panel that change, ascending.
    """

    first: int
    width: int
    rows: tuple[int, ...]
    columns: tuple[int, ...]


def eliminate(pattern: Sequence[Sequence[bool]], count: int) -> tuple[Panel, ...]:
    """Panels of the first columns of a 0/1 pattern, left to right."""
    filled = [{c for c, here in enumerate(row) if here} for row in pattern]
    panels: list[Panel] = []
    for c in range(count):
        rows = tuple(i for i, row in enumerate(filled) if c in row)
        if not rows:
            continue
        # Column c is eliminated from its rows; they all get the union of their entries beyond c.
        right = {j for i in rows for j in filled[i] if j > c}
        for i in rows:
            filled[i] = set(right)
        # Column c joins the panel before it if the rows agree and that panel changes c and `right`.
        last = panels[-1] if panels else None
        if (
            last is not None
            and last.width < PANEL
            and last.first + last.width == c
            and last.rows == rows
            and last.columns == (c, *sorted(right))
        ):
            panels[-1] = Panel(last.first, last.width + 1, rows, tuple(sorted(right)))
        else:
            panels.append(Panel(c, 1, rows, tuple(sorted(right))))
    return tuple(panels)


def fill_in(pattern: Sequence[Sequence[bool]], panels: Sequence[Panel]) -> list[tuple[int, int]]:
    """Entries that are zero in the pattern and filled by some elimination."""
    touched = {
        (i, c)
        for panel in panels
        for i in panel.rows
        for c in (*range(panel.first, panel.first + panel.width), *panel.columns)
    }
    return sorted((i, c) for i, c in touched if not pattern[i][c])


@dataclass(frozen=True, slots=True)
class Range:
    """Neighbouring columns, `first` to before `end`, and the rows that they share with others."""

    first: int
    end: int
    rows: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Run:
    """Neighbouring columns with the same rows.

    Attributes:
        first: the leftmost column.
        width: number of columns.
        ranges: columns from `first` on that share rows with them, ascending.
    """

    first: int
    width: int
    ranges: tuple[Range, ...]


def shared_columns(pattern: Sequence[Sequence[bool]]) -> tuple[Run, ...]:
    """Columns of a 0/1 pattern whose products with later columns are not zero."""
    count = len(pattern[0])
    rows = [tuple(i for i, row in enumerate(pattern) if row[c]) for c in range(count)]
    runs: list[Run] = []
    for c in range(count):
        if not rows[c]:
            continue
        if runs and runs[-1].first + runs[-1].width == c and rows[c] == rows[c - 1]:
            runs[-1] = replace(runs[-1], width=runs[-1].width + 1)
            continue
        ranges: list[Range] = []
        for j in range(c, count):
            common = tuple(i for i in rows[c] if i in rows[j])
            if ranges and ranges[-1].end == j and ranges[-1].rows == common:
                ranges[-1] = replace(ranges[-1], end=j + 1)
            elif common:
                ranges.append(Range(j, j + 1, common))
        runs.append(Run(c, 1, tuple(ranges)))
    return tuple(runs)
