"""Tables of texts, for the console and as Markdown."""

from collections.abc import Iterable, Sequence

from rich.table import Table


def table(head: Sequence[str], lines: Iterable[Sequence[str]], title: str, caption: str) -> Table:
    """One line per entry; all columns but the first hold numbers."""
    shown = Table(*head, title=title, caption=caption)
    for column in shown.columns[1:]:
        column.justify = "right"
    for cells in lines:
        shown.add_row(*cells)
    return shown


def markdown(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Table as Markdown."""
    rows = [f"| {' | '.join(cells)} |" for cells in (head, *lines)]
    return "\n".join((rows[0], "|---" * len(head) + "|", *rows[1:]))
