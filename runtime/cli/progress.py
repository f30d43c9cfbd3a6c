"""Progress bars."""

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

from runtime.cli.common import console

STATE = TextColumn("{task.fields[state]}")
"""Column of free text, set by `state=` of `add_task` and `update`."""


def counting(*columns: ProgressColumn) -> Progress:
    """Progress bar with the task, the count, the elapsed time and further columns."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        *columns,
        console=console,
        transient=True,
    )
