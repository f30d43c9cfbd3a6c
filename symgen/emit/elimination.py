"""Which rows and columns take part when rows of a known 0/1 pattern are eliminated into a triangle.

One row of the pattern stands for all rows of that kind, such as those of one joint: they go into a
triangular factor that is kept, column by column, by orthogonal transformations. A transformation
mixes the rows that it touches, so each of them is filled where any of them was (George & Heath,
Linear Algebra Appl. 34, 1980).
"""

from collections.abc import Sequence
from dataclasses import dataclass

PANEL = 8
"""Most columns of a panel: they stay in the first cache while they are applied to others."""


@dataclass(frozen=True, slots=True)
class Panel:
    """Neighbouring columns with the same rows, each one with all later ones to its right.

    Attributes:
        first: the leftmost column.
        width: at most `PANEL`.
        rows: those with an entry in these columns, ascending.
        columns: those right of the panel that change, ascending.
    """

    first: int
    width: int
    rows: tuple[int, ...]
    columns: tuple[int, ...]


def eliminate(pattern: Sequence[Sequence[bool]], count: int) -> tuple[Panel, ...]:
    """The panels of the first `count` columns of a 0/1 pattern (rows, columns), left to right.

    The other columns, such as a right-hand side, are carried along. Empty columns have no panel.
    """
    filled = [{c for c, here in enumerate(row) if here} for row in pattern]
    panels: list[Panel] = []
    for c in range(count):
        rows = tuple(i for i, row in enumerate(filled) if c in row)
        if not rows:
            continue
        right = {j for i in rows for j in filled[i] if j > c}
        for i in rows:
            filled[i] = set(right)
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
    """(row, column) that are zero in the pattern and not after some elimination."""
    touched = {
        (i, c)
        for panel in panels
        for i in panel.rows
        for c in (*range(panel.first, panel.first + panel.width), *panel.columns)
    }
    return sorted((i, c) for i, c in touched if not pattern[i][c])
