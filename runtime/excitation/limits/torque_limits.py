"""Limits of torques and of their rates, as constraints g ≤ 0 with exact slopes.

| constraint | row | g |
|---|---|---|
| torque | joint and sign | ±(τ + f_v dq) / (limit − f_c) − 1 |
| torque rate | joint and sign | ±(dτ/dt + f_v ddq) / limit − 1 |

τ contains the torque of springs of known stiffness and of torque curves. With a band of models the
largest change of the torque, or of its rate, is added to both signs.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from runtime.excitation.limits.interval_bounds import ROUNDING, IntervalBounds
from runtime.excitation.limits.known_torque import KnownTorque
from runtime.excitation.limits.model_band import ModelBand
from runtime.excitation.limits.nonlinear_limits import SMOOTH
from runtime.excitation.limits.sampled_motion import SampledMotion
from runtime.library import Array, Library


@dataclass(frozen=True, slots=True)
class _OfJoints:
    """Constraint ±(smooth part) / limit − 1, row by joint, positive sign first."""

    unit: ClassVar[str]
    precision: ClassVar[tuple[float, float]] = SMOOTH
    lib: Library
    pi: Array
    limit: Array
    viscous: Array
    joints: tuple[str, ...]
    band: ModelBand | None = None
    springs: KnownTorque | None = None

    @property
    def labels(self) -> tuple[str, ...]:
        """Joints, positive sign first."""
        return (*self.joints, *self.joints)

    @property
    def even(self) -> bool:
        """Without viscous friction: inertia and gravity are even, as is the size of their rate."""
        return not self.viscous.any()

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Quantity of a row in `unit`, with N instead of N·m for a slide.

        Args:
            row: index of the constraint, n of the positive sign first.
            g: its value, (quantity − limit) / limit.

        Returns:
            Quantity, limit and unit.
        """
        limit = float(self.limit[row % len(self.limit)])
        return (1 + g) * limit, limit, self.unit

    def _rise(self, bounds: IntervalBounds, order: int) -> Array:
        """Rise of ±dᵏ(τ + f_v dq)/dtᵏ over the limit, with the derivative of two orders more."""
        tau, motion = bounds.torques(self.pi), bounds.motion
        second = tau[order + 2] + self.viscous * motion[order + 3]
        size = tau[order] + self.viscous * motion[order + 1]
        rise = bounds.bend(second) + ROUNDING * size
        if self.band is not None:
            rise = rise + self.band.bend(bounds, order)
        return np.tile(rise / self.limit, 2)

    def _widened(self, g: Array, more: Array) -> Array:
        """Values of both signs, with the largest change within the band (N, n)."""
        return np.asarray(g + np.tile(more / self.limit, 2))

    @property
    def _columns(self) -> Array:
        """Limits beside slopes (N, n, orders, n)."""
        return self.limit[:, None, None]

    def _signed(self, slope: Array, order: int) -> Array:
        """Slopes of both signs over the limit, with f_v at the derivative `order`."""
        slope[:, :, order] += np.diag(self.viscous)
        slope /= self._columns
        return np.concatenate([slope, -slope], axis=1)

    def _with_rate(self, value: Array, rate: Array, rubbing: Array) -> tuple[Array, Array]:
        """Values g and rates of ±(value + f_v rubbing[0]) / limit − 1, with rubbing[1] in rates."""
        share = (value + self.viscous * rubbing[0]) / self.limit
        slope = (rate + self.viscous * rubbing[1]) / self.limit
        return _both(share), np.concatenate([slope, -slope], axis=1)


