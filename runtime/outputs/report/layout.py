"""Parts of a page: tables, sections and tiles of text, figures as inline SVG."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ReportTable:
    """Header and rows of text.

    Attributes:
        total: last row, which sorting leaves in place.
        kind: numbers, or facts (two columns of words).
        flagged: rows that are highlighted as faults.
        groups: (heading, number of columns), which together cover all columns.
        column_methods, row_methods: method of each column (row), for the filter; "" for none.
        row_anchors: HTML ids of rows.
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
    """A heading with its text, table, figure and list; empty parts are omitted.

    Attributes:
        group: heading shared with adjacent sections.
        sources: HTML id and text of links to the origin of the numbers.
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
    """One number of the summary, coloured by `tone`: good, bad or plain."""

    label: str
    value: str
    note: str
    tone: str = "plain"


@dataclass(frozen=True, slots=True)
class Page:
    """One report: summary, sections and glossary of (term, definition)."""

    title: str
    subtitle: str
    headline: str
    status: str
    warnings: tuple[str, ...]
    tiles: tuple[Tile, ...]
    sections: tuple[Section, ...]
    glossary: tuple[tuple[str, str], ...]
