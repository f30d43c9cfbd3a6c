"""Table of the outcomes of mutation runs."""

from collections.abc import Sequence

from scripts.mutation.run import EQUIVALENT, NOTICED, SURVIVED, Outcome


def share(outcomes: Sequence[Outcome]) -> float:
    """Return the share of the mutants noticed, equivalent ones left out; 1 where there are none."""
    noticed = sum(o.verdict == NOTICED for o in outcomes)
    counted = noticed + sum(o.verdict == SURVIVED for o in outcomes)
    return noticed / counted if counted else 1.0


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Return the counts by room and their sum, Markdown."""
    rooms = list(dict.fromkeys(o.room for o in outcomes))
    lines = [
        "| room | mutants | noticed | survived | equivalent | share |",
        "|---|---|---|---|---|---|",
    ]
    for name, some in [
        *((room, [o for o in outcomes if o.room == room]) for room in rooms),
        ("all", list(outcomes)),
    ]:
        counts = [sum(o.verdict == v for o in some) for v in (NOTICED, SURVIVED, EQUIVALENT)]
        cells = [name, len(some), *counts, f"{100 * share(some):.0f} %"]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)
