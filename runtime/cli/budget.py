"""Option --budget of `symgen excite`, and what is printed of starts that were not made in full."""

from typing import Annotated

import typer

from runtime.excitation import Design
from runtime.excitation.search.single_start import TRIED

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


def search_notes(best: Design, budget: float | None, starts: int) -> tuple[str, ...]:
    """Sentences about starts that were not made, and about starts that were given up."""
    notes, count = [], len(best.conditions)
    descents = count + len(best.variations)
    if count < starts:
        reason = "interrupted" if budget is None else f"budget of {budget:g} s"
        first = "; the first start is made in full however long it takes" if count == 1 else ""
        notes.append(f"{reason}: {count} of {starts} starts" + first * (budget is not None))
    if best.behind:
        bounds = " or ".join(f"{100 * far:g} % after {steps} steps" for steps, far in TRIED)
        notes.append(
            f"given up: {best.behind} of {descents} starts and variations, behind the best of the "
            f"rounds before by more than {bounds}"
        )
    return tuple(notes)
