"""Limits of a robot that are not linear in its motion, as g ≤ 0 with exact slopes.

Every law takes a motion (4, N, n), that is q, dq, ddq, dddq at N samples, and returns g (N, R) of
its R rows and ∂g/∂(q, dq, …) of as many orders as it reads. g is use − 1: it vanishes on the limit
and is −1 or less far from it. The physics comes from the robot's kernels.

| law | row | g |
|---|---|---|
| braking | joint and side | (max(0, ±dq + c)² − k (q̂ ∓ q)) / (k · room at rest at home) |
| torque | joint and sign | ±(τ + f_v dq) / (limit − f_c) − 1 |
| torque rate | joint and sign | ±(dτ/dt + f_v ddq) / limit − 1 |
| tip box | axis and side | (p − upper) / 0.1 m, (lower − p) / 0.1 m |
| tip speed | | (v²/v_max² − 1) / 2 |
| self-collision | pair | (margin − distance) / 0.1 m |
| table | proxy | (margin − height) / 0.1 m |
"""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from runtime.library import Array, Library

LENGTH = 0.1
"""m: a distance that is missing or left by this counts as one whole limit."""


class Law(Protocol):
    """One kind of limit."""

    kind: ClassVar[str]
    orders: ClassVar[int]
    """How many of q, dq, ddq, dddq are read."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Joint, axis or pair of each row, R."""

    @property
    def even(self) -> bool:
        """The same when the motion runs backwards: dq and dddq with the other sign."""

    def values(self, motion: Array) -> Array:
        """G, (N, R), of a motion (4, N, n)."""

    def slopes(self, motion: Array) -> Array:
        """∂g/∂(q, …), (N, R, orders, n)."""

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """The quantity of a row at g, its limit and its unit."""


