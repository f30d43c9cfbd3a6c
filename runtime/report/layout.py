"""What a page is made of: tables, sections, tiles; text only, but for the figures' own SVG."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """Header and rows of text; `flagged` rows are bad news, `total` closes the table."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    total: tuple[str, ...] = ()
    kind: str = "numbers"
    flagged: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Section:
    """A heading with what belongs under it; empty parts are left out."""

    title: str
    lead: str = ""
    table: Table | None = None
    figure: str = ""
    items: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Tile:
    """One number of the summary; `tone` is good, bad or plain."""

    label: str
    value: str
    note: str
    tone: str = "plain"
