"""Limits that are not linear in the motion, as constraints g ≤ 0 with exact slopes.

Every constraint takes a motion (4, N, n), that is q, dq, ddq, dddq at N samples, and returns
g (N, R) of its R rows and ∂g/∂(q, dq, …) of as many orders as it reads. g is use − 1: it vanishes
on the limit and is −1 or less far from it.

| constraint | row | g |
|---|---|---|
| braking | joint and side | (max(0, ±dq + c)² − k (q̂ ∓ q)) / (k · room at rest at home) |

Between samples, a distance of two rigid bodies changes no faster than their points move against
each other. Joints that move both bodies leave the distance, and each of the others moves a point at
|dq| times its distance from the axis, at most.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np

from runtime.library import Array, Library

ROUNDING = 1e-12  # of values over their bounds: 64 ε of the motion, and some thousand operations
SMOOTH = 1e-6, 1e-2  # tolerances of proven bounds of smooth functions


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body in a link: index of the joint that moves it, −1 for the base, and its reach."""

    joint: int
    reach: float  # largest distance of its points from the origin of the link, m


BASE = Body(-1, 0.0)  # what stands still


class IntervalBounds:
    """Bounds on K intervals of one length; each kind is computed once for all constraints."""

    def __init__(self, lib: Library, motion: Array, step: float) -> None:
        """Bounds from those of the joints."""
        self.motion, self.step = motion, step
        self._lib, self._rows = lib, np.ascontiguousarray(motion.swapaxes(0, 1))
        self._torques: dict[bytes, Array] = {}

    def bend(self, second: Array) -> Array:
        """Rise of functions (K, R) above the larger ends of intervals, δ²/8 sup |g''|."""
        return self.step**2 / 8 * second

    def torques(self, pi: Array) -> Array:
        """Bounds of |τ| and three derivatives in time, (4, K, n), of parameters (10 L,)."""
        key = pi.tobytes()
        if key not in self._torques:
            self._torques[key] = self._lib.torque_bounds(self._rows, pi).swapaxes(0, 1)
        return self._torques[key]

    @cached_property
    def tip(self) -> Array:
        """Bounds of |p| of the tip and three derivatives in time, (4, K)."""
        return self._lib.tip_bounds(np.ascontiguousarray(self._rows[:, :4])).T

    @cached_property
    def _speeds(self) -> tuple[Array, Array]:
        return self._lib.speed_bounds(np.ascontiguousarray(self._rows[:, :2]))

    def approach(self, first: Body, second: Body = BASE) -> Array:
        """Bound of the rate of the distance of two bodies, (K,) m/s."""
        origin, turn = self._speeds
        one, other = _path(self._lib, first.joint), _path(self._lib, second.joint)
        total = np.zeros(len(turn))
        for body, joints in ((first, one - other), (second, other - one)):
            for j in joints:
                total += origin[:, body.joint, j] + body.reach * turn[:, j]
        return total


def _path(lib: Library, joint: int) -> set[int]:
    """Joints between a link and the base."""
    joints = set()
    while joint >= 0:
        joints.add(joint)
        joint = lib.manifest.all_joints[joint].parent
    return joints


class SampledMotion:
    """A motion with five derivatives, q first, at N samples, (5, N, n)."""

    def __init__(self, lib: Library, motion: Array) -> None:
        self.lib, self.motion = lib, motion
        self._torques: dict[bytes, tuple[Array, Array, Array]] = {}

    def torques(self, pi: Array) -> tuple[Array, Array, Array]:
        """Torques τ and their rates dτ/dt and d²τ/dt², (N, n), under parameters π (10 n,)."""
        key = pi.tobytes()
        if key not in self._torques:
            q, dq, ddq, dddq, ddddq = self.motion
            self._torques[key] = self.lib.torque_with_rates(q, dq, ddq, dddq, ddddq, pi)
        return self._torques[key]

    @cached_property
    def tip(self) -> tuple[Array, Array, Array]:
        """Place, velocity and acceleration of the tip, (N, 3) m, m/s and m/s²."""
        q, dq, ddq = self.motion[:3]
        p, v, dp_dq, dv_dq = self.lib.tip_motion(q, dq)
        return p, v, times(dv_dq, dq) + times(dp_dq, ddq)


def times(jacobian: Array, speed: Array) -> Array:
    """Product J ẋ, (N, R), of J (N, R, n) and ẋ (N, n) at every sample."""
    return np.asarray(np.matmul(jacobian, speed[:, :, None])[:, :, 0])


class Constraint(Protocol):
    """One kind of limit."""

    @property
    def kind(self) -> str:
        """Name of the limit in certificates."""

    @property
    def orders(self) -> int:
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


@dataclass(frozen=True, slots=True)
class Side:
    """Braking towards the end of side s = ±1: max(0, s dq + c)² ≤ k (s q̂ − s q), (n,) each."""

    sign: float
    k: Array
    c: Array
    end: Array


@dataclass(frozen=True, slots=True)
class Braking:
    """Velocity limits that fall towards the ends of the range; rest at home uses 0 % of them."""

    kind: ClassVar[str] = "braking"
    orders: ClassVar[int] = 2
    even: ClassVar[bool] = False  # braking depends on the direction of dq
    sides: tuple[Side, ...]
    home: Array
    joints: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Joints, upper ends first."""
        return tuple(name for _ in self.sides for name in self.joints)

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
        shares = [part / self.room(s) for part, s in zip(parts, self.sides, strict=True)]
        return np.concatenate(shares, axis=1)

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
