"""Bounds over all t of limits that are not linear in the motion.

On an interval of length δ ≤ 1 ms between two samples g ≤ max(g_k, g_k+1) + δ²/8 sup g''.

- braking: PROVEN. h = max(0, s dq + c)²/k + s q has h'' ≤ 2 (ddq² + max(0, s dq + c) |dddq|)/k
  + |ddq|, and each factor is bounded on the interval by its ends and the next derivative.
- torque, torque rate, tip box and speed, self-collision, table: MEASURED, not proven. ġ is exact at
  every sample (the kernel's Jacobian times the motion's derivatives); g'' on an interval is taken
  as `SAFETY` times the largest change of ġ over δ there and on both neighbouring intervals. The
  fastest wave of a motion, M / t_f, has hundreds of samples per period, so neighbours tell.
  Where the closest points of two links jump, ġ jumps too and the bound grows, never shrinks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.excitation import Trajectory
from runtime.excitation.laws import Braking, Law
from runtime.library import Array

STEP = 1e-3
"""Longest interval, s."""
INTERVALS = 2000
"""Fewest, however short the motion."""
SAFETY = 2.0
_CHUNK = 2048
"""Samples at once: their Jacobians stay below 20 MB."""
_ROUNDING = 64 * np.finfo(float).eps
_ORDERS = 5
"""Derivatives of the motion that are looked at, q included."""


@dataclass(frozen=True, slots=True)
class LawBound:
    """The largest g of one row.

    Attributes:
        law, row: whose.
        bound: of g over all t; inf where it is not a number.
        time: when, s; to one sample.
    """

    law: Law
    row: int
    bound: float
    time: float

    @property
    def is_proven(self) -> bool:
        """A theorem stands behind it, not a measured second derivative."""
        return isinstance(self.law, Braking)


def law_bounds(laws: Sequence[Law], trajectory: Trajectory) -> tuple[LawBound, ...]:
    """One bound per row of each law."""
    if not laws:
        return ()
    duration, basis = trajectory.duration, trajectory.basis
    a, home = trajectory.coefficients, trajectory.home
    count = max(INTERVALS, int(np.ceil(duration / STEP)))
    count += count % 2
    s = np.linspace(0.0, 1.0, count + 1)
    size = a.shape[1]
    phi = basis.derivatives(_ORDERS, size, s)
    powers = duration ** -np.arange(_ORDERS + 1.0)
    motion = phi @ a.T * powers[:-1, None, None]
    motion[0] += home
    sup = np.array([np.abs(a) @ basis.bound(k, size) for k in range(_ORDERS + 1)])
    sup *= powers[:, None]
    found = []
    for law in laws:
        half = basis.is_symmetric and law.even
        part = motion[:, : count // 2 + 1] if half else motion
        with np.errstate(all="ignore"):  # what is not a number becomes an infinite bound
            bounds = (
                _of_braking(law, part, sup, duration / count)
                if isinstance(law, Braking)
                else _measured(law, part, duration / count)
            )
        bounds = np.where(np.isnan(bounds), np.inf, bounds)
        where = np.argmax(bounds, axis=0)
        for row, k in enumerate(where):
            time = float((k + 0.5) * duration / count)
            found.append(LawBound(law, row, float(bounds[k, row]), time))
    return tuple(found)


def _of_braking(law: Braking, motion: Array, sup: Array, step: float) -> Array:
    """Proven bounds of g per interval and row."""
    g = law.values(motion[:4])
    ends = np.abs(motion)
    wide = [np.maximum(ends[k, 1:], ends[k, :-1]) + step / 2 * sup[k + 1] for k in range(2, 4)]
    acceleration, jerk = wide
    rises = []
    for side in law.sides:
        speed = np.maximum(0, side.sign * motion[1] + side.c)
        speed = np.maximum(speed[1:], speed[:-1]) + step / 2 * acceleration
        bend = 2 / side.k * (acceleration**2 + speed * jerk) + acceleration
        rises.append(step**2 / 8 * bend / law.room(side))
        rounding = _ROUNDING * (sup[0] + 2 / side.k * (sup[1] + side.c) * sup[1])
        rises[-1] += rounding / law.room(side)
    return np.asarray(np.maximum(g[1:], g[:-1]) + np.concatenate(rises, axis=1))


def _measured(law: Law, motion: Array, step: float) -> Array:
    """g per interval and row with a measured second derivative."""
    values, slopes = [], []
    for first in range(0, motion.shape[1], _CHUNK):
        part = motion[:, first : first + _CHUNK]
        values.append(law.values(part[:4]))
        chain = law.slopes(part[:4])
        slopes.append(np.einsum("nrdj,dnj->nr", chain, part[1 : law.orders + 1], optimize=True))
    g, slope = np.concatenate(values), np.concatenate(slopes)
    change = np.abs(np.diff(slope, axis=0))
    padded = np.pad(change, ((1, 1), (0, 0)), mode="edge")
    bend = np.maximum(np.maximum(padded[:-2], padded[2:]), change) / step
    return np.asarray(np.maximum(g[1:], g[:-1]) + SAFETY * step**2 / 8 * bend)
