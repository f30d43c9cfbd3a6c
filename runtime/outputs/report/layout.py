"""What a page is made of: tables, sections, tiles; text only, but for the figures' own SVG."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ReportTable:
    """Header and rows of text.

    Attributes:
        total: closes the table and is never sorted.
        kind: numbers, or facts (two columns of words).
        flagged: rows that are bad news.
        groups: heads over several columns and how many; together all columns.
        column_methods, row_methods: the method that a column (row) belongs to, for the filter; ""
            belongs to none.
        row_anchors: names under which rows are linked to.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    total: tuple[str, ...] = ()
    kind: str = "numbers"
    flagged: frozenset[int] = frozenset()
    groups: tuple[tuple[str, int], ...] = ()
    column_methods: tuple[str, ...] = ()
    row_methods: tuple[str, ...] = ()
    row_anchors: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """A heading with what belongs under it; empty parts are left out.

    Attributes:
        group: heading shared with neighbours.
        sources: anchor and text of what the numbers come from.
    """

    title: str
    lead: str = ""
    table: ReportTable | None = None
    figure: str = ""
    items: tuple[str, ...] = ()
    group: str = ""
    sources: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Tile:
    """One number of the summary; `tone` is good, bad or plain."""

    label: str
    value: str
    note: str
    tone: str = "plain"


@dataclass(frozen=True, slots=True)
class Page:
    """One report: summary, sections, glossary of (word, meaning)."""

    title: str
    subtitle: str
    headline: str
    status: str
    warnings: tuple[str, ...]
    tiles: tuple[Tile, ...]
    sections: tuple[Section, ...]
    glossary: tuple[tuple[str, str], ...]
