"""Evidence on the torque, joint by joint, from a regression on the torque of the URDF.

    τ_j = a g_j(q) + s m_j(q, dq, ddq) + c tanh(dq_j / ε) + v dq_j + b

with gravity part g and inertial part m. a is −1 where gravity or τ has the opposite sign. Friction
dissipates: P_j = mean(c |dq_j| + v dq_j²) > 0 in every real joint, so that P_j < 0 is a torque of
opposite sign. Standard deviations are those of coloured noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.inspection.checks.torque_rows import EPSILON, TorqueRows, least_squares
from runtime.library import Array

LOADED, MOST = 0.7, 0.8
"""Partial correlation of τ with the gravity torque from which on a joint follows it, and share of
the gravity torque that joints opposite to it must carry."""
SURE = 6.0
"""Standard deviations from which on a sign counts; the noise of friction is not white, and 4 are
reached by chance on logs of 5 s."""


@dataclass(frozen=True, slots=True)
class TorqueEvidence:
    """Regression of every joint on the torque of the URDF, (n,) each.

    Attributes:
        gravity: a.
        load: RMS of g.
        correlation: partial correlation of τ with g.
        power: P [W], in the unit of the logged torque.
        power_over_sigma: P over its standard deviation.
    """

    gravity: Array
    load: Array
    correlation: Array
    power: Array
    power_over_sigma: Array

    @property
    def gravity_is_against(self) -> bool:
        """Whether τ is opposite to the gravity torque at the joints that carry most of it."""
        return float(self.load[self.opposite].sum()) > MOST * float(self.load.sum())

    @property
    def opposite(self) -> NDArray[np.int64]:
        """Joints whose torque follows the gravity torque with the opposite sign."""
        return np.flatnonzero(self.correlation < -LOADED)

    @property
    def friction_sign(self) -> int:
        """1 where friction dissipates, −1 where it drives, 0 where that is not significant."""
        whole = float(np.sum(np.clip(self.power_over_sigma, -3 * SURE, 3 * SURE)))
        return int(np.sign(whole)) if abs(whole) > SURE * np.sqrt(len(self.power)) else 0


def torque_evidence(torque_rows: TorqueRows) -> TorqueEvidence:
    """Regress τ of every joint on gravity torque, inertial torque and friction."""
    inertial, falls = torque_rows.model_torque()
    speeds, tau = torque_rows.samples.dq, torque_rows.samples.tau
    columns = [_joint(falls[:, j], inertial[:, j], speeds[:, j], tau[:, j]) for j in _all(tau)]
    return TorqueEvidence(*(np.array(column) for column in zip(*columns, strict=True)))


def _all(values: Array) -> range:
    return range(values.shape[1])


def _joint(falls: Array, inertial: Array, dq: Array, tau: Array) -> tuple[float, ...]:
    """a, RMS of g, partial correlation, P and P/σ of one joint."""
    friction = np.column_stack([np.tanh(dq / EPSILON), dq])
    others = np.column_stack([inertial, friction, np.ones_like(dq)])
    _, bare_tau = least_squares(others, tau)
    _, bare_falls = least_squares(others, falls)
    size = float(np.linalg.norm(bare_falls))
    moved = size > 1e-6 * np.sqrt(len(falls))  # rounding of a joint along gravity
    both = float(bare_falls @ bare_tau) if moved else 0.0
    slope = both / size**2 if moved else 0.0
    correlation = both / max(size * float(np.linalg.norm(bare_tau)), 1e-300)
    matrix = np.column_stack([falls, others]) if moved else others
    lengths = np.linalg.norm(matrix, axis=0)
    unit = matrix / np.where(lengths > 0, lengths, 1.0)
    x, rest = least_squares(unit, tau)
    # Mean power of friction as a linear function of the coefficients.
    weights = np.zeros(matrix.shape[1])
    weights[-3:-1] = np.mean(friction * dq[:, None], axis=0)
    weights = weights / np.where(lengths > 0, lengths, 1.0)
    inflation = coloured_noise_of_rows(unit[:, None, :], rest[:, None]).inflation
    variance = inflation * float(np.mean(rest**2))
    spread = float(weights @ np.linalg.pinv(unit.T @ unit, rcond=1e-9) @ weights)
    power = float(weights @ x)
    load = float(np.sqrt(np.mean(falls**2)))
    return slope, load, correlation, power, power / np.sqrt(max(variance * spread, 1e-300))
