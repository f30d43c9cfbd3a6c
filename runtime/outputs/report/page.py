"""`Page` → one HTML file with style, script and figures, which loads nothing else.

Its content security policy allows one script by SHA-256. Without scripts the page lacks sorting,
zoom and filter only.
"""

import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from runtime.common.files import replacing
from runtime.common.tables import NOTHING, Table


@dataclass(frozen=True, slots=True)
class Section:
    """A heading with its text, table, figure and list; empty parts are omitted."""

    title: str
    lead: str = ""
    table: Table | None = None
    figure: str = ""
    items: tuple[str, ...] = ()
    group: str = ""  # heading shared with adjacent sections
    sources: tuple[tuple[str, str], ...] = ()  # HTML id and text of links to the numbers' origin


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
    notes: tuple[str, ...]  # sentences to know
    tiles: tuple[Tile, ...]
    sections: tuple[Section, ...]
    glossary: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...] = ()  # sentences that need an action
    status: str = ""


def provenance(
    command: str | None,
    seed: int | None,
    model_hash: str | None,
    versions: Mapping[str, str],
    files: Mapping[str, str],
    *further: tuple[str, str | None],
) -> Section:
    """Section on the origin of the numbers."""
    rows = (
        ("command", command),
        ("seed", None if seed is None else str(seed)),
        ("model hash", model_hash),
        *((f"version of {tool}", version) for tool, version in sorted(versions.items())),
        *((f"SHA-256 of {name}", digest) for name, digest in sorted(files.items())),
        *further,
    )
    shown = tuple((quantity, value or NOTHING) for quantity, value in rows)
    return Section("Provenance", table=Table(("quantity", "value"), shown, kind="facts"))


def write_page(page: Page, path: Path) -> Path:
    """Write a page, complete or not at all."""
    with replacing(path) as file:
        file.write(render(page).encode("utf-8", "replace"))
    return path


def render(page: Page) -> str:
    """HTML of a page; equal pages give equal text."""
    script, parts = _asset("page.js"), page.sections
    digest = b64encode(sha256(script.encode()).digest()).decode()
    # the group of each section that is the first of its group
    pairs = pairwise((Section(""), *parts))
    headings = [each.group if each.group != before.group else "" for before, each in pairs]
    template = _environment().get_template("report.html.jinja2")
    return template.render(
        page=page,
        sections=tuple(zip(parts, anchors(parts), headings, strict=True)),
        grouped=any(section.group for section in parts),
        style=Markup(_asset("page.css")),  # noqa: S704  our own file
        script=Markup(script),  # noqa: S704  our own file
        script_hash=f"sha256-{digest}",
    )


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("runtime.outputs.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def anchors(sections: Iterable[Section]) -> Iterator[str]:
    """Unique HTML ids of sections, from their titles."""
    taken: dict[str, int] = {}
    for section in sections:
        slug = re.sub(r"[^a-z0-9]+", "-", section.title.lower()).strip("-") or "section"
        taken[slug] = taken.get(slug, 0) + 1
        yield f"s-{slug}" if taken[slug] == 1 else f"s-{slug}-{taken[slug]}"


def _asset(name: str) -> str:
    return (files("runtime.outputs.report") / "templates" / name).read_text(encoding="utf-8")
