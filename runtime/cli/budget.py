"""Option --budget of `symgen excite`."""

from typing import Annotated

import typer

Budget = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        help="Time for searches: after the first, a further one is made only if the mean time per "
        "search still fits. The best is then finished and certified. The result depends on the "
        "speed of the machine.",
    ),
]
"""--budget."""


def budget_notes(budget: float | None, count: int, starts: int) -> tuple[str, ...]:
    """Sentence about a search that its budget has ended.

    Args:
        budget: value of --budget [s].
        count: number of starts that were made.
        starts: value of --starts.

    Returns:
        The sentence; nothing where all starts were made.
    """
    if budget is None or count >= starts:
        return ()
    return (f"budget: {count} of {starts} starts in {budget:g} s",)
