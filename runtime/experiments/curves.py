"""AIRM on the way of many descents → mean and standard deviation over the trials."""

from collections.abc import Sequence

import numpy as np

from runtime.experiments.study import Row
from runtime.library import Array


def band(rows: Sequence[Row], case: str, method: str, every: int, last: int) -> dict[str, Array]:
    """`CASE/METHOD/iteration`, `…/mean`, `…/std`: a trial that has ended keeps its last value."""
    own = [row for row in rows if row["case"] == case and row["method"] == method]
    grid = np.arange(0, last + 1, every)
    lines = np.empty((len(own), grid.size))
    for line, row in zip(lines, own, strict=True):
        curve = np.array([*row["curve"], row["airm"]])
        line[:] = curve[np.minimum(np.arange(grid.size), len(curve) - 1)]
    name = f"{case}/{method}"
    std = lines.std(axis=0, ddof=1) if len(own) > 1 else np.zeros(grid.size)
    return {f"{name}/iteration": grid, f"{name}/mean": lines.mean(axis=0), f"{name}/std": std}
