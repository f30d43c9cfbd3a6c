"""The console of commands, without rich where nobody looks at a terminal."""

import builtins
import os
import sys
from contextlib import nullcontext
from functools import cache
from typing import TYPE_CHECKING, Any

from runtime.cli.grid import Grid, may_hold_emoji

if TYPE_CHECKING:
    from rich.console import Console

_FORCED = ("FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE")
"""Variables by which rich takes a pipe for a terminal."""
_LINE = {"highlight": False, "soft_wrap": True, "markup": False}
"""Options of a line that is printed as it is."""


class PlainConsole:
    """A console of files and pipes; what it cannot print as rich does, rich prints."""

    is_terminal = False
    is_jupyter = False

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as rich does.

        Args:
            *objects: of rich, or tables.
            **options: of rich.
        """
        text = None
        if len(objects) == 1 and (sys.stdout.encoding or "").lower().startswith("utf"):
            if isinstance(objects[0], Grid) and not options:
                text = objects[0].plain(_width())
            elif isinstance(objects[0], str) and options == _LINE and _is_a_line(objects[0]):
                text = objects[0] + "\n"
        if text is None:
            _rich().print(*objects, **options)
        else:
            sys.stdout.write(text)
            sys.stdout.flush()

    def line(self) -> None:
        """Print an empty line."""
        sys.stdout.write("\n")
        sys.stdout.flush()

    def status(self, text: str) -> Any:
        """Show nothing while work goes on.

        Args:
            text: what a terminal would show.

        Returns:
            A context with the method `update`.
        """
        return nullcontext(_Unseen())

    def __enter__(self) -> "Console":
        return _rich().__enter__()

    def __exit__(self, *fault: Any) -> None:
        _rich().__exit__(*fault)

    def __getattr__(self, name: str) -> Any:
        return getattr(_rich(), name)


class _Unseen:
    """Work whose progress nobody sees."""

    def update(self, text: str) -> None:
        """Show another text."""


def console_of_process() -> "Console":
    """Return rich's console, or a plain one where no standard stream is a terminal."""
    seen = any(map(_is_terminal, range(3))) or hasattr(builtins, "get_ipython")
    if seen or any(os.environ.get(name) for name in _FORCED):
        return _rich()
    return PlainConsole()  # type: ignore[return-value]  # has what commands use of it


@cache
def _rich() -> "Console":
    from rich.console import Console

    return Console()


def _is_terminal(descriptor: int) -> bool:
    try:
        return os.isatty(descriptor)
    except OSError:
        return False


def _is_a_line(text: str) -> bool:
    """Whether rich prints a line unchanged: no control codes, and no colons around a word."""
    return text.isprintable() and not may_hold_emoji(text)


def _width() -> int:
    """Characters of a line, as rich counts them without a terminal."""
    columns = os.environ.get("COLUMNS", "")
    return int(columns) if columns.isdigit() else 80
