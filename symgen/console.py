"""The console command `symgen`: one entry to the commands of both packages.

It imports the package of a command only when that command runs. `inspect` exists twice: a model
file goes to symgen, a log to runtime.
"""

import gc
import os
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path

from symgen import __version__
from symgen.command_list import BUILD, GROUPS, RUN
from symgen.completion import SCRIPTS, fitting, is_completion

BUILD_LIBRARIES = frozenset({"casadi", "pinocchio", "coal"})
"""Top-level modules that only the extra `build` installs."""
PURPOSES = {
    "inspect": "inspecting a robot model",
    "proxies": "fitting capsules to a robot",
}
"""What needs them, by command; every other command writes the C code of a robot."""

INTERRUPTED = 130
"""Exit code after Ctrl-C."""

INSPECT_FLAGS = frozenset({"--json", "--strict", "--overwrite", "--yes", "--help", "-h"})
"""Options of either `inspect` that take no value; every other one is followed by its value."""

MODEL_SUFFIXES = frozenset({".urdf", ".xacro", ".mjcf", ".xml"})
"""Suffixes that decide where a file is missing or empty, so that it has no content."""

_BEFORE_XML = b"\xef\xbb\xbf\xff\xfe\x00 \t\r\n"
"""Bytes that may precede `<`: byte-order marks, the zero bytes of UTF-16, white space."""


def main() -> None:
    """Run `symgen COMMAND …` on `sys.argv`; an unknown command is one sentence and exit code 2."""
    try:
        _run(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the output, `head` for example, has ended. Python flushes once more at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None


def _run(words: Sequence[str]) -> None:
    """Run a command by its words."""
    if is_completion():
        print("\n".join(fitting(words, _packages())))
        return
    if words[:1] == ["--show-completion"]:
        _show_completion(words[1:])
        return
    if not words or words[0] in {"-h", "--help"}:
        print(overview(shutil.get_terminal_size().columns))
        return
    if words[0] == "--version":
        print(f"symgen {__version__}")
        return
    packages = _packages().get(words[0], [])
    if not packages:
        sys.stderr.write(f"symgen: {_unknown(words[0])}\n")
        raise SystemExit(2)
    file = inspected_file(words[1:])
    if len(packages) > 1 and file is None:
        _help_of_all(packages)
        return
    package = packages[0]
    if len(packages) > 1 and file is not None:
        package = BUILD if is_model(Path(file)) else RUN
    commands_of(package)()


def _packages() -> dict[str, list[str]]:
    """Packages of each command."""
    packages: dict[str, list[str]] = {}
    for group in GROUPS.values():
        for command in group:
            packages.setdefault(command.name, []).append(command.package)
    return packages


def _show_completion(words: Sequence[str]) -> None:
    """Print the script of a shell."""
    shell = words[0] if words else Path(os.environ.get("SHELL", "")).name
    if shell not in SCRIPTS:
        sys.stderr.write(
            f"symgen: expected one of the shells {', '.join(SCRIPTS)}, got {shell or 'none'!r}; "
            "run: symgen --show-completion bash\n"
        )
        raise SystemExit(2)
    print(SCRIPTS[shell])


def overview(width: int) -> str:
    """Help of the console command."""
    titles = [f"{c.name} {c.argument}".strip() for group in GROUPS.values() for c in group]
    indent = max(map(len, titles)) + 4
    lines = [
        "Usage: symgen COMMAND [ARGUMENTS]",
        "",
        textwrap.fill(
            "Physically consistent inertial parameters of robot arms, from measured motion.",
            width,
        ),
    ]
    for head, group in GROUPS.items():
        lines += ["", f"{head}:"]
        for command in group:
            title = f"{command.name} {command.argument}".strip()
            lines.append(
                textwrap.fill(
                    command.sentence,
                    max(width, indent + 30),
                    initial_indent=f"  {title}".ljust(indent),
                    subsequent_indent=" " * indent,
                )
            )
    return "\n".join(
        [
            *lines,
            "",
            "symgen COMMAND --help describes a command with all its options.",
            "symgen --version prints the version.",
            "symgen --show-completion prints the script that completes words in your shell.",
        ]
    )


def inspected_file(words: Sequence[str]) -> str | None:
    """First argument of `inspect` that is no option."""
    rest = iter(words)
    for word in rest:
        if word == "--":
            return next(rest, None)
        if not word.startswith("-") or word == "-":
            return word
        if word not in INSPECT_FLAGS and "=" not in word:
            next(rest, None)  # the value of this option
    return None


def is_model(path: Path) -> bool:
    """Whether a file is a robot model: URDF, xacro and MJCF are XML, and no log is."""
    try:
        with path.open("rb") as file:
            head = file.read(4096).lstrip(_BEFORE_XML)
    except (OSError, ValueError):  # missing, a folder, or a name with a zero byte
        head = b""
    if head or path.is_dir():
        return head.startswith(b"<")
    return path.suffix.lower() in MODEL_SUFFIXES


def commands_of(package: str) -> Callable[[], None]:
    """Import the commands of a package."""
    gc.disable()  # what the import makes stays
    try:
        run_command: Callable[[], None] = import_module(package).main
    except KeyboardInterrupt:  # the import takes a second or two
        sys.stderr.write("symgen: interrupted\n")
        raise SystemExit(INTERRUPTED) from None
    finally:
        gc.enable()

    def run() -> None:
        try:
            run_command()
        except ModuleNotFoundError as error:
            name = (error.name or "").partition(".")[0]
            if package != BUILD or name not in BUILD_LIBRARIES:
                raise
            work = PURPOSES.get(sys.argv[1], "writing the C code of a robot")
            sys.stderr.write(
                f"symgen: {work} needs the package {name}, which is not installed; run: "
                f"{installation('build')}\n"
            )
            raise SystemExit(2) from None

    return run


def installation(extra: str) -> str:
    """Command that installs an extra.

    In a clone it names the clone: an index need not have this version, or has another project.
    """
    clone = Path(__file__).resolve().parents[1]
    source = clone if (clone / "pyproject.toml").is_file() else "symgen"
    return f"pip install {'' if source == 'symgen' else '-e '}{shlex.quote(f'{source}[{extra}]')}"


def _unknown(name: str) -> str:
    names = [command.name for group in GROUPS.values() for command in group]
    near = get_close_matches(name, names, 1, 0.0)
    return (
        f"expected a command such as '{near[0] if near else names[0]}', got '{name}'; "
        "run: symgen --help"
    )


def _help_of_all(packages: Sequence[str]) -> None:
    """The help of every command of one name, one after another; the first failure ends it last."""
    code: object = None
    for package in packages:
        try:
            commands_of(package)()
        except SystemExit as end:
            code = code or end.code
    raise SystemExit(code)
