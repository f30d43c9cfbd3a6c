"""Points near good ones, from which a descent of the search begins.

A point x of the search has size one at the bounds of the joints, see `coordinates`.
"""

from collections.abc import Callable

import numpy as np

from runtime.library import Array

NOISE = 0.2, 0.8
"""Smallest and largest noise on all coordinates of a variation; 1 reaches the bounds."""
FAVOUR = 0.25
"""Probability that the best parent is chosen; the next ones follow a geometric law."""


def varied(
    rng: np.random.Generator,
    known: Array,
    number: int,
    joints: int,
    drawn: Callable[[np.random.Generator], Array],
    *,
    is_mostly_noise: bool = False,
) -> Array:
    """Return a parent with noise on all coordinates, or with new motions of one or two joints.

    Args:
        rng: random numbers.
        known: points of the parents, best first, (K, p).
        number: of the variation, by which the kind is chosen.
        joints: number of joints, n.
        drawn: random point (p,).
        is_mostly_noise: two of three variations have noise; else one of three.

    Returns:
        Point (p,), not yet within the limits.
    """
    x = known[min(int(rng.geometric(FAVOUR)), len(known)) - 1]
    if number % 3 == 2 or (is_mostly_noise and number % 3 == 1):
        return np.asarray(x + rng.uniform(*NOISE) * rng.normal(size=len(x)))
    chosen = rng.permutation(joints)[: 1 + number % 3]
    new = np.repeat(np.isin(np.arange(joints), chosen), len(x) // joints)
    return np.where(new, drawn(rng), x)
