"""Proven bounds over all t of position, velocity, acceleration and jerk of each joint.

On an interval of length δ a function lies below its chord by Taylor: g ≤ max(g_k, g_k+1) + δ²/8
sup|g''|, and within it |g''| ≤ max(|g''_k|, |g''_k+1|) + δ/2 Σ|a| sup|φ'''| (of g). All derivatives
are closed forms of the basis, so the bound is proven up to rounding, which is added. The fifth one
of a spline jumps at knots, from one constant to the next, both of which are among the samples.

The same inequality on long intervals shows which of them may hold the largest bound of short ones:
only these are divided, and the result is that of short intervals everywhere.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import Trajectory
from runtime.library import Array, Library

INTERVALS = 4000
"""Fewest intervals of the grid over half the duration; over all of it twice as many."""
INTERVALS_PER_HARMONIC = 3000
"""Intervals per function; keeps the error δ²/8 (2πM/t_f)² of chords below 2e-7 of the amplitude."""
DIVIDED = 20
"""Short intervals in a long one; divides both numbers above."""
ROUNDING = 64 * np.finfo(float).eps
"""Relative to Σ|a| sup|φ|: the arguments 2πms carry a few ε, and M products are added."""
KINDS = ("position", "velocity", "acceleration", "jerk")
_ORDERS = len(KINDS) + 2
"""Number of derivatives that are evaluated."""


def joint_bounds(lib: Library, trajectory: Trajectory) -> tuple[Array, Array]:
    """Proven bounds of position, velocity, acceleration and jerk.

    Half of a motion is evaluated where it is its own mirror image about t_f / 2.
    """
    _require_shapes(lib, trajectory)
    a, basis = trajectory.coefficients, trajectory.basis
    # A grid of `count` short intervals of length `step` in s = t/t_f.
    n, size = a.shape
    count = interval_count(trajectory)
    step = (0.5 if basis.is_symmetric else 1.0) / count
    sides = rooms(lib, trajectory.home)
    chords = _Chords.of(trajectory, *sides)
    ends = _ends(basis, size, DIVIDED * step, count // DIVIDED)
    value, bend = _curves(ends, a)
    # Long intervals: the bound of any short interval inside one is below this, as the chord of
    # the long one and that of the short one are both counted (1 + 20² and 1 + 20).
    bounds = chords.bounds(value, bend, (1 + DIVIDED**2) * step**2 / 8, (1 + DIVIDED) * step / 2)
    # A long interval may hold the maximum where its bound exceeds the largest value at an end.
    chosen = bounds > chords.shares(value).max(axis=2, keepdims=True)
    np.put_along_axis(chosen, np.argmax(bounds, axis=2)[..., None], True, axis=2)  # the first NaN
    order, joint, interval = np.nonzero(chosen)
    used, back = np.unique(interval, return_inverse=True)
    # Only those are divided into short intervals and evaluated again.
    points = DIVIDED * used[:, None] + np.arange(DIVIDED + 1)  # (U, 21)
    value, bend = (
        curve.reshape(len(KINDS), n, *points.shape)[order, joint, back]
        for curve in _curves(
            basis.derivatives(_ORDERS, size, step * points.ravel().astype(float)), a
        )
    )
    bounds = chords.of_rows(order, joint).bounds(value, bend, step**2 / 8, step / 2)
    # The largest bound of every kind and joint; its time is the middle of the interval.
    best, where = np.empty((2, len(KINDS), n))
    starts = np.flatnonzero(np.diff(order * n + joint, prepend=-1))
    for first, last in zip(starts, [*starts[1:], len(order)], strict=True):
        row, k = divmod(int(np.argmax(bounds[first:last])), DIVIDED)
        best[order[first], joint[first]] = bounds[first + row, k]
        where[order[first], joint[first]] = points[back[first + row], k] + 0.5
    # Without room between home and a limit no motion keeps it; a NaN stays one.
    best[np.minimum(*sides) <= 0] = np.inf
    return best, where * step * trajectory.duration


def interval_count(trajectory: Trajectory) -> int:
    """Number of short intervals, bounded by the long ones where these suffice."""
    size, basis = trajectory.coefficients.shape[1], trajectory.basis
    return max(INTERVALS, INTERVALS_PER_HARMONIC * size) * (1 if basis.is_symmetric else 2)


@dataclass(frozen=True, slots=True)
class _Chords:
    """The inequality of the module's head, for derivatives by s."""

    up: Array  # up, down: limits
    down: Array
    third: Array  # Σ|a| sup of the third derivative
    rounding: Array  # of the value

    @classmethod
    def of(cls, trajectory: Trajectory, up: Array, down: Array) -> "_Chords":
        """For all kinds and joints, (4, n, 1) each."""
        size = trajectory.coefficients.shape[1]
        sup = np.array([trajectory.basis.bound(k, size) for k in range(len(KINDS) + 3)])
        sup = sup @ np.abs(trajectory.coefficients).T
        unit = trajectory.duration ** np.arange(len(KINDS))[:, None]
        sides = (np.where(room > 0, room, np.nan) * unit for room in (up, down))
        every = *sides, sup[3:], ROUNDING * sup[: len(KINDS)]
        return cls(*(part[..., None] for part in every))

    def of_rows(self, order: NDArray[np.intp], joint: NDArray[np.intp]) -> "_Chords":
        """For chosen kinds and joints, (K, 1) each."""
        every = self.up, self.down, self.third, self.rounding
        return _Chords(*(part[order, joint] for part in every))

    def shares(self, value: Array) -> Array:
        """Shares of the limits that values use."""
        return np.maximum(value / self.up, -value / self.down)

    def bounds(self, value: Array, bend: Array, half_square: float, half: float) -> Array:
        """Bounds over intervals between neighbours of the last axis; bend = |g''|, δ²/8, δ/2."""
        rise = np.maximum(bend[..., 1:], bend[..., :-1]) + half * self.third
        rise = half_square * rise + self.rounding
        high = np.maximum(value[..., 1:], value[..., :-1]) + rise
        low = rise - np.minimum(value[..., 1:], value[..., :-1])
        return np.asarray(np.maximum(high / self.up, low / self.down))


