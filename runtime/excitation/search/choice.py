"""The order in which ended starts are tried: among nearly equal ones the most balanced comes first.

    max over i of (log f_i − min over the nearly equal starts of log f_i),   f = v, a, cond

A weighted criterion is nearly the same for starts of which one is good in v alone, one in cond
alone. The start whose worst quantity is closest to the best of its kind loses least in any of them.
"""

from collections.abc import Sequence

import numpy as np

from runtime.excitation.search.single_start import Search
from runtime.library import Array

NEARLY = 0.01
"""Log target above the best below which a start is nearly as good: the last polish on the fine grid
changes it as much."""


def in_order(search: Search, ended: Sequence[tuple[float, Array]]) -> list[Array]:
    """Coefficients of starts in the order in which they are to be tried.

    ended (n, M) → (n, M).
    """
    by_target = sorted(ended, key=lambda one: one[0])
    if not by_target:
        return []
    near = [a for value, a in by_target if value <= by_target[0][0] + NEARLY]
    logs = np.array([search.balanced(a) for a in near])
    worst = (logs - logs.min(axis=0)).max(axis=1)
    balanced = [near[k] for k in np.argsort(worst, kind="stable")]
    return balanced + [a for _, a in by_target[len(near) :]]
