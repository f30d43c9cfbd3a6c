"""Pages of the Python API for mkdocstrings: the public names of runtime, then one page per room."""

from pathlib import Path
from pkgutil import iter_modules

import griffe

ROOT = Path(__file__).resolve().parents[2]
WITHOUT = {"cli", "__main__"}
"""Rooms that are no Python API: the command line has a page of its own."""
INDEX = """# Python API

`import runtime` offers the names below. The pages of the rooms list the other modules; their names
may change between versions, those below may not.

| room | contents |
|---|---|
{rooms}

::: runtime
    options:
      show_root_toc_entry: false
      show_root_heading: false
      heading_level: 2
      members: {names}
"""


def rooms() -> list[str]:
    """Folders and single modules of runtime, alphabetically."""
    return sorted({module.name for module in iter_modules([str(ROOT / "runtime")])} - WITHOUT)


def page(room: str) -> str:
    """Path of a room's page inside the site."""
    return f"reference/api/{room}.md"


def index() -> str:
    """The first page: the names of `runtime`, and where the rooms are."""
    lines = [f"| [{room}]({room}.md) | {_summary(room)} |" for room in rooms()]
    return INDEX.format(rooms="\n".join(lines), names=_read("runtime", ROOT).exports)


def room_page(room: str) -> str:
    """The modules of one room with their public members."""
    place = ROOT / "runtime" / room
    paths = sorted(place.rglob("*.py")) or [place.with_suffix(".py")]
    names = [".".join(p.relative_to(ROOT).with_suffix("").parts) for p in paths if p.stem[0] != "_"]
    return "\n\n".join([f"# {room}", *(f"::: {name}" for name in names)])


def _read(module: str, folder: Path) -> griffe.Object:
    return griffe.load(module, submodules=False, search_paths=[folder], allow_inspection=False)


def _summary(room: str) -> str:
    text = _read(room, ROOT / "runtime").docstring
    first = text.value.partition("\n\n")[0] if text else ""
    return " ".join(first.split()).replace("|", "\\|")
