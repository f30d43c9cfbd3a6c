"""The page of the command line, from the commands themselves."""

import re
from pathlib import Path
from typing import Any, get_args, get_type_hints

import typer.main

WORDS: dict[Any, str] = {int: "INTEGER", float: "NUMBER", Path: "PATH"}
"""What a user writes behind an option, by the annotation of the command's function."""
EXAMPLE = re.compile(r"^(?:python -m (?:symgen|runtime)|symgen) ")


def markdown() -> str:
    """One section per command in the order of `symgen --help`: sentences, examples, parameters."""
    import runtime.cli
    import symgen.cli
    from symgen.command_list import GROUPS

    apps = {"symgen.cli": symgen.cli.app, "runtime.cli": runtime.cli.app}
    lines = [
        "# Command line",
        "",
        "`symgen COMMAND --help` prints the same in a terminal. Where `symgen` is not on",
        "the path, `python -m symgen` and `python -m runtime` offer the same commands.",
        "Exit codes: 0 success, 1 findings (`inspect`, `check`), 2 an input that cannot be used,",
        "130 interrupted.",
        "",
    ]
    for title, group in GROUPS.items():
        lines += [f"## {title}", ""]
        for entry in group:
            command = typer.main.get_command(apps[entry.package]).commands[entry.name]
            lines += [f"### symgen {entry.name} {entry.argument}".rstrip(), ""]
            lines += [*_help(command.help or ""), *_parameters(command), ""]
    return "\n".join(lines)


def _help(text: str) -> list[str]:
    """Paragraphs as text, examples as a block."""
    lines: list[str] = []
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        rows = paragraph.strip("\b\n ").splitlines()
        if EXAMPLE.match(rows[0].strip()):
            body = [re.sub(r"^python -m (?:symgen|runtime) ", "symgen ", row) for row in rows]
            lines += ["```", *body, "```", ""]
        else:
            lines += [_escaped(" ".join(paragraph.split())), ""]
    return lines


def _parameters(command: Any) -> list[str]:
    rows = [_row(command, p) for p in command.params if not getattr(p, "hidden", False)]
    rows = [row for row in rows if row]
    if not rows:
        return []
    return ["| parameter | meaning | default |", "|---|---|---|", *rows]


def _row(command: Any, parameter: Any) -> str:
    if parameter.name == "help":
        return ""
    if parameter.param_type_name == "argument":
        head = f"`{parameter.metavar or parameter.name.upper()}`"
    else:
        names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
        value = parameter.metavar or _type(command, parameter)
        head = names if parameter.is_flag else f"{names} `{value}`"
    default = ""
    if parameter.required:
        default = "required"
    elif parameter.default not in {None, False} and isinstance(parameter.default, _SHOWN):
        default = f"`{parameter.default}`"
    if getattr(parameter, "multiple", False):
        default = f"{default} repeatable".strip()
    return (
        f"| {_cell(head)} | {_cell(_escaped(getattr(parameter, 'help', '') or ''))} | {default} |"
    )


_SHOWN = (str, int, float, Path)


def _type(command: Any, parameter: Any) -> str:
    annotation = get_type_hints(command.callback).get(parameter.name, str)
    kinds = [kind for kind in (get_args(annotation) or (annotation,)) if kind is not type(None)]
    return WORDS.get(kinds[0], "TEXT")


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _escaped(text: str) -> str:
    """Characters that Markdown would read as markup, escaped."""
    return re.sub(r"([*_<\[`])", r"\\\1", text)
