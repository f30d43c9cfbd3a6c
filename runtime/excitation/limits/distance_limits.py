"""Limits of places and distances as constraints: g ≤ 0 in units of 0.1 m, with exact slopes.

| constraint | row | g |
|---|---|---|
| tip box | axis and side | (p − upper) / 0.1 m, (lower − p) / 0.1 m |
| tip speed | | (v²/v_max² − 1) / 2 |
| self-collision | pair | (margin − distance) / 0.1 m |
| table | proxy | (margin − height) / 0.1 m |
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from runtime.excitation.limits import nonlinear_limits
from runtime.library import Array, Indices, Library, ProxyFacts

LENGTH = 0.1  # unit of distances in constraints, m: what is missing or left by this is one limit
NEAR_AND_FAR = 2e-5, 9e-5  # tolerances of proven distances: 2 µm near the margin, else 9 µm


@dataclass(frozen=True, slots=True)
class TipBox:
    """Box of the tip, lower ≤ p ≤ upper, (3,) m in the base frame; ±inf leaves a side open."""

    kind: ClassVar[str] = "tip box"
    orders: ClassVar[int] = 1
    even: ClassVar[bool] = True
    precision: ClassVar[tuple[float, float]] = nonlinear_limits.SMOOTH
    labels: ClassVar[tuple[str, ...]] = ("x max", "y max", "z max", "x min", "y min", "z min")
    lib: Library
    lower: Array
    upper: Array

    def values(self, motion: Array) -> Array:
        """Values p − upper and lower − p, in 0.1 m."""
        p = self.lib.tip_motion(motion[0], motion[1])[0]
        return np.concatenate([p - self.upper, self.lower - p], axis=1) / LENGTH

    def slopes(self, motion: Array) -> Array:
        """Slopes ±∂p/∂q."""
        slope = self.lib.tip_motion(motion[0], motion[1])[2][:, :, None] / LENGTH
        return np.concatenate([slope, -slope], axis=1)

    def along(self, sampled: nonlinear_limits.SampledMotion) -> tuple[Array, Array]:
        """Values, and rates from ±v."""
        p, v, _ = sampled.tip
        g = np.concatenate([p - self.upper, self.lower - p], axis=1) / LENGTH
        return g, np.concatenate([v, -v], axis=1) / LENGTH

    def rise(self, bounds: nonlinear_limits.IntervalBounds) -> Array:
        """Rise by d²p/dt²."""
        p, _, second, _ = bounds.tip
        rise = bounds.bend(second) + nonlinear_limits.ROUNDING * p
        return np.repeat(rise[:, None] / LENGTH, len(self.labels), axis=1)

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Coordinate of the tip at a value of the constraint."""
        end = float(np.concatenate([self.upper, self.lower])[row])
        return end + g * (LENGTH if row < 3 else -LENGTH), end, "m"


