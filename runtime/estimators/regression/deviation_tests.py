"""Test of the friction columns of a fit.

Friction that the columns do not describe:

    τ_j = (Y_b β + F φ)_j + ζ₁ s(dq_j) exp(−(dq_j / v)²) + ζ₂ s(dq_j) |τ̂_j|

The two columns of every joint, a Stribeck peak and friction that grows with the load, are the
deviations of gears that viscous, Coulomb and offset columns leave in the residual. The fit of the
inertial parameters takes up a part of them, so that its intervals are too narrow.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from runtime.estimators.regression.omitted_columns import SIGNIFICANCE, FreeFit, score_test
from runtime.estimators.regression.posterior import APART, orthonormal
from runtime.library import Array, Library

PEAK, SIGN = 0.15, 0.05
"""Speed v of the peak and width of the sign s, over the root mean square speed of a joint."""


@dataclass(frozen=True, slots=True, eq=False)
class FrictionTest:
    """Result of the test."""

    excess: float  # statistic of all joints over the value that it seldom exceeds
    # excess of the columns of every joint alone, (n,); zeros where `excess` is 1 or less
    joints: Array

    @property
    def is_contradicted(self) -> bool:
        """Whether the residuals contain friction that no column describes."""
        return self.excess > 1

    def names(self, lib: Library) -> list[str]:
        """Joints whose own columns are contradicted, or the one with the largest excess."""
        largest = float(self.joints.max())
        chosen = np.flatnonzero(self.joints >= min(1.0, largest))
        return [lib.joint_names[int(k)] for k in chosen]


def friction_test(fit: FreeFit) -> FrictionTest | None:
    """Test the friction columns of a fit."""
    columns, moving = friction_columns(fit)
    test = score_test(fit, columns)
    if test is None:
        return None
    joints = np.zeros(fit.scale.size)
    excess = test.statistic / test.quantile
    for k, joint in enumerate(moving if excess > 1 else ()):
        added = orthonormal(test.columns[:, 2 * k : 2 * k + 2], APART)
        explained = added.T @ fit.rest
        quantile = float(chdtri(max(added.shape[1], 1), SIGNIFICANCE))
        joints[joint] = float(explained @ explained) / test.density / quantile
    return FrictionTest(excess, joints)


def friction_columns(fit: FreeFit) -> tuple[Array, list[int]]:
    """The two columns of every joint that moves."""
    dq, n = fit.samples.dq, fit.scale.size
    speed = np.sqrt(np.mean(dq**2, axis=0))
    moving = speed > 0
    unit = np.where(moving, speed, 1.0)
    sign = np.tanh(dq / (SIGN * unit))
    load = np.abs(fit.predicted.reshape(-1, n))
    columns = np.zeros((len(dq), n, n, 2))
    columns[:, range(n), range(n), 0] = sign * np.exp(-((dq / (PEAK * unit)) ** 2))
    columns[:, range(n), range(n), 1] = sign * load
    return columns[:, :, moving].reshape(len(dq) * n, -1), [int(k) for k in np.flatnonzero(moving)]
