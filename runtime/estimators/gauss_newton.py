"""Gauss–Newton, the one loop of all unknowns on which the rows depend nonlinearly.

    x ← x + s Δ,   Δ = C Jᵀ r,   0 < s ≤ 1

A problem linearises itself at x, with what other unknowns take on there (weights, noise, linear
parameters). The step is bounded by component, then halved until the cost of this linearisation
does not rise.
Source: Nocedal & Wright 2006, Ch. 10; variable projection, Kaufman 1975.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.library import Array

_ROUNDING = 1e-12  # rise of a cost, relative to it, that counts as rounding


@dataclass(frozen=True, slots=True, eq=False)
class Linearised:
    """A problem linearised at x."""

    step: Array  # Δ to its minimum, (p,)
    sigma: Array  # unit of a step per component, (p,); NaN where a component does not count
    # of any x by the weights of this x; None: any step is taken
    cost: Callable[[Array], float] | None = None
    order: float = np.inf  # of the norm of a step over its unit

    def size(self, share: float = 1.0) -> float:
        """Norm of a share of the step over its unit."""
        unit = np.where(np.isnan(self.sigma), np.inf, self.sigma)
        return share * float(np.linalg.norm(self.step / unit, self.order))


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where the passes ended."""

    x: Array  # unknowns, (p,)
    last: Linearised  # last linearisation, of the x before the last step
    converged: bool  # whether the steps became small
    passes: int  # number of linearisations


def gauss_newton(
    linearise: Callable[[Array], Linearised],
    x: Array,
    *,
    passes: int,
    done: float = 0.0,
    most_step: Array | float = np.inf,
    halvings: int = 0,
    takes_last: bool = True,
) -> Solution:
    """Minimise by Gauss–Newton from x, (p,), until a step has the size `done` or less.

    most_step bounds every component; with takes_last the step that is small enough is taken, too.
    """
    for count in range(1, passes + 1):
        last = linearise(x)
        if not takes_last and last.size() <= done:
            return Solution(x, last, True, count)
        step, share = np.clip(last.step, -most_step, most_step), 1.0
        if last.cost is not None:
            before = last.cost(x)
            limit = before + _ROUNDING * abs(before)
            for _ in range(halvings):
                if last.cost(x + share * step) <= limit:
                    break
                share /= 2
        x = x + share * step
        if takes_last and last.size(share) <= done:
            return Solution(x, last, True, count)
    return Solution(x, last, False, passes)
