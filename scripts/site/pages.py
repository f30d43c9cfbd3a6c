"""Pages of the site that are written from the code: Python API, command line, C API.

Commands are what `typer utils docs` prints of each; mkdocs-typer2 0.4 expects options of click,
which those of Typer 0.29 are no longer. The API is for mkdocstrings.
"""

import re
from pathlib import Path

import griffe
import typer.main
from typer.cli import get_docs_for_click

import runtime.cli
import symgen.cli
from runtime.common.commands import GROUPS

ROOT = Path(__file__).resolve().parents[2]
RECORDS = (
    "runtime.estimators.methods.Method",
    "runtime.recording.settings.FrictionColumn",
    "runtime.recording.formats.log_format.LogFormat",
    "runtime.excitation.search.criteria.Criterion",
    "runtime.excitation.motion.family.Basis",
    "runtime.excitation.motion_export.MotionFormat",
    "runtime.outputs.model_files.export_format.ExportFormat",
    "runtime.campaign.drivers.DriverKind",
)
"""What the registries hold, and a package with an entry point brings."""
API = """# Python API

`import runtime` offers the names below; a name that is not here may change between versions.

::: runtime
    options:
      show_root_toc_entry: false
      show_root_heading: false
      heading_level: 2
      members: {names}

# Records of plug-ins

A package that adds a method, a friction column or a format brings one of these records
([Add your own](../plugins.md)).

{records}
"""


def api() -> str:
    """The page of the Python API: the names that `runtime` exports, then the records."""
    read = griffe.load(
        "runtime", submodules=False, search_paths=[ROOT / "runtime"], allow_inspection=False
    )
    records = "\n\n".join(f"::: {name}" for name in RECORDS)
    return API.format(names=read.exports, records=records)


EXAMPLE = re.compile(r"^(?:python -m (?:symgen|runtime)|symgen) ")
COMMANDS = """# Command line

`symgen COMMAND --help` prints the same in a terminal. Where `symgen` is not on the path,
`python -m symgen` and `python -m runtime` offer the same commands. Exit codes: 0 success,
1 findings (`inspect`, `check`), 2 an input that cannot be used, 130 interrupted.
"""


def commands() -> str:
    """One section per command in the order of `symgen --help`: sentences, examples, parameters."""
    apps = {"symgen": symgen.cli.app, "runtime": runtime.cli.app}
    lines = [COMMANDS]
    for title, group in GROUPS.items():
        lines.append(f"## {title}\n")
        for entry in group:
            command = typer.main.get_command(apps[entry.package]).commands[entry.name]
            command.help = _help(command.help or "")
            context = typer.Context(command, info_name=entry.name)
            name = f"symgen {entry.name} {entry.argument}".rstrip()
            text = get_docs_for_click(obj=command, ctx=context, indent=2, name=name, title=name)
            lines.append(re.sub(r"(?m)^(\* `[^`]*`: )(.*)$", _escaped_item, text))
    return "\n".join(lines)


def _help(text: str) -> str:
    """Paragraphs as text, examples as a block."""
    lines: list[str] = []
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        rows = paragraph.strip("\b\n ").splitlines()
        if EXAMPLE.match(rows[0].strip()):
            body = [re.sub(r"^python -m (?:symgen|runtime) ", "symgen ", row) for row in rows]
            lines += ["```", *body, "```", ""]
        else:
            lines += [_escaped(" ".join(paragraph.split())), ""]
    return "\n".join(lines)


def _escaped_item(match: re.Match[str]) -> str:
    return match[1] + _escaped(match[2])


def _escaped(text: str) -> str:
    """Characters that Markdown would read as markup, escaped."""
    return re.sub(r"([*_<\[`])", r"\\\1", text)


C_API = """# C API

`symgen build` writes this folder for every robot, here for the FR3. [Use the C code](../howto/c.md)
shows how to call it.

{readme}

## The header

```c
{header}
```
"""


def c_api() -> str:
    """Text of the robot's README, headings one level deeper, then the header."""
    folder = ROOT / "generated" / "fr3"
    readme, header = (
        (folder / name).read_text(encoding="utf-8") for name in ("README.md", "fr3.h")
    )
    body = re.sub(r"^#", "##", readme, flags=re.MULTILINE)
    return C_API.format(readme=body, header=header.rstrip())
