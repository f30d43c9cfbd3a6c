"""Limits that are not linear in the motion, as constraints g ≤ 0 with exact slopes.

Every constraint takes a motion (4, N, n), that is q, dq, ddq, dddq at N samples, and returns
g (N, R) of its R rows and ∂g/∂(q, dq, …) of as many orders as it reads. g is use − 1: it vanishes
on the limit and is −1 or less far from it. The physics comes from the robot's kernels.

| constraint | row | g |
|---|---|---|
| braking | joint and side | (max(0, ±dq + c)² − k (q̂ ∓ q)) / (k · room at rest at home) |

Constraints of torques are in `torque_limits`, those of places and distances in `distance_limits`.
"""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from runtime.excitation.limits.interval_bounds import IntervalBounds
from runtime.excitation.limits.sampled_motion import SampledMotion
from runtime.library import Array


class Constraint(Protocol):
    """One kind of limit."""

    kind: ClassVar[str]
    orders: ClassVar[int]
    """How many of q, dq, ddq, dddq are read."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Joint, axis or pair of each of the R rows."""

    @property
    def even(self) -> bool:
        """The values stay the same when the motion runs backwards: −dq and −dddq."""

    def values(self, motion: Array) -> Array:
        """Values g, (N, R), of a motion (4, N, n)."""

    def slopes(self, motion: Array) -> Array:
        """Slopes ∂g/∂(q, …), (N, R, orders, n)."""

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Quantity of a row at a value of the constraint.

        Args:
            row: index of the row.
            g: value of the constraint there.

        Returns:
            The quantity, its limit and their unit.
        """


class TimedConstraint(Constraint, Protocol):
    """A constraint whose rate in time is computed without its slopes, and bounded on intervals."""

    precision: ClassVar[tuple[float, float]]
    """Least and largest tolerance of a proven bound of g."""

    def along(self, sampled: SampledMotion) -> tuple[Array, Array]:
        """Values g and rates dg/dt, (N, R) each."""

    def rise(self, bounds: IntervalBounds) -> Array:
        """Largest rise of g within K intervals above the larger end of each, proven, (K, R)."""


SMOOTH = 1e-6, 1e-2
"""Tolerances of proven bounds of smooth functions."""


@dataclass(frozen=True, slots=True)
class Side:
    """Braking towards one end of the range: max(0, s dq + c)² ≤ k (s q̂ − s q), (n,) each.

    s is +1 for the upper ends and −1 for the lower ones; an infinite end has no limit.
    """

    sign: float
    k: Array
    c: Array
    end: Array


@dataclass(frozen=True, slots=True)
class Braking:
    """Velocity limits that fall towards the ends of the range, convex in q and dq.

    g is scaled by the room at home: 0 % is used at rest there, as with position limits.
    """

    kind: ClassVar[str] = "braking"
    orders: ClassVar[int] = 2
    sides: tuple[Side, ...]
    home: Array
    joints: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Joints, upper ends first."""
        return tuple(name for _ in self.sides for name in self.joints)

    @property
    def even(self) -> bool:
        """False: braking depends on the direction of dq."""
        return False

    def room(self, side: Side) -> Array:
        """Room s (q̂ − home) − c²/k, (n,) rad; NaN where the robot may not even rest at home."""
        room = side.sign * (side.end - self.home) - np.maximum(side.c, 0) ** 2 / side.k
        return np.where(room > 0, room, np.nan)

    def values(self, motion: Array) -> Array:
        """Values (max(0, s dq + c)²/k − s (q̂ − q)) / room."""
        q, dq = motion[:2]
        parts = [
            np.maximum(0, s.sign * dq + s.c) ** 2 / s.k - s.sign * (s.end - q) for s in self.sides
        ]
        return np.concatenate(
            [part / self.room(s) for part, s in zip(parts, self.sides, strict=True)], axis=1
        )

    def slopes(self, motion: Array) -> Array:
        """Slopes s / room and 2 s max(0, s dq + c) / (k room), each of its own joint."""
        dq, n = motion[1], motion.shape[2]
        slopes = np.zeros((len(dq), len(self.sides), n, 2, n))
        each = np.arange(n)
        for i, s in enumerate(self.sides):
            scale = s.sign / self.room(s)
            slopes[:, i, each, 0, each] = scale
            slopes[:, i, each, 1, each] = scale * 2 / s.k * np.maximum(0, s.sign * dq + s.c)
        return slopes.reshape(len(dq), -1, 2, n)

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Share of the room at home that is used."""
        return 1 + g, 1.0, "of the room at home"
