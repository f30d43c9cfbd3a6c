"""A table of text for the pages, and for the terminal."""

from collections.abc import Iterable

from rich.table import Table


def markdown_table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Rows as a Markdown table."""
    return "\n".join(f"| {' | '.join(line)} |" for line in (heads, ("---",) * len(heads), *rows))


def table_of(title: str, heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Table:
    """Rows as a table of the terminal, numbers at the right."""
    table = Table(heads[0], title=title)
    for head in heads[1:]:
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(*row)
    return table
