"""The bars of commands that count what they have done."""

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

from runtime.cli.common import console

TOLD = TextColumn("{task.fields[told]}")
"""What a task says of itself: `told=` of `add_task` and `update`."""


def counting(*columns: ProgressColumn) -> Progress:
    """What is being done, how much of it, the time since it began, and further columns."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        *columns,
        console=console,
        transient=True,
    )