@dataclass(frozen=True, slots=True)
class TipSpeed:
    """Speed of the tip, v ≤ limit [m/s]; squared, because v itself has no slope at rest."""

    kind: ClassVar[str] = "tip speed"
    orders: ClassVar[int] = 2
    even: ClassVar[bool] = True
    precision: ClassVar[tuple[float, float]] = nonlinear_limits.SMOOTH
    labels: ClassVar[tuple[str, ...]] = ("tip",)
    lib: Library
    limit: float

    def values(self, motion: Array) -> Array:
        """(v²/v_max² − 1) / 2."""
        v = self.lib.tip_motion(motion[0], motion[1])[1]
        return (np.einsum("ni,ni->n", v, v)[:, None] / self.limit**2 - 1) / 2

    def slopes(self, motion: Array) -> Array:
        """v · ∂v/∂(q, dq) / v_max², with ∂v/∂dq = ∂p/∂q."""
        _, v, by_speed, by_position = self.lib.tip_motion(motion[0], motion[1])
        slope = np.stack([by_position, by_speed], axis=2)  # ∂v/∂dq = ∂p/∂q
        return np.einsum("ni,nidj->ndj", v, slope)[:, None] / self.limit**2

    def along(self, sampled: nonlinear_limits.SampledMotion) -> tuple[Array, Array]:
        """Values, and rates v · dv/dt / v_max²."""
        _, v, dv = sampled.tip
        square, rate = (np.einsum("ni,ni->n", v, x)[:, None] / self.limit**2 for x in (v, dv))
        return (square - 1) / 2, rate

    def rise(self, bounds: nonlinear_limits.IntervalBounds) -> Array:
        """Rise by v · d²v/dt² + (dv/dt)²."""
        _, v, dv, ddv = bounds.tip
        rise = bounds.bend(v * ddv + dv**2) + nonlinear_limits.ROUNDING * v**2
        return rise[:, None] / self.limit**2

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Speed of the tip at a value of the constraint."""
        return self.limit * float(np.sqrt(max(0.0, 1 + 2 * g))), self.limit, "m/s"


class Clearance(ABC):
    """Constraint (margin − distance) / 0.1 m of R distances, with one margin or one per row [m]."""

    orders: ClassVar[int] = 1
    even: ClassVar[bool] = True
    precision: ClassVar[tuple[float, float]] = NEAR_AND_FAR
    lib: Library
    margin: Array | float

    @abstractmethod
    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Distances (N, R) m at positions (N, n), and their slopes by q, (N, R, n)."""

    @abstractmethod
    def approaches(self, bounds: nonlinear_limits.IntervalBounds) -> Array:
        """Bounds of the rates of the distances, (K, R) m/s."""

    def distances(self, motion: Array) -> Array:
        """Distance of every row, (N, R) m."""
        return self.distances_and_slopes(motion[0])[0]

    def values(self, motion: Array) -> Array:
        """Values margin − distance, in 0.1 m."""
        return np.asarray((self.margin - self.distances(motion)) / LENGTH)

    def slopes(self, motion: Array) -> Array:
        """Slopes −∂distance/∂q."""
        return -self.distances_and_slopes(motion[0])[1][:, :, None] / LENGTH

    def along(self, sampled: nonlinear_limits.SampledMotion) -> tuple[Array, Array]:
        """Values, and rates −∂distance/∂q dq."""
        distance, slope = self.distances_and_slopes(sampled.motion[0])
        rate = nonlinear_limits.times(slope, sampled.motion[1]) / -LENGTH
        return (self.margin - distance) / LENGTH, rate

    def rise(self, bounds: nonlinear_limits.IntervalBounds) -> Array:
        """Rise by half a step from the nearer end; distances have corners in time."""
        # Coordinates are a few times smaller than 10 m.
        return (bounds.step / 2 * self.approaches(bounds) + 10 * nonlinear_limits.ROUNDING) / LENGTH

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Distance of a row at a value of the constraint.

        Args:
            row: index of the row.
            g: value of the constraint there.

        Returns:
            Distance and margin [m] and their unit.
        """
        margin = float(self.margin if np.ndim(self.margin) == 0 else np.asarray(self.margin)[row])
        return margin - g * LENGTH, margin, "m"


@dataclass(frozen=True, slots=True)
class LinkClearance(Clearance):
    """Distances between links, each pair with its margin [m]."""

    kind: ClassVar[str] = "self-collision"
    lib: Library
    margin: Array
    labels: tuple[str, ...]  # both links of every pair

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Distance of every pair, (N, R) m, and its slopes by q, (N, R, n)."""
        return self.lib.clearance(q)

    def approaches(self, bounds: nonlinear_limits.IntervalBounds) -> Array:
        """Bounds of the rates of the distances, (K, R) m/s."""
        bodies = {proxy.name: body_of(proxy) for proxy in self.lib.proxies}
        pairs = ((bodies[pair.first], bodies[pair.second]) for pair in self.lib.pairs)
        return np.stack([bounds.approach(*pair) for pair in pairs], axis=1)


@dataclass(frozen=True, slots=True)
class TableClearance(Clearance):
    """Heights of proxies above the plane z = height of the base frame, with a margin [m]."""

    kind: ClassVar[str] = "table"
    lib: Library
    height: float
    margin: float
    labels: tuple[str, ...]  # names of the proxies
    rows: Indices  # indices of those proxies among the moving ones

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Height of every proxy above the table, (N, R) m, and its slopes by q, (N, R, n)."""
        heights, slopes = self.lib.plane_clearance(q, np.array([0.0, 0.0, 1.0, self.height]))
        return heights[:, self.rows], slopes[:, self.rows]

    def approaches(self, bounds: nonlinear_limits.IntervalBounds) -> Array:
        """Bounds of the rates of the heights, (K, R) m/s."""
        bodies = {proxy.name: body_of(proxy) for proxy in self.lib.proxies}
        return np.stack([bounds.approach(bodies[name]) for name in self.labels], axis=1)


def body_of(proxy: ProxyFacts) -> nonlinear_limits.Body:
    """A proxy as a body; the axis of a capsule keeps its radius from the surface."""
    reach = float(np.linalg.norm([proxy.start, proxy.end], axis=1).max())
    return nonlinear_limits.Body(proxy.joint, reach)


def use_of(constraint: nonlinear_limits.Constraint, g: float) -> float:
    """Use of a limit, 1 on the limit: 1 + g, and v / v_max for the speed, whose g is in squares."""
    if isinstance(constraint, TipSpeed):
        return constraint.measured(0, g)[0] / constraint.limit
    return 1 + g
