"""mkdocs calls these: they add the pages and tables that are written from the code."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
if str(ROOT) not in sys.path:  # mkdocs loads this file by its path
    sys.path.insert(0, str(ROOT))

from scripts.site import pages, result_keys  # noqa: E402

PICTURE, BOTH = (
    re.compile(r"(!\[.*?\]\(.*?)-light(\.\w+)\)"),
    r"\1-light\2#only-light) \1-dark\2#only-dark)",
)
"""A picture of a tutorial, which a terminal names once, and its two schemes on the site."""


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages to those of docs/."""
    for name, text in generated_pages():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the table of the keys of result.json where a page asks for it."""
    place = "<!-- keys of result.json -->"
    return markdown.replace(place, result_keys.markdown()) if place in markdown else markdown


def generated_pages() -> Iterator[tuple[str, str]]:
    """Path inside the site and Markdown text of every generated page."""
    for tutorial in sorted((ROOT / "runtime/tutorials").glob("*.md")):
        text = tutorial.read_text(encoding="utf-8").replace("../../docs/", "../")
        yield f"tutorials/{tutorial.name}", PICTURE.sub(BOTH, text)
    yield "changelog.md", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    yield "reference/commands.md", pages.commands()
    yield "reference/c.md", pages.c_api()
    yield "reference/result.schema.json", result_keys.json_schema()
    yield "reference/api.md", pages.api()
