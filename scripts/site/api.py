"""Pages of the Python API: the public names of runtime, then one page per room."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RUNTIME = ROOT / "runtime"
WITHOUT = {"cli"}
"""Rooms that are no Python API: the command line has a page of its own."""


def rooms() -> list[str]:
    """Folders and single modules of runtime, alphabetically."""
    folders = [path.parent.name for path in RUNTIME.glob("*/__init__.py")]
    modules = [path.stem for path in RUNTIME.glob("*.py") if not path.stem.startswith("__")]
    return sorted({*folders, *modules} - WITHOUT)


def page(room: str) -> str:
    """Path of a room's page inside the site."""
    return f"reference/api/{room}.md"


def index() -> str:
    """The first page: the names of `runtime`, and where the rooms are."""
    lines = [
        "# Python API",
        "",
        "`import runtime` offers the names below. The pages of the rooms list the other modules;",
        "their names may change between versions, those below may not.",
        "",
        "| room | contents |",
        "|---|---|",
        *(f"| [{room}]({room}.md) | {_summary(room)} |" for room in rooms()),
        "",
        "::: runtime",
        "    options:",
        "      show_root_toc_entry: false",
        "      show_root_heading: false",
        "      heading_level: 2",
        "      members:",
        *(f"        - {name}" for name in public_names()),
        "",
    ]
    return "\n".join(lines)


def public_names() -> list[str]:
    """`runtime.__all__`, read without importing."""
    text = (RUNTIME / "__init__.py").read_text(encoding="utf-8")
    return re.findall(r'"(\w+)"', text.split("__all__", 1)[1])


def room_page(room: str) -> str:
    """The modules of one room with their public members."""
    lines = [f"# {room}", ""]
    for name in _modules(room):
        lines += [f"::: {name}", ""]
    return "\n".join(lines)


def _modules(room: str) -> list[str]:
    single = RUNTIME / f"{room}.py"
    paths = [single] if single.exists() else sorted((RUNTIME / room).rglob("*.py"))
    names = (".".join(path.relative_to(ROOT).with_suffix("").parts) for path in paths)
    return [name for name in names if not name.endswith("__init__")]


def _summary(room: str) -> str:
    single = RUNTIME / f"{room}.py"
    path = single if single.exists() else RUNTIME / room / "__init__.py"
    first = path.read_text(encoding="utf-8").split('"""')[1].strip().partition("\n\n")[0]
    return " ".join(first.split()).replace("|", "\\|")
