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


def merged(before: str, after: str, keys: int) -> str:
    """Markdown table with the rows of another one in place of those with the same first cells."""
    head, rule, *rows = before.splitlines()
    cells = {tuple(row.split("|")[1 : 1 + keys]): row for row in (*rows, *after.splitlines()[2:])}
    return "\n".join((head, rule, *cells.values()))
