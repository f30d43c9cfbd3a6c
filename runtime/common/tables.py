"""A table of text, stated once and rendered for the terminal, for HTML and as Markdown."""

import html
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

NOTHING = "–"


@dataclass(frozen=True, slots=True)
class Table:
    """Header and rows of text."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    total: tuple[str, ...] = ()  # last row, which sorting leaves in place
    title: str = ""  # caption of the terminal and of notebooks
    note: str = ""  # small text below, of the terminal
    kind: str = "numbers"  # class of the HTML table: numbers, or facts (two columns of words)
    flagged: frozenset[int] = frozenset()  # rows that are highlighted as faults
    groups: tuple[tuple[str, int], ...] = ()  # (heading, columns), together all columns
    column_methods: tuple[str, ...] = ()  # column_methods, row_methods: for the filter; "" for none
    row_methods: tuple[str, ...] = ()
    row_anchors: tuple[str, ...] = ()  # HTML ids of rows

    def __html__(self) -> str:
        """HTML of the table; templates insert it as it is."""
        lines = [f'<table class="{self.kind}">']
        if self.title:
            lines.append(f"<caption><b>{html.escape(self.title)}</b></caption>")
        if self.header:
            groups = "".join(f'<th colspan="{n}">{html.escape(x)}</th>' for x, n in self.groups)
            lines.append(f"<thead>\n<tr>{groups}</tr>" if groups else "<thead>")
            lines.append(f"<tr>{self._cells(self.header, 'th')}</tr>\n</thead>")
        lines.append("<tbody>")
        for k, row in enumerate(self.rows):
            marks = ' class="flagged"' if k in self.flagged else ""
            marks += _mark("data-m", self.row_methods, k) + _mark("id", self.row_anchors, k)
            lines.append(f"<tr{marks}>{self._cells(row, 'td')}</tr>")
        lines.append("</tbody>")
        if self.total:
            lines.append(f"<tfoot><tr>{self._cells(self.total, 'td')}</tr></tfoot>")
        return "\n".join([*lines, "</table>"])

    def _cells(self, cells: Iterable[str], tag: str) -> str:
        """Cells of one row, what follows ± in small."""
        texts = []
        for k, cell in enumerate(cells):
            text, sign, spread = html.escape(str(cell)).partition(" ± ")
            small = f" <small>± {spread}</small>" if sign else ""
            texts.append(f"<{tag}{_mark('data-m', self.column_methods, k)}>{text}{small}</{tag}>")
        return "".join(texts)

    def markdown(self) -> str:
        """Markdown of the table; headings of groups stand before those of their columns."""
        head = list(self.header)
        if self.groups:
            above = [text for text, width in self.groups for _ in range(width)]
            head = [f"{a}: {b}" if a else b for a, b in zip(above, head, strict=True)]
        lines = [head, ["---", *("---:" for _ in head[1:])], *self.rows, self.total]
        return "\n".join(
            f"| {' | '.join(cell.replace('|', '∣') for cell in line)} |" for line in lines if line
        )


def percent(value: float | None, digits: int = 2) -> str:
    """Percentage with a no-break space before its sign, without decimals from 100 on."""
    if value is None or not math.isfinite(value):
        return number(value)
    return f"{value:.{digits if abs(value) < 100 else 0}f}\N{NO-BREAK SPACE}%"


def significant(value: float, digits: int = 2) -> str:
    """Number rounded to significant digits, without an exponent between 1e-4 and 1e6."""
    return f"{float(f'{value:.{digits}g}'):g}"


def number(value: float | None) -> str:
    """Four decimals between 1e-3 and 1e5, else four significant digits; a dash without a number."""
    if value is None or not math.isfinite(value):
        return "∞" if value is not None and value > 0 else NOTHING
    return f"{value:.4f}" if value == 0 or 1e-3 <= abs(value) < 1e5 else f"{value:.3e}"


def _mark(name: str, values: Sequence[str], k: int) -> str:
    value = values[k] if values else ""
    return f' {name}="{html.escape(value)}"' if value else ""
