"""Sum of the vertical forces of a walking robot by stance: which feet carry it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from bench.markdown import markdown_table, table_of

Array = NDArray[np.float64]

LOADED = 0.15
"""Share of the median sum from which a foot counts as loaded; a lifted foot reads up to 6 %."""
SHORTEST_S = 0.1
"""Shortest stance that is counted [s]."""
GRAVITY = 9.81


@dataclass(frozen=True, slots=True)
class Stance:
    """One kind of stance in one half of the log."""

    half: str  # "first" or "second"
    feet: str  # loaded feet
    seconds: float  # time in it [s]
    mass: float  # mean sum of both sensors over g [kg]
    lifted: float | None  # mean reading of the lifted foot over g [kg]; None where both are loaded


def stances(log: dict[str, Any]) -> list[Stance]:
    """Stances of a log."""
    forces = np.stack([log["lf_fz"], log["rf_fz"]], axis=1)
    total, t = forces.sum(axis=1), log["t"] - log["t"][0]
    loaded = forces > LOADED * np.median(total)
    kinds = loaded[:, 0] * 1 + loaded[:, 1] * 2
    step = float(np.median(np.diff(t)))
    starts = np.flatnonzero(np.diff(kinds, prepend=-1))
    long_enough = np.zeros(len(t), dtype=bool)
    for first, last in zip(starts, [*starts[1:], len(t)], strict=True):
        long_enough[first:last] = (last - first) * step >= SHORTEST_S
    rows = []
    for half, within in (("first", t < t[-1] / 2), ("second", t >= t[-1] / 2)):
        for kind, feet in ((3, "both"), (1, "left"), (2, "right")):
            chosen = within & long_enough & (kinds == kind)
            if chosen.any():
                lifted = None if kind == 3 else float(forces[chosen, 2 - kind].mean() / GRAVITY)
                mass = float(total[chosen].mean() / GRAVITY)
                rows.append(Stance(half, feet, float(chosen.sum() * step), mass, lifted))
    return rows


_HEADS = ("half", "loaded feet", "s", "mean ΣF_z / g, kg", "lifted foot / g, kg")


def _cells(row: Stance) -> tuple[str, ...]:
    lifted = "" if row.lifted is None else f"{row.lifted:.2f}"
    return (row.half, row.feet, f"{row.seconds:.2f}", f"{row.mass:.2f}", lifted)


def stance_markdown(rows: list[Stance]) -> str:
    """Table of `stances` for docs/."""
    return markdown_table(_HEADS, map(_cells, rows))


def stance_table(rows: list[Stance]) -> Table:
    """Table of `stances`."""
    title = "iCub walking: what the force sensors read"
    return table_of(title, _HEADS, map(_cells, rows))
