"""Progress bars."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, Protocol

from runtime.cli.common import console

if TYPE_CHECKING:
    from rich.progress import ProgressColumn


class Counter(Protocol):
    """What commands use of a progress bar, with rich's arguments."""

    def add_task(self, description: str, *, total: float | None, **fields: Any) -> Any:
        """Add a line.

        Args:
            description: text of the line.
            total: count at its end; None for an unknown one.
            **fields: values of further columns.

        Returns:
            Number of the line.
        """

    def update(self, task_id: Any, **facts: Any) -> None:
        """Change what a line shows."""

    def stop(self) -> None:
        """End the display."""


def state() -> "ProgressColumn":
    """Column of free text, set by `state=` of `add_task` and `update`."""
    from rich.progress import TextColumn

    return TextColumn("{task.fields[state]}")


def counting(*columns: "Callable[[], ProgressColumn]") -> AbstractContextManager[Counter]:
    """Progress bar with the task, the count, the elapsed time and further columns."""
    if not (console.is_terminal or console.is_jupyter):
        return _Unseen()
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
    )

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        *(column() for column in columns),
        console=console,
        transient=True,
    )


def waiting(text: str) -> AbstractContextManager[Any]:
    """Sign that a command works."""
    return console.status(text) if console.is_terminal or console.is_jupyter else nullcontext()


class _Unseen:
    """A bar in a file or a pipe: nothing, and an empty line where it ends."""

    def __enter__(self) -> "_Unseen":
        return self

    def __exit__(self, *fault: object) -> None:
        self.stop()

    def stop(self) -> None:
        console.line()

    def add_task(self, description: str, *, total: float | None, **fields: Any) -> int:
        return 0

    def update(self, task_id: Any, **facts: Any) -> None:
        return
