"""Torques of all models within a band of parameters: inertial parameters and friction ± stated.

τ is linear in π and f_v, so that |δπ_p| ≤ Δ_p and |δf_v| ≤ Δf change it by at most

    Σ_p |Y_jp| Δ_p + Δf_j |dq_j|        and its rate by   Σ_p |dY_jp/dt| Δ_p + Δf_j |ddq_j|

and some model of the band reaches this. Each is the largest of functions that are smooth in time,
one per corner of the band, and all corners have the same bounds of derivatives.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.excitation.limits.interval_bounds import ROUNDING, IntervalBounds
from runtime.library import Array, Library

_MANY = 10
"""Parameters above which the whole regressor takes less time than its columns."""


@dataclass(frozen=True, slots=True)
class ModelBand:
    """Half-widths of a band of models.

    Attributes:
        lib: the robot.
        pi: Δ of the parameters of all links, (10 L,) [kg, kg·m, kg·m²].
        viscous: Δf of viscous friction, (n,) [N·m·s/rad].
    """

    lib: Library
    pi: Array
    viscous: Array

    def torques(self, motion: Array) -> Array:
        """Largest change of the torque of a motion (3 or more, N, n), (N, n) N·m."""
        columns = np.abs(self._columns(motion, 0)) @ self.pi[self._used]
        return np.asarray(columns + self.viscous * np.abs(motion[1]))

    def rates(self, motion: Array) -> Array:
        """Largest change of the torque rate of a motion (4 or more, N, n), (N, n) N·m/s."""
        columns = np.abs(self._columns(motion, 1)) @ self.pi[self._used]
        return np.asarray(columns + self.viscous * np.abs(motion[2]))

    def torque_slopes(self, motion: Array) -> Array:
        """Slopes of `torques` by q, dq and ddq, (N, n, 3, n); of the corner that is reached."""
        slopes = np.zeros((motion.shape[1], motion.shape[2], 3, motion.shape[2]))
        for j, corner in enumerate(self._corners(motion, 0)):
            parts = self.lib.torque_derivatives(motion[0], motion[1], motion[2], corner)[1:]
            slopes[:, j] = np.stack([part[:, j] for part in parts], axis=1)
            slopes[:, j, 1, j] += self.viscous[j] * np.sign(motion[1, :, j])
        return slopes

    def rate_slopes(self, motion: Array) -> Array:
        """Slopes of `rates` by q, dq, ddq and dddq, (N, n, 4, n)."""
        n = motion.shape[2]
        slopes = np.zeros((motion.shape[1], n, 4, n))
        for j, corner in enumerate(self._corners(motion, 1)):
            seed = np.broadcast_to(np.eye(n)[j], motion[0].shape)
            q, dq, ddq, dddq = motion[:4]
            slopes[:, j] = self.lib.torque_rate_adjoint(q, dq, ddq, dddq, corner, seed)
            slopes[:, j, 2, j] += self.viscous[j] * np.sign(motion[2, :, j])
        return slopes

    def changes(self, motion: Array, order: int) -> Array:
        """Rate in time of `torques` (order 0) or `rates` (order 1).

        motion (5, N, n) → (N, n).
        """
        change = self.viscous * np.sign(motion[order + 1]) * motion[order + 2]
        q, dq, ddq, dddq, ddddq = motion[:5]
        for j, corner in enumerate(self._corners(motion, order)):
            torques = self.lib.torque_with_rates(q, dq, ddq, dddq, ddddq, corner)
            change[:, j] += torques[order + 1][:, j]
        return np.asarray(change)

    def bend(self, bounds: IntervalBounds, order: int) -> Array:
        """Rise of `torques` (order 0) or `rates` (order 1) within intervals."""
        tau = bounds.torques(self.pi)
        second = tau[order + 2] + self.viscous * bounds.motion[order + 3]
        size = tau[order] + self.viscous * bounds.motion[order + 1]
        return np.asarray(bounds.bend(second) + ROUNDING * size)

    @property
    def _used(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.pi)

    def _columns(self, motion: Array, order: int) -> Array:
        """Y or dY/dt of the parameters with a width, (N, n, P)."""
        if order == 0 and len(self._used) > _MANY:
            return self.lib.regressor(motion[0], motion[1], motion[2])[..., self._used]
        columns = [np.zeros((*motion[0].shape, 0))]
        for p in self._used:
            unit = np.eye(len(self.pi))[p]
            if order:
                column = self.lib.torque_rate(motion[0], motion[1], motion[2], motion[3], unit)
            else:
                column = self.lib.inverse_dynamics(motion[0], motion[1], motion[2], unit)
            columns.append(column[..., None])
        return np.concatenate(columns, axis=-1)

    def _corners(self, motion: Array, order: int) -> Array:
        """Corner of the band that is reached at every sample by each joint, (n, N, 10 L)."""
        signs = np.sign(self._columns(motion, order))
        corners = np.zeros((motion.shape[2], motion.shape[1], len(self.pi)))
        corners[..., self._used] = signs.swapaxes(0, 1) * self.pi[self._used]
        return corners
