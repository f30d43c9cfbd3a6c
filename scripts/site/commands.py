"""The page of the command line, from the commands themselves."""

import re
from pathlib import Path
from typing import Any, get_args, get_type_hints

import typer.main

PARTS = (
    ("symgen.cli", "Models: from a URDF to a compiled library"),
    ("runtime.cli", "Measurements: from a log to an identified robot"),
)

WORDS: dict[Any, str] = {int: "INTEGER", float: "NUMBER", Path: "PATH"}


def markdown() -> str:
    """One section per command: sentences, examples, arguments and options."""
    import runtime.cli
    import symgen.cli

    apps = {"symgen.cli": symgen.cli.app, "runtime.cli": runtime.cli.app}
    lines = [
        "# Command line",
        "",
        "`symgen COMMAND --help` prints the same in a terminal. `python -m symgen` and",
        "`python -m runtime` offer the same commands where the console script is not on the path.",
        "Exit codes: 0 success, 1 findings (`inspect`, `check`), 2 an input that cannot be used,",
        "130 interrupted.",
        "",
    ]
    for module, title in PARTS:
        lines += [f"## {title}", ""]
        for name, command in sorted(typer.main.get_command(apps[module]).commands.items()):
            what = {"symgen.cli": " MODEL", "runtime.cli": " LOG"}[module]
            lines += [f"### symgen {name}{what if name == 'inspect' else ''}", ""]
            lines += [*_help(command.help or ""), "", *_parameters(command), ""]
    return "\n".join(lines)


def _help(text: str) -> list[str]:
    """Paragraphs as text, examples (behind a backspace) as a block."""
    lines: list[str] = []
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        if paragraph.lstrip().startswith("\b"):
            body = [line.strip() for line in paragraph.replace("\b", "").strip().splitlines()]
            lines += ["```text", *body, "```", ""]
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
    value = parameter.metavar or _type(command, parameter)
    if parameter.param_type_name == "argument":
        head = f"`{parameter.metavar or parameter.name.upper()}`"
    else:
        names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
        head = names if parameter.is_flag else f"{names} `{value}`"
    default = "" if parameter.default in (None, (), [], False) else f"`{parameter.default}`"
    if callable(parameter.default):
        default = ""
    if parameter.required:
        default = "required"
    if getattr(parameter, "multiple", False):
        default = f"{default} repeatable".strip()
    return (
        f"| {_cell(head)} | {_cell(_escaped(getattr(parameter, 'help', '') or ''))} | {default} |"
    )


def _type(command: Any, parameter: Any) -> str:
    """What a user writes behind an option, from the annotation of the command's function."""
    annotation = get_type_hints(command.callback).get(parameter.name, str)
    kinds = [kind for kind in (get_args(annotation) or (annotation,)) if kind is not type(None)]
    return WORDS.get(kinds[0], "TEXT")


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _escaped(text: str) -> str:
    """Markdown would read <!-- -->, * and _ as its own."""
    return re.sub(r"([*_<\[])", r"\\\1", text)
