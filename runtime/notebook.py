"""Small HTML tables by which results show themselves in a notebook; every text is escaped."""

from collections.abc import Iterable, Sequence
from html import escape

Cells = Sequence[object]


def html_table(title: str, rows: Iterable[Cells], head: Cells = ()) -> str:
    """HTML of one table with a caption.

    Args:
        title: caption.
        rows: cells of every line; the first of a line is its heading.
        head: headings of the columns; none where empty.

    Returns:
        A `<table>` without style sheets, so that the notebook's theme applies.
    """
    lines = ["<table>", f"<caption><b>{_text(title)}</b></caption>"]
    if head:
        cells = "".join(f"<th>{_text(cell)}</th>" for cell in head)
        lines.append(f"<thead><tr>{cells}</tr></thead>")
    lines.append("<tbody>")
    for first, *others in rows:
        cells = "".join(f"<td>{_text(cell)}</td>" for cell in others)
        lines.append(f'<tr><th scope="row">{_text(first)}</th>{cells}</tr>')
    return "\n".join([*lines, "</tbody>", "</table>"])


def _text(value: object) -> str:
    return escape(str(value))
