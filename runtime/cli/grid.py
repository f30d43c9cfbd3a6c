"""Tables of commands: drawn by rich in a terminal, and line by line in a file or a pipe.

Importing rich takes 50 ms, a tenth of a short identification; in a file its tables are plain text.
"""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

_SIMPLE = re.compile(r"[ -Z^-~\]]*")
"""Text that rich prints as it is: ASCII without markup and escapes."""
_EMOJI = re.compile(r":\S*?:")


@dataclass(frozen=True, slots=True)
class Grid:
    """A table of texts with one line of headings.

    Attributes:
        heads: headings of the columns; the first column is flush left, the others flush right.
        rows: cells of the rows.
        title: above the table; None for none.
        last_apart: draw a line above the last row.
        folds: break long words of the first column in place of cutting them off.
    """

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    title: str | None = None
    last_apart: bool = False
    folds: bool = False

    def __rich__(self) -> "Table":
        """The table of rich."""
        from rich.table import Column, Table

        first = Column(self.heads[0], overflow="fold" if self.folds else "ellipsis")
        others = (Column(head, justify="right") for head in self.heads[1:])
        table = Table(first, *others, title=self.title)
        for k, row in enumerate(self.rows, start=1):
            if self.last_apart and k == len(self.rows):
                table.add_section()
            table.add_row(*row)
        return table

    def plain(self, width: int) -> str | None:
        """The text that rich writes to a file.

        Args:
            width: characters of a line.

        Returns:
            Lines, each with its end; None where only rich can lay the table out.
        """
        lines = (self.heads, *self.rows)
        if not all(is_simple(cell) for line in lines for cell in (*line, self.title or "")):
            return None
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        whole = sum(widths) + 3 * len(widths) + 1
        if whole > width or len(self.title or "") > whole:
            return None

        def rule(left: str, line: str, between: str, right: str) -> str:
            return left + between.join(line * (size + 2) for size in widths) + right

        def cells(row: tuple[str, ...], edge: str) -> str:
            first, *others = zip(row, widths, strict=True)
            texts = [first[0].ljust(first[1]), *(text.rjust(size) for text, size in others)]
            return edge + edge.join(f" {text} " for text in texts) + edge

        drawn = [cells(row, "│") for row in self.rows]
        if self.last_apart:
            drawn.insert(len(drawn) - 1, rule("├", "─", "┼", "┤"))
        drawn = [
            rule("┏", "━", "┳", "┓"),
            cells(self.heads, "┃"),
            rule("┡", "━", "╇", "┩"),
            *drawn,
            rule("└", "─", "┴", "┘"),
        ]
        if self.title is not None:
            before = (whole - len(self.title)) // 2
            drawn.insert(0, (" " * before + self.title).ljust(whole))
        return "".join(line + "\n" for line in drawn)


def is_simple(text: str) -> bool:
    """Whether rich prints a text as it is: without markup, names of emoji and control codes."""
    return _SIMPLE.fullmatch(text) is not None and not may_hold_emoji(text)


def may_hold_emoji(text: str) -> bool:
    """Whether a text has a word between colons, which rich replaces where it names an emoji."""
    return _EMOJI.search(text) is not None
