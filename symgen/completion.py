"""Shell completion of the console command: scripts of shells, and the words that fit.

The script of a shell calls `symgen` with the words up to the cursor and `VARIABLE` set; the answer
is one word per line. Where none fits, the shell completes names of files.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path

VARIABLE = "_SYMGEN_WORDS"
"""Environment variable that asks for words instead of a run."""
FLAGS = ("--help", "--version", "--show-completion")
"""Options of `symgen` without a command."""
SCRIPTS = {
    "bash": """_symgen() {
    local IFS=$'\\n'
    COMPREPLY=( $(_SYMGEN_WORDS=1 symgen "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null) )
}
complete -o default -F _symgen symgen""",
    "zsh": """#compdef symgen
_symgen() {
    local -a fitting
    fitting=("${(@f)$(_SYMGEN_WORDS=1 symgen "${(@)words[2,$CURRENT]}" 2>/dev/null)}")
    [[ -n "$fitting" ]] && compadd -a fitting || _files
}
compdef _symgen symgen""",
    "fish": """function __symgen
    env _SYMGEN_WORDS=1 symgen (commandline -opc)[2..-1] (commandline -ct) 2>/dev/null
end
complete -c symgen -a '(__symgen)'""",
}
"""Script by shell."""
_APPLICATIONS = {
    "symgen.cli": lambda name: import_module("symgen.cli").app,
    "runtime.cli": lambda name: import_module("runtime.cli").app_of([name]),
}


def is_completion() -> bool:
    """Whether a shell asks for words: `VARIABLE` is set."""
    return bool(os.environ.get(VARIABLE))


def fitting(words: Sequence[str], commands: Mapping[str, Sequence[str]]) -> list[str]:
    """Words that may stand in place of the last one."""
    *before, begun = words or [""]
    if not before:
        known: Sequence[str] = [*commands, *FLAGS]
    elif before == ["--show-completion"]:
        known = [*SCRIPTS]
    elif before[0] not in commands:
        known = []
    elif begun.startswith("-"):
        known = [o for package in commands[before[0]] for o in _options(package, before[0])]
    else:
        known = _values(before[-1])
    return sorted({word for word in known if word.startswith(begun)})


def _options(package: str, name: str) -> Iterator[str]:
    import typer  # 0.1 s

    group = typer.main.get_command(_APPLICATIONS[package](name))
    for parameter in group.commands[name].params:  # type: ignore[attr-defined]
        if parameter.param_type_name == "option":
            yield from parameter.opts
            yield from parameter.secondary_opts
    yield "--help"


def _values(option: str) -> list[str]:
    """Names that an option takes: bundled robots, or those of a registry."""
    if option == "--robot":
        return [path.stem for path in (Path(__file__).parent / "robots").glob("*.urdf")]
    if option.startswith("--"):
        return [*import_module("runtime.cli.option_values").values_of(option)]
    return []