@dataclass(frozen=True, slots=True)
class Side:
    """Braking towards one end of the range: max(0, s dq + c)² ≤ k (s q̂ − s q), (n,) each.

    s is +1 for the upper ends and −1 for the lower ones; what is infinite has no limit.
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
        return tuple(name for _ in self.sides for name in self.joints)

    @property
    def even(self) -> bool:
        return False

    def room(self, side: Side) -> Array:
        """S (q̂ − home) − c²/k, (n,) rad; NaN where the robot may not even rest at home."""
        room = side.sign * (side.end - self.home) - np.maximum(side.c, 0) ** 2 / side.k
        return np.where(room > 0, room, np.nan)

    def values(self, motion: Array) -> Array:
        q, dq = motion[:2]
        parts = [
            np.maximum(0, s.sign * dq + s.c) ** 2 / s.k - s.sign * (s.end - q) for s in self.sides
        ]
        return np.concatenate(
            [part / self.room(s) for part, s in zip(parts, self.sides, strict=True)], axis=1
        )

    def slopes(self, motion: Array) -> Array:
        dq, n = motion[1], motion.shape[2]
        found = np.zeros((len(dq), len(self.sides), n, 2, n))
        each = np.arange(n)
        for i, s in enumerate(self.sides):
            scale = s.sign / self.room(s)
            found[:, i, each, 0, each] = scale
            found[:, i, each, 1, each] = scale * 2 / s.k * np.maximum(0, s.sign * dq + s.c)
        return found.reshape(len(dq), -1, 2, n)

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        return 1 + g, 1.0, "of the room at home"


@dataclass(frozen=True, slots=True)
class Torque:
    """|τ + f_v dq| ≤ share · effort − f_c.

    Coulomb friction may act either way for a moment at every turn, so it lowers the limit; that is
    smooth and never too little.
    """

    kind: ClassVar[str] = "torque"
    orders: ClassVar[int] = 3
    lib: Library
    pi: Array
    limit: Array
    viscous: Array
    joints: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        return (*self.joints, *self.joints)

    @property
    def even(self) -> bool:
        return not self.viscous.any()

    def values(self, motion: Array) -> Array:
        share = (self.lib.inverse_dynamics(*motion[:3], self.pi) + self.viscous * motion[1]) / self.limit
        return _both(share)

    def slopes(self, motion: Array) -> Array:
        slope = np.stack(self.lib.torque_derivatives(*motion[:3], self.pi)[1:], axis=2)
        slope[:, :, 1] += np.diag(self.viscous)
        slope /= self.limit[:, None, None]
        return np.concatenate([slope, -slope], axis=1)

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        limit = float(self.limit[row % len(self.limit)])
        return (1 + g) * limit, limit, "N·m"


@dataclass(frozen=True, slots=True)
class TorqueRate:
    """|dτ/dt + f_v ddq| ≤ limit; the step of Coulomb friction at a turn is not counted."""

    kind: ClassVar[str] = "torque rate"
    orders: ClassVar[int] = 4
    lib: Library
    pi: Array
    limit: Array
    viscous: Array
    joints: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        return (*self.joints, *self.joints)

    @property
    def even(self) -> bool:
        return not self.viscous.any()

    def values(self, motion: Array) -> Array:
        return _both((self.lib.torque_rate(*motion, self.pi) + self.viscous * motion[2]) / self.limit)

    def slopes(self, motion: Array) -> Array:
        n = motion.shape[2]
        slope = self.lib.torque_rate_jacobian(*motion, self.pi)[1].reshape(-1, n, 4, n)
        slope[:, :, 2] += np.diag(self.viscous)
        slope /= self.limit[:, None, None]
        return np.concatenate([slope, -slope], axis=1)

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        limit = float(self.limit[row % len(self.limit)])
        return (1 + g) * limit, limit, "N·m/s"


@dataclass(frozen=True, slots=True)
class TipBox:
    """The tip stays in lower ≤ p ≤ upper, (3,) m in the base frame; ±inf leaves a side open."""

    kind: ClassVar[str] = "tip box"
    orders: ClassVar[int] = 1
    even: ClassVar[bool] = True
    labels: ClassVar[tuple[str, ...]] = ("x max", "y max", "z max", "x min", "y min", "z min")
    lib: Library
    lower: Array
    upper: Array

    def values(self, motion: Array) -> Array:
        p = self.lib.tip_motion(motion[0], motion[1])[0]
        return np.concatenate([p - self.upper, self.lower - p], axis=1) / LENGTH

    def slopes(self, motion: Array) -> Array:
        slope = self.lib.tip_motion(motion[0], motion[1])[2][:, :, None] / LENGTH
        return np.concatenate([slope, -slope], axis=1)

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        end = float(np.concatenate([self.upper, self.lower])[row])
        return end + g * (LENGTH if row < 3 else -LENGTH), end, "m"


@dataclass(frozen=True, slots=True)
class TipSpeed:
    """v ≤ limit, m/s; squared, because the speed itself has no slope at rest."""

    kind: ClassVar[str] = "tip speed"
    orders: ClassVar[int] = 2
    even: ClassVar[bool] = True
    labels: ClassVar[tuple[str, ...]] = ("tip",)
    lib: Library
    limit: float

    def values(self, motion: Array) -> Array:
        v = self.lib.tip_motion(motion[0], motion[1])[1]
        return (np.einsum("ni,ni->n", v, v)[:, None] / self.limit**2 - 1) / 2

    def slopes(self, motion: Array) -> Array:
        _, v, by_speed, by_position = self.lib.tip_motion(motion[0], motion[1])
        slope = np.stack([by_position, by_speed], axis=2)  # ∂v/∂dq = ∂p/∂q
        return np.einsum("ni,nidj->ndj", v, slope)[:, None] / self.limit**2

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        return self.limit * float(np.sqrt(max(0.0, 1 + 2 * g))), self.limit, "m/s"


@dataclass(frozen=True, slots=True)
class Clearance:
    """Every pair of links stays apart by its own margin, m."""

    kind: ClassVar[str] = "self-collision"
    orders: ClassVar[int] = 1
    even: ClassVar[bool] = True
    lib: Library
    margin: Array
    pairs: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        return self.pairs

    def values(self, motion: Array) -> Array:
        return (self.margin - self.lib.clearance(motion[0])[0]) / LENGTH

    def slopes(self, motion: Array) -> Array:
        return -self.lib.clearance(motion[0])[1][:, :, None] / LENGTH

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        margin = float(self.margin[row])
        return margin - g * LENGTH, margin, "m"


@dataclass(frozen=True, slots=True)
class Table:
    """Proxies stay above the plane z = height of the base frame by a margin, m."""

    kind: ClassVar[str] = "table"
    orders: ClassVar[int] = 1
    even: ClassVar[bool] = True
    lib: Library
    height: float
    margin: float
    proxies: tuple[str, ...]
    rows: Array
    """Of those proxies among the moving ones."""

    @property
    def labels(self) -> tuple[str, ...]:
        return self.proxies

    def values(self, motion: Array) -> Array:
        return (self.margin - self._heights(motion)[0]) / LENGTH

    def slopes(self, motion: Array) -> Array:
        return -self._heights(motion)[1][:, :, None] / LENGTH

    def _heights(self, motion: Array) -> tuple[Array, Array]:
        plane = np.array([0.0, 0.0, 1.0, self.height])
        heights, slopes = self.lib.plane_clearance(motion[0], plane)
        return heights[:, self.rows], slopes[:, self.rows]

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        return self.margin - g * LENGTH, self.margin, "m"


def _both(share: Array) -> Array:
    return np.concatenate([share, -share], axis=1) - 1
