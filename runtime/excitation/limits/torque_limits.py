"""Limits of torques and of their rates, as constraints g ≤ 0 with exact slopes.

| constraint | row | g |
|---|---|---|
| torque | joint and sign | ±(τ + f_v dq) / (limit − f_c) − 1 |
| torque rate | joint and sign | ±(dτ/dt + f_v ddq) / limit − 1 |

τ contains the torque of springs of known stiffness and of torque curves. With a band of models the
largest change of the torque, or of its rate, is added to both signs.

A band states inertial parameters and friction ±. τ is linear in π and f_v, so that |δπ_p| ≤ Δ_p and
|δf_v| ≤ Δf change it by at most

    Σ_p |Y_jp| Δ_p + Δf_j |dq_j|        and its rate by   Σ_p |dY_jp/dt| Δ_p + Δf_j |ddq_j|

and some model of the band reaches this. Each is the largest of functions that are smooth in time,
one per corner of the band, and all corners have the same bounds of derivatives.

The library computes the torque p(q) of springs and curves. Derivatives are central differences of
it: of a spring they are exact to 1e-8, and across a corner of a piecewise linear curve they are
those of its chord.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from runtime.excitation.limits import nonlinear_limits
from runtime.library import Array, Indices, Library

_MANY = 10  # parameters above which the whole regressor takes less time than its columns
KINDS = ("torque", "torque rate")
STEP = 1e-5  # step of first differences, rad or m, or s along a motion: ε^⅓ of the usual sizes
WIDE = 1e-4  # step of second differences: ε^¼


@dataclass(frozen=True, slots=True)
class ModelBand:
    """Half-widths of a band of models."""

    lib: Library  # the robot
    pi: Array  # Δ of the parameters of all links, (10 L,) [kg, kg·m, kg·m²]
    viscous: Array  # Δf of viscous friction, (n,) [N·m·s/rad]

    def widths(self, motion: Array, order: int) -> Array:
        """Largest change of the torque (order 0) or its rate (order 1) of a motion, (N, n)."""
        columns = np.abs(self._columns(motion, order)) @ self.pi[self._used]
        return np.asarray(columns + self.viscous * np.abs(motion[order + 1]))

    def slopes(self, motion: Array, order: int) -> Array:
        """Slopes of `widths`, (N, n, 3 + order, n), of the corner that is reached."""
        n, (q, dq, ddq) = motion.shape[2], motion[:3]
        slopes = np.zeros((motion.shape[1], n, 3 + order, n))
        for j, corner in enumerate(self._corners(motion, order)):
            if order:
                seed = np.broadcast_to(np.eye(n)[j], motion[0].shape)
                slopes[:, j] = self.lib.torque_rate_adjoint(q, dq, ddq, motion[3], corner, seed)
            else:
                parts = self.lib.torque_derivatives(q, dq, ddq, corner)[1:]
                slopes[:, j] = np.stack([part[:, j] for part in parts], axis=1)
            slopes[:, j, order + 1, j] += self.viscous[j] * np.sign(motion[order + 1, :, j])
        return slopes

    def changes(self, motion: Array, order: int) -> Array:
        """Rate of `widths` in time, (N, n), of a motion (5, N, n)."""
        change = self.viscous * np.sign(motion[order + 1]) * motion[order + 2]
        q, dq, ddq, dddq, ddddq = motion[:5]
        for j, corner in enumerate(self._corners(motion, order)):
            torques = self.lib.torque_with_rates(q, dq, ddq, dddq, ddddq, corner)
            change[:, j] += torques[order + 1][:, j]
        return np.asarray(change)

    def bend(self, bounds: nonlinear_limits.IntervalBounds, order: int) -> Array:
        """Rise of `widths` within intervals."""
        tau = bounds.torques(self.pi)
        second = tau[order + 2] + self.viscous * bounds.motion[order + 3]
        size = tau[order] + self.viscous * bounds.motion[order + 1]
        return np.asarray(bounds.bend(second) + nonlinear_limits.ROUNDING * size)

    @property
    def _used(self) -> Indices:
        return np.flatnonzero(self.pi)

    def _columns(self, motion: Array, order: int) -> Array:
        """Y or dY/dt of the parameters with a width, (N, n, P)."""
        if order == 0 and len(self._used) > _MANY:
            return self.lib.regressor(motion[0], motion[1], motion[2])[..., self._used]
        columns = [np.zeros((*motion[0].shape, 0))]
        for p in self._used:
            columns.append(_torque(self.lib, motion, np.eye(len(self.pi))[p], order)[..., None])
        return np.concatenate(columns, axis=-1)

    def _corners(self, motion: Array, order: int) -> Array:
        """Corner of the band that is reached at every sample by each joint, (n, N, 10 L)."""
        signs = np.sign(self._columns(motion, order))
        corners = np.zeros((motion.shape[2], motion.shape[1], len(self.pi)))
        corners[..., self._used] = signs.swapaxes(0, 1) * self.pi[self._used]
        return corners


@dataclass(frozen=True, slots=True)
class KnownTorque:
    """Springs and curves of one robot."""

    lib: Library  # the robot

    def torque(self, q: Array) -> Array:
        """Torque p, (N, n) N·m, of positions (N, n)."""
        return self.lib.known_torque(q)

    def slope(self, q: Array) -> Array:
        """Slopes ∂p/∂q, (N, n, n), of positions (N, n)."""
        steps = STEP * np.eye(q.shape[1])
        columns = [(self.torque(q + e) - self.torque(q - e)) / (2 * STEP) for e in steps]
        return np.stack(columns, axis=2)

    def along(self, motion: Array) -> tuple[Array, Array, Array]:
        """Torque p and its two derivatives in time, (N, n) each, of a motion (3 or more, N, n)."""
        q, dq, ddq = motion[:3]
        rate = (self.torque(q + STEP * dq) - self.torque(q - STEP * dq)) / (2 * STEP)
        held, turn = self.torque(q), WIDE**2 / 2 * ddq
        later, before = (self.torque(q + s * WIDE * dq + turn) for s in (1, -1))
        return held, rate, (later - 2 * held + before) / WIDE**2

    def rate_slopes(self, motion: Array) -> tuple[Array, Array]:
        """Slopes of dp/dt by q and dq, (N, n, n) each, of a motion (2 or more, N, n)."""
        q, dq = motion[:2]
        by_q = (self.slope(q + WIDE * dq) - self.slope(q - WIDE * dq)) / (2 * WIDE)
        return by_q, self.slope(q)


def known_torque_of(lib: Library) -> KnownTorque | None:
    """Springs and curves of a robot; None where it has none."""
    return KnownTorque(lib) if "known_torque" in lib.manifest.kernels else None


@dataclass(frozen=True, slots=True)
class TorqueLimit:
    """Constraint ±dᵏ(τ + f_v dq)/dtᵏ / limit − 1 of torques (k = 0) or of their rates (k = 1).

    Rows joint by joint, positive sign first. Coulomb friction may act either way for a moment at
    every turn: it lowers the limit of the torque, which is smooth and never too little; its step at
    a turn is left out of the rate.
    """

    precision: ClassVar[tuple[float, float]] = nonlinear_limits.SMOOTH
    order: int  # k
    lib: Library
    pi: Array
    limit: Array
    viscous: Array
    joints: tuple[str, ...]
    band: ModelBand | None = None
    springs: KnownTorque | None = None

    @property
    def kind(self) -> str:
        """Quantity that is limited."""
        return KINDS[self.order]

    @property
    def orders(self) -> int:
        """The torque reads q, dq and ddq, its rate dddq too."""
        return self.order + 3

    @property
    def labels(self) -> tuple[str, ...]:
        """Joints, positive sign first."""
        return (*self.joints, *self.joints)

    @property
    def even(self) -> bool:
        """Without viscous friction: inertia and gravity are even, as is the size of their rate."""
        return not self.viscous.any()

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Quantity (1 + g) limit of a row, its limit, and their unit with N in place of N·m."""
        limit = float(self.limit[row % len(self.limit)])
        return (1 + g) * limit, limit, ("N·m", "N·m/s")[self.order]

    def smooth(self, motion: Array) -> Array:
        """Torque or its rate with springs and curves, (N, n) N·m or N·m/s, N or N/s for a slide."""
        smooth = _torque(self.lib, motion, self.pi, self.order)
        if self.springs is not None:
            held = self.springs.along(motion)[1] if self.order else self.springs.torque(motion[0])
            smooth = smooth + held
        return smooth + self.viscous * motion[self.order + 1]

    def values(self, motion: Array) -> Array:
        """Values ±dᵏ(τ + f_v dq)/dtᵏ / limit − 1."""
        g = _both(self.smooth(motion) / self.limit)
        return g if self.band is None else self._widened(g, self.band.widths(motion, self.order))

    def slopes(self, motion: Array) -> Array:
        """Slopes ±(∂(dᵏτ/dtᵏ)/∂(q, dq, …) + f_v) / limit, with the change within the band."""
        n, (q, dq, ddq) = motion.shape[2], motion[:3]
        if self.order:
            rows = self.lib.torque_rate_jacobian(q, dq, ddq, motion[3], self.pi)[1]
            slope = rows.reshape(-1, n, 4, n)
        else:
            slope = np.stack(self.lib.torque_derivatives(q, dq, ddq, self.pi)[1:], axis=2)
        if self.springs is not None:
            held = self.springs.rate_slopes(motion) if self.order else (self.springs.slope(q),)
            for k, part in enumerate(held):
                slope[:, :, k] += part
        slope[:, :, self.order + 1] += np.diag(self.viscous)
        limit = self.limit[:, None, None]  # beside slopes (N, n, orders, n)
        slope /= limit
        signed = np.concatenate([slope, -slope], axis=1)
        if self.band is not None:
            signed += np.tile(self.band.slopes(motion, self.order) / limit, (1, 2, 1, 1))
        return signed

    def along(self, sampled: nonlinear_limits.SampledMotion) -> tuple[Array, Array]:
        """Values, and rates with the derivative of one order more."""
        k, motion = self.order, sampled.motion
        value, rate = sampled.torques(self.pi)[k : k + 2]
        if self.springs is not None:
            held = self.springs.along(motion)
            value, rate = value + held[k], rate + held[k + 1]
        g = _both((value + self.viscous * motion[k + 1]) / self.limit)
        slope = (rate + self.viscous * motion[k + 2]) / self.limit
        rate = np.concatenate([slope, -slope], axis=1)
        if self.band is None:
            return g, rate
        more, change = self.band.widths(motion, k), self.band.changes(motion, k)
        return self._widened(g, more), self._widened(rate, change)

    def rise(self, bounds: nonlinear_limits.IntervalBounds) -> Array:
        """Rise by the derivative of two orders more."""
        k, tau, motion = self.order, bounds.torques(self.pi), bounds.motion
        second = tau[k + 2] + self.viscous * motion[k + 3]
        size = tau[k] + self.viscous * motion[k + 1]
        rise = bounds.bend(second) + nonlinear_limits.ROUNDING * size
        if self.band is not None:
            rise = rise + self.band.bend(bounds, k)
        return np.tile(rise / self.limit, 2)

    def _widened(self, g: Array, more: Array) -> Array:
        """Values of both signs, with the largest change within the band (N, n)."""
        return np.asarray(g + np.tile(more / self.limit, 2))


def _torque(lib: Library, motion: Array, pi: Array, order: int) -> Array:
    """Torque (order 0) or its rate (order 1) of bodies, (N, n)."""
    q, dq, ddq = motion[:3]
    if order:
        return lib.torque_rate(q, dq, ddq, motion[3], pi)
    return lib.inverse_dynamics(q, dq, ddq, pi)


def _both(share: Array) -> Array:
    return np.concatenate([share, -share], axis=1) - 1
