"""Huber weights on blocks of rows: outliers that least squares would follow count less.

    w_b = min(1, c/u_b) min(1, G c/u_b) min(1, (H/h_b)²),   u_b = max_j rms_b(r_j)/σ_j
    σ_j = 1.4826 med |r_j|,   ln c = med ln u + K · 1.4826 med |ln u − med ln u|

r are residuals of least squares over base parameters and friction with these weights (iteratively
reweighted). Beyond G thresholds a block is no measurement of this robot, and its influence falls.
h_b is the size of the regressor's rows in the block relative to the 90 % quantile of all blocks: a
jump of the position has accelerations that would pull the fit towards itself. One weight per block
and not per row, because residuals are autocorrelated. The first fit is trimmed least squares: gross
outliers hide in the residuals of plain least squares.
Source: Huber 1964; weights of the regressor: Mallows 1975; concentration steps: Rousseeuw & Van
Driessen 2006; all of them on blocks: ours.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError, NeedsError
from runtime.estimators.methods import METHODS
from runtime.estimators.problem import Problem
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.posterior import least_squares
from runtime.estimators.regression.samples import Samples, sums_of_groups
from runtime.library import Array, Integers, Library

LENGTH = 10
FEWEST_BLOCKS = 20  # blocks below which their spread is not known
K = 3.0  # threshold of ln u above its median in robust standard deviations
G = 3.0  # thresholds beyond which the influence of a block falls
H = 3.0  # size of a block's rows relative to the 90 % quantile above which they count less
PASSES, STEADY = 15, 0.01  # limit of the number of fits, and largest change of a weight at the end
KEPT, STEPS, STARTS = 0.7, 6, 4
"""Share of blocks that trimmed least squares fits, number of its steps, and parts of the log that
are left out one by one to start it."""
ROWS = 4000  # rows that each of these fits takes, evenly spread
ABSENT = 1e-12  # weight of a block that a fit leaves out
NORMAL = 1.4826  # standard deviation over the median absolute deviation of a normal distribution
_LISTED = 5


@dataclass(frozen=True, slots=True, eq=False)
class RowWeights:
    """Weights of rows."""

    weights: Array  # of every row, (N,), one value per block
    joints: Array  # index of the joint with the largest residual of every row's block, (N,)

    def note(self, t: Array, names: Sequence[str]) -> str:
        """Sentence on the blocks that count less: t (N,) [s]."""
        less = self.weights < 1.0
        if not less.any():
            return "robust: no row was down-weighted"
        cuts = np.flatnonzero(np.diff(less.astype(int))) + 1
        stretches = [s for s in np.split(np.arange(len(less)), cuts) if less[s[0]]]
        stretches.sort(key=lambda s: float(self.weights[s].min()))
        parts = []
        for s in stretches[:_LISTED]:
            row = s[int(np.argmin(self.weights[s]))]
            name = names[int(self.joints[row])]
            parts.append(f"{t[s[0]]:.2f}–{t[s[-1]]:.2f} s ({self.weights[row]:.2g}, {name})")
        more = len(stretches) - len(parts)
        return (
            f"robust: {100 * less.mean():.1f} % of the training rows count less than the others, "
            f"with these weights: {', '.join(parts)}{f' and {more} others' if more else ''}; look "
            "at the log there"
        )


def robust_problem(problem: Problem, method: str) -> tuple[Problem, RowWeights]:
    """The problem with its training rows scaled by √w, for a method that takes such weights."""
    able = [m.name for m in METHODS.records() if m.from_statistics and not m.uses_validation]
    if method not in able:
        raise NeedsError(
            f"the method {method} takes no weights of rows; use --settings robust=true with one of "
            f"{', '.join(able)}"
        )
    train = problem.train
    if problem.pieces is not None:
        raise IdentificationError(
            "weights of rows need the whole log in memory, but it is streamed; give --settings "
            "stream=false"
        )
    if len(train) < FEWEST_BLOCKS * LENGTH:
        raise IdentificationError(
            f"robust weights need {FEWEST_BLOCKS * LENGTH} training rows or more, got "
            f"{len(train)}; record for longer, or leave out --settings robust=true"
        )
    rows = explicit(problem.lib, train)
    weights = weights_of_rows(problem.lib, rows)
    return replace(problem, train=rows.weighted(weights.weights)), weights


def weights_of_rows(lib: Library, rows: Samples) -> RowWeights:
    """Weights by iteratively reweighted least squares over base parameters and friction."""
    block = np.minimum(np.arange(len(rows)) // LENGTH, len(rows) // LENGTH - 1)
    few = np.arange(0, len(rows), max(1, len(rows) // ROWS))
    leverage = np.minimum(1.0, (H / _sizes(rows.base_rows(lib), block)) ** 2)

    def fitted(weights: Array, spread: Array) -> tuple[Array, Array]:
        """σ_j of the residuals (n,), and their RMS in every block over it, (blocks, n)."""
        part = rows.rows(few).weighted(weights[block[few]])
        known = compress(lib, part, 1.0 / spread**2)
        rest = rows.tau - rows.base_torque(lib, least_squares(known.factor, known.target)[0])
        sigma = NORMAL * np.median(np.abs(rest), axis=0)
        spread = np.maximum(sigma, 1e-9 * max(float(sigma.max()), 1e-300))
        return spread, np.sqrt(_block_mean((rest / spread) ** 2, block))

    # Trimmed least squares from fits to all blocks, and to all but a contiguous part of them.
    equal = np.ones(rows.equations)
    starts = [leverage]
    for left_out in np.array_split(np.arange(len(leverage)), STARTS):
        starts.append(np.where(np.isin(np.arange(len(leverage)), left_out), ABSENT, leverage))
    states = []
    for start in starts:
        spread, power = fitted(start, equal)
        for _ in range(STEPS):  # on the blocks with the smallest residuals
            u = power.max(axis=1)
            spread, power = fitted(np.where(u <= np.quantile(u, KEPT), leverage, ABSENT), spread)
        states.append((spread, power))
    spread, power = min(states, key=lambda state: float(np.sum(np.log(state[0]))))
    # Huber weights from there.
    weights = leverage
    for _ in range(PASSES):
        u = np.log(np.maximum(power.max(axis=1), 1e-300))
        middle = np.median(u)
        bar = middle + K * NORMAL * np.median(np.abs(u - middle))
        excess = np.minimum(0.0, bar - u)
        now = leverage * np.exp(excess + np.minimum(0.0, excess + np.log(G)))
        change = float(np.abs(now - weights).max())
        weights = now
        if change < STEADY:
            break
        spread, power = fitted(weights, spread)
    return RowWeights(weights[block], np.argmax(power, axis=1)[block])


def explicit(lib: Library, samples: Samples) -> Samples:
    """Samples with the rows of the regressor, which can be scaled."""
    return replace(samples, base=samples.base_rows(lib), acceleration=None)


def _sizes(base: Array, block: Integers) -> Array:
    """Size of the regressor's rows in every block, the largest of all joints, over the quantile."""
    usual = np.median(np.abs(base), axis=0)
    usual = np.where(usual > 0, usual, np.sqrt(np.mean(base**2, axis=0)))
    unit = base / np.where(usual > 0, usual, 1.0)
    sizes = np.sqrt(_block_mean(np.sum(unit**2, axis=2), block))
    high = np.quantile(sizes, 0.9, axis=0)
    return np.asarray((sizes / np.where(high > 0, high, 1.0)).max(axis=1).clip(1e-9))


def _block_mean(values: Array, block: Integers) -> Array:
    """Mean of the rows (N, m) of every block, (blocks, m)."""
    return sums_of_groups(values, block) / np.bincount(block)[:, None]