def _curves(phi: Array, a: Array) -> tuple[Array, Array]:
    """Values and |second derivatives| of all kinds, (4, n, N), from φ (orders, N, M)."""
    curves = np.ascontiguousarray((phi @ a.T).swapaxes(1, 2))
    return curves[: len(KINDS)], np.abs(curves[2:])


@lru_cache(maxsize=8)
def _ends(basis: Basis, size: int, step: float, count: int) -> Array:
    """Derivatives d^k φ_m/ds^k at the ends of long intervals, shared by the stages of a motion."""
    s = step * np.arange(count + 1.0)
    return basis.derivatives(_ORDERS, size, s)


def rooms(lib: Library, home: Array) -> tuple[Array, Array]:
    """Limits up and down per kind and joint, (4, n); those of the position count from home."""
    limits = lib.limits()
    same = [limits[kind] for kind in KINDS[1:]]
    return np.array([limits["upper"] - home, *same]), np.array([home - limits["lower"], *same])


def _require_shapes(lib: Library, trajectory: Trajectory) -> None:
    a, home, n = trajectory.coefficients, trajectory.home, lib.n_joints
    shaped = home.shape == (n,) and a.ndim == 2 and len(a) == n and a.size > 0
    if not shaped or not trajectory.duration > 0:
        raise IdentificationError(
            f"a trajectory of '{lib.name}' needs a home of shape ({n},), coefficients of shape "
            f"({n}, M) and a positive duration, got {home.shape}, {a.shape} and "
            f"{trajectory.duration:g} s"
        )
