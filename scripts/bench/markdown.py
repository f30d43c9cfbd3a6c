"""A table of text for the pages."""

from collections.abc import Iterable


def markdown_table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Rows as a Markdown table.

    Args:
        heads: of the columns.
        rows: cells, as many as heads.

    Returns:
        Its text.
    """
    return "\n".join(f"| {' | '.join(line)} |" for line in (heads, ("---",) * len(heads), *rows))
