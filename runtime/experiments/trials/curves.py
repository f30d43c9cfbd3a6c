"""AIRM over the iterations of many descents → mean and standard deviation over the trials."""

from collections.abc import Sequence

import numpy as np

from runtime.errors import IdentificationError
from runtime.experiments.study import Row
from runtime.library import Array


def band(rows: Sequence[Row], case: str, method: str, every: int, last: int) -> dict[str, Array]:
    """Mean and standard deviation of the AIRM over the iterations.

    A trial that has ended keeps its last value.
    """
    chosen = [row for row in rows if row["case"] == case and row["method"] == method]
    grid = np.arange(0, last + 1, every)
    lines = np.empty((len(chosen), grid.size))
    for line, row in zip(lines, chosen, strict=True):
        curve = np.array([*row["curve"], row["airm"]])
        line[:] = curve[np.minimum(np.arange(grid.size), len(curve) - 1)]
    name = f"{case}/{method}"
    std = lines.std(axis=0, ddof=1) if len(chosen) > 1 else np.zeros(grid.size)
    return {f"{name}/iteration": grid, f"{name}/mean": lines.mean(axis=0), f"{name}/std": std}


def single(
    rows: Sequence[Row], case: str, method: str, number: int, every: int
) -> dict[str, Array]:
    """AIRM of one trial over the iterations, up to its result."""
    for row in rows:
        if (row["case"], row["method"], row["trial"]) == (case, method, number):
            curve = np.array([*row["curve"], row["airm"]])
            name = f"{case}/{method}/single"
            grid = np.minimum(np.arange(len(curve)) * every, row["iterations"])
            return {f"{name}_iteration": grid, f"{name}_airm": curve}
    raise IdentificationError(
        f"expected a trial {number} of '{case}' by '{method}', got none; increase --trials"
    )
