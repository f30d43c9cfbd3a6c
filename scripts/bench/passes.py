"""The pass of the statistics over the rows [Y_b τ], beside the limit of multiply-adds of a core.

A Cholesky pass multiplies the rows: RᵀR = AᵀA, the upper half. Householder reflections of the same
rows take 1.94 times as many multiply-adds on an FR3.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench import doors
from bench.batch import make_batch
from bench.compiled import burst, find, interleave, limits
from bench.front import BenchError
from bench.ours import Ours
from runtime.library import Library
from symgen.emit.programs import eliminate

TILES = 512
"""Samples whose Y_b stays in the second cache."""
SHORT = 2e-3
"""Seconds of a measurement: as short as that of the limit, which other work disturbs less."""


@dataclass(frozen=True, slots=True)
class Passes:
    """Seconds per sample; shares are medians of rounds."""

    products: int  # multiply-adds of a Cholesky pass
    elimination: int  # multiply-adds of Householder reflections
    limit: float  # of the multiply-adds of a Cholesky pass on one core
    rows: float  # of Y_b on tiles
    share: float  # of the limit in the statistics without the time of Y_b
    share_eliminated: float  # the same, where all rows are eliminated
    share_of_all: float  # of the limit in the whole time of the statistics


def measure(setting: doors.Setting, rounds: int) -> Passes:
    """Time limit, Y_b and statistics in the same rounds."""
    lib = setting.lib
    compiler = find(("cc", "gcc", "clang"))
    products, elimination = multiply_adds(lib)
    tiles = Ours(lib, ("base_regressor",), compiler).contender(
        "base_regressor", lib.level, "tiles", make_batch(lib, TILES)
    )
    if tiles is None:
        raise BenchError(f"the level '{lib.level}' of '{lib.name}' has no Y_b on tiles")
    contenders: dict[str, Callable[[], float]] = {
        "limit": limits(compiler, (lib.level,))[lib.level],
        "rows": burst(tiles.run, TILES),
        "statistics": doors.statistics(setting, SHORT),
        "eliminated": doors.statistics_of_exact(setting, SHORT),
    }
    times = {name: np.asarray(values) for name, values in interleave(contenders, rounds).items()}
    limit, rows = 2e-9 * products * times["limit"], 1e-9 * times["rows"]

    def share(name: str) -> float:
        return float(np.median(limit / (times[name] - rows)))

    return Passes(
        products,
        elimination,
        float(np.median(limit)),
        float(np.median(rows)),
        share("statistics"),
        share("eliminated"),
        float(np.median(limit / times["statistics"])),
    )


def sentence(passes: Passes) -> str:
    """One line for the end of a table."""
    return (
        f"Statistics: a Cholesky pass over the rows takes {passes.products} multiply-adds "
        f"({passes.limit * 1e9:.0f} ns at the limit), an elimination {passes.elimination}; without "
        f"Y_b ({passes.rows * 1e9:.0f} ns) the statistics reach {passes.share:.2f} of the limit of "
        f"the former, {passes.share_eliminated:.2f} where all rows are eliminated, and with Y_b "
        f"{passes.share_of_all:.2f}."
    )


def multiply_adds(lib: Library) -> tuple[int, int]:
    """Multiply-adds per sample, counted from the entries of Y_b that are not zero by structure."""
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 16, lib.n_joints))
    filled = np.abs(lib.base_regressor(q, dq, ddq)).max(axis=0) > 0
    pattern = [[*map(bool, row), True] for row in filled]
    sizes = np.sum(pattern, axis=1)
    # A column takes its length, and two passes over each column to its right.
    elimination = sum(
        len(panel.rows) * (1 + 2 * (panel.width - 1 - i + len(panel.columns)))
        for panel in eliminate(pattern, len(pattern[0]) - 1)
        for i in range(panel.width)
    )
    return int(np.sum(sizes * (sizes + 1) // 2)), elimination