@dataclass(frozen=True, slots=True)
class Torque(_OfJoints):
    """Torque limit |τ + f_v dq| ≤ share · effort − f_c.

    Coulomb friction may act either way for a moment at every turn, so that it lowers the limit.
    This is smooth, and never too little.
    """

    kind: ClassVar[str] = "torque"
    orders: ClassVar[int] = 3
    unit: ClassVar[str] = "N·m"

    def torques(self, motion: Array) -> Array:
        """Torque τ + f_v dq with springs and curves, (N, n) N·m, N for a slide."""
        smooth = self.lib.inverse_dynamics(*_three(motion), self.pi)
        if self.springs is not None:
            smooth = smooth + self.springs.torque(motion[0])
        return smooth + self.viscous * motion[1]

    def values(self, motion: Array) -> Array:
        """Values ±(τ + f_v dq) / limit − 1."""
        g = _both(self.torques(motion) / self.limit)
        return g if self.band is None else self._widened(g, self.band.torques(motion))

    def along(self, sampled: SampledMotion) -> tuple[Array, Array]:
        """Values, and rates with dτ/dt + f_v ddq."""
        tau, dtau, _ = sampled.torques(self.pi)
        if self.springs is not None:
            held, change, _ = self.springs.along(sampled.motion)
            tau, dtau = tau + held, dtau + change
        g, rate = self._with_rate(tau, dtau, sampled.motion[1:3])
        if self.band is None:
            return g, rate
        more, change = self.band.torques(sampled.motion), self.band.changes(sampled.motion, 0)
        return self._widened(g, more), self._widened(rate, change)

    def rise(self, bounds: IntervalBounds) -> Array:
        """Rise by d²τ/dt² + f_v dddq."""
        return self._rise(bounds, 0)

    def slopes(self, motion: Array) -> Array:
        """Slopes ±(∂τ/∂(q, dq, ddq) + f_v) / limit."""
        slope = np.stack(self.lib.torque_derivatives(*_three(motion), self.pi)[1:], axis=2)
        if self.springs is not None:
            slope[:, :, 0] += self.springs.slope(motion[0])
        signed = self._signed(slope, 1)
        if self.band is not None:
            signed += np.tile(self.band.torque_slopes(motion) / self._columns, (1, 2, 1, 1))
        return signed


@dataclass(frozen=True, slots=True)
class TorqueRate(_OfJoints):
    """Limit |dτ/dt + f_v ddq| ≤ limit; the step of Coulomb friction at a turn is left out."""

    kind: ClassVar[str] = "torque rate"
    orders: ClassVar[int] = 4
    unit: ClassVar[str] = "N·m/s"

    def values(self, motion: Array) -> Array:
        """Values ±(dτ/dt + f_v ddq) / limit − 1."""
        smooth = self.lib.torque_rate(*_four(motion), self.pi)
        if self.springs is not None:
            smooth = smooth + self.springs.along(motion)[1]
        g = _both((smooth + self.viscous * motion[2]) / self.limit)
        return g if self.band is None else self._widened(g, self.band.rates(motion))

    def along(self, sampled: SampledMotion) -> tuple[Array, Array]:
        """Values, and rates with d²τ/dt² + f_v dddq."""
        _, dtau, ddtau = sampled.torques(self.pi)
        if self.springs is not None:
            _, change, bend = self.springs.along(sampled.motion)
            dtau, ddtau = dtau + change, ddtau + bend
        g, rate = self._with_rate(dtau, ddtau, sampled.motion[2:4])
        if self.band is None:
            return g, rate
        more, change = self.band.rates(sampled.motion), self.band.changes(sampled.motion, 1)
        return self._widened(g, more), self._widened(rate, change)

    def rise(self, bounds: IntervalBounds) -> Array:
        """Rise by d³τ/dt³ + f_v ddddq."""
        return self._rise(bounds, 1)

    def slopes(self, motion: Array) -> Array:
        """Slopes ±(∂(dτ/dt)/∂(q, dq, ddq, dddq) + f_v) / limit."""
        n = motion.shape[2]
        slope = self.lib.torque_rate_jacobian(*_four(motion), self.pi)[1].reshape(-1, n, 4, n)
        if self.springs is not None:
            by_q, by_dq = self.springs.rate_slopes(motion)
            slope[:, :, 0] += by_q
            slope[:, :, 1] += by_dq
        signed = self._signed(slope, 2)
        if self.band is not None:
            signed += np.tile(self.band.rate_slopes(motion) / self._columns, (1, 2, 1, 1))
        return signed


def _three(motion: Array) -> tuple[Array, Array, Array]:
    return motion[0], motion[1], motion[2]


def _four(motion: Array) -> tuple[Array, Array, Array, Array]:
    return *_three(motion), motion[3]


def _both(share: Array) -> Array:
    return np.concatenate([share, -share], axis=1) - 1
