"""Points near good ones, from which a descent of the search begins.

A point x of the search has size one at the bounds of the joints, see `coordinates`.
"""

from collections.abc import Callable

import numpy as np

from runtime.library import Array

NOISE = 0.2, 0.8
"""Smallest and largest noise on all coordinates of a variation; 1 reaches the bounds."""
FAR_NOISE = 0.45, 0.75
"""The same far from a parent: with less, most descents of a smooth criterion return to it; with
more, most are given up. Between 0.5 and 0.7 they gained twice as much as between 0.7 and 0.9."""
FAVOUR = 0.25
"""Probability that the best parent is chosen; the next ones follow a geometric law."""
FAR_FAVOUR = 0.35
"""The same where a smooth criterion decides."""


def varied(
    rng: np.random.Generator,
    known: Array,
    number: int,
    joints: int,
    drawn: Callable[[np.random.Generator], Array],
) -> Array:
    """Return a parent with noise on all coordinates, or with new motions of one or two joints.

    known (K, p), drawn (p,) → (p,).
    """
    x = _parent(rng, known, FAVOUR)
    if number % 3 == 2:
        return np.asarray(x + rng.uniform(*NOISE) * rng.normal(size=len(x)))
    chosen = _chosen(rng, joints, 1 + number % 3, len(x))
    return np.where(chosen, drawn(rng), x)


def varied_far(rng: np.random.Generator, known: Array, number: int, joints: int) -> Array:
    """Return a parent with much noise, or with the mirrored motion of one joint.

    Seven of eight variations have noise on all coordinates, which leads to a better optimum twice
    as often as new motions of two joints. A mirrored motion keeps the amplitudes of its joint.

    known (K, p) → (p,).
    """
    x = _parent(rng, known, FAR_FAVOUR)
    if number % 8 == 4:
        return np.where(_chosen(rng, joints, 1, len(x)), -x, x)
    return np.asarray(x + rng.uniform(*FAR_NOISE) * rng.normal(size=len(x)))


def _parent(rng: np.random.Generator, known: Array, favour: float) -> Array:
    return np.asarray(known[min(int(rng.geometric(favour)), len(known)) - 1])


def _chosen(rng: np.random.Generator, joints: int, count: int, size: int) -> Array:
    """Coordinates (size,) of so many random joints."""
    chosen = rng.permutation(joints)[:count]
    return np.repeat(np.isin(np.arange(joints), chosen), size // joints)
