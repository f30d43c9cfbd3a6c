"""The page of the command line: what `typer utils docs` prints of each command, grouped.

mkdocs-typer2 0.4 expects options of click, which those of Typer 0.29 are no longer.
"""

import re

import typer.main
from typer.cli import get_docs_for_click

import runtime.cli
import symgen.cli
from runtime.common.commands import GROUPS

EXAMPLE = re.compile(r"^(?:python -m (?:symgen|runtime)|symgen) ")
HEAD = """# Command line

`symgen COMMAND --help` prints the same in a terminal. Where `symgen` is not on the path,
`python -m symgen` and `python -m runtime` offer the same commands. Exit codes: 0 success,
1 findings (`inspect`, `check`), 2 an input that cannot be used, 130 interrupted.
"""


def markdown() -> str:
    """One section per command in the order of `symgen --help`: sentences, examples, parameters."""
    apps = {"symgen": symgen.cli.app, "runtime": runtime.cli.app}
    lines = [HEAD]
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
