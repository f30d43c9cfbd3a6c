"""Commands that use the library of a robot: `python -m runtime COMMAND` or `symgen COMMAND`."""

import gc
import os
import sys
from collections.abc import Iterable
from importlib import import_module
from inspect import getdoc
from typing import Any

import typer

from runtime import __version__
from runtime.cli.common import INTERRUPTED, as_typed, flowing, program
from runtime.cli.plain_values import PlainGroup
from runtime.cli.renamed_options import RefusingCommand
from runtime.errors import RuntimeFault
from runtime.startup.leaving import leave
from runtime.startup.memory import keep_memory

COMMANDS = (
    *(
        "inspect",
        "identify",
        "compare",
        "payload",
        "gains",
        "evaluate",
        "friction",
        "observe",
        "sample",
        "watch",
        "fleet",
    ),
    *(
        "export",
        "excite",
        "approach",
        "predict",
        "simulate",
        "campaign",
        "reproduce",
        "report",
        "view",
        "locate",
        "tutorial",
    ),
)
"""Every command: function NAME_command of the module NAME of this package."""
MODULES = {"reproduce": "runtime.experiments.command"}
"""Modules of commands of other rooms, which nothing imports."""
NEW_OBJECTS = 50_000
"""Containers made since the last collection that start the next, more than a short command makes;
700, Python's own number, is searched sixty times in one."""
app: typer.Typer


def app_of(names: Iterable[str]) -> typer.Typer:
    """An application with some of the commands; only their modules are imported."""
    chosen = typer.Typer(
        cls=PlainGroup,
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
        context_settings={"help_option_names": ["-h", "--help"]},
        help="Identify the inertial parameters of robot arms from measured motion.",
        epilog="`symgen build` compiles the library of a robot, which these commands load.",
    )
    chosen.callback()(_command_comes_first)
    for name in names:
        function = getattr(
            import_module(MODULES.get(name, f"runtime.cli.{name}")), f"{name}_command"
        )
        chosen.command(name, cls=RefusingCommand, help=flowing(getdoc(function) or ""))(function)
    return chosen


def _imported(names: Iterable[str]) -> typer.Typer:
    """The application of some commands, whose modules the garbage collector does not search.

    What an import makes stays until the end. Searching it during the imports, in every later
    collection and in the last one took a tenth of the processor time of `identify`.
    """
    gc.disable()
    try:
        chosen = app_of(names)
        gc.freeze()
    finally:
        gc.set_threshold(NEW_OBJECTS, 10, 10)
        gc.enable()
    return chosen


def _command_comes_first() -> None:
    # Without a callback Typer takes the only command of an application for the application.
    return


def __getattr__(name: str) -> Any:
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()["app"] = app_of(COMMANDS)
    return globals()["app"]


def main() -> None:
    """Run the command line; a `RuntimeFault` becomes one sentence and exit code 2."""
    try:
        _run()
    except SystemExit as end:
        leave(end.code)
        raise


def _run() -> None:
    """Run the command of `sys.argv`."""
    # With a hundred columns a second thread of BLAS only waits, and its waiting took four fifths of
    # a command's processor time. NumPy and worker processes read this when they start.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    keep_memory()
    wanted = sys.argv[1:2]
    name = program().split()[-1]
    if wanted == ["--version"]:
        print(f"{name} {__version__}")
        return
    try:
        _imported(wanted if set(wanted) & set(COMMANDS) else COMMANDS)()
    except RuntimeFault as error:
        print(f"{name}: {as_typed(str(error))}", file=sys.stderr)
        raise SystemExit(2) from None
    except OSError as error:
        if error.filename is None:
            raise
        place = str(error.filename)
        short = place if len(place) <= 100 else place[:100] + "…"
        print(
            f"{name}: cannot use '{short}' ({error.strerror}); choose another path",
            file=sys.stderr,
        )
        raise SystemExit(2) from None
    except SystemExit as end:
        if end.code == INTERRUPTED:
            print(
                f"{name}: interrupted; files that were finished before stay as they are",
                file=sys.stderr,
            )
        raise


__all__ = ["app", "main"]
