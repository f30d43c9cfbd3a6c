"""Tests of a fit against what it leaves out, each by columns of `omitted_columns`.

Gains of the joints against each other: τ_j = (1 + ε_j) (Y_b β + F φ)_j + e_j. The links of an arm
load several joints, so that one scale of its torques that is wrong leaves residuals which no β
explains. Columns ε_j are added to the least squares, with the torque of the free fit as their
content; their common factor is not identifiable from the data and drops out. The explained residual
over its noise is χ² with n − 1 degrees of freedom where all gains agree, and that of the column of
one joint alone with one. Source: Gautier & Briot 2014 for the regression with gains.

Time stamps of the torque against those of the motion:

    τ(t) = (Y_b β + F φ)(t − δ) + e ≈ Y_b β + F φ − δ d/dt (Y_b β + F φ) + e

One delay δ for all joints is a column of the least squares, with the derivative of the predicted
torque along the log as its content. The fit takes up most of a delay of some milliseconds as a bias
of its parameters, and the test finds the rest. The time step comes from positions and velocities.

Friction that the columns do not describe:

    τ_j = (Y_b β + F φ)_j + ζ₁ s(dq_j) exp(−(dq_j / v)²) + ζ₂ s(dq_j) |τ̂_j|

The two columns of every joint, a Stribeck peak and friction that grows with the load, are the
deviations of gears that viscous, Coulomb and offset columns leave in the residual. The fit of the
inertial parameters takes up a part of them, so that its intervals are too narrow.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from runtime.estimators.regression.omitted_columns import (
    MARGIN,
    SIGNIFICANCE,
    FreeFit,
    free_fit,
    score_test,
)
from runtime.estimators.regression.posterior import APART, orthonormal
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

PEAK, SIGN = 0.15, 0.05
"""Speed v of the peak and width of the sign s, over the root mean square speed of a joint."""
LEAST_S = 0.5e-3
"""Delay [s] below which its bias is within the intervals: at 3 ms, 14 % of those of the worst
parameter hold, and the bias is proportional to the delay."""
USABLE_S = 10e-3
"""Delay [s] up to which masses and torques hold and the intervals alone do not: the torque of the
bundled motions changes by 2 % in that time."""
GAIN_SIGNIFICANCE = 1e-3
"""Probability that a joint is named where all gains agree: of 450 clean logs with white, filtered
and coloured noise one exceeds the quantile. There is no margin: the gain that is named on a log of
a Franka arm, 1.11 of joint 6, reduces the error on rows that were held out, too."""
LEAST = 0.03
"""Deviation of a gain up to which the model is usable: intervals are too narrow, masses hold."""
SCALE = 3.0
"""Factor beyond which, or below its inverse, a deviation is not that of a torque constant."""
NOTICED = 1.645
"""95 % quantile of the normal distribution: a deviation so many σ above the threshold is seen in
95 of 100 logs."""
GROWTH = 1.4
"""Factor by which a deviation at the limit raises its own σ, measured 1.2 to 1.42: the weights
follow the residuals, which contain a part of it."""


@dataclass(frozen=True, slots=True, eq=False)
class GainTest:
    """Result of the test."""

    # statistic, threshold: explained residual over its noise, and the value that it seldom exceeds
    # where all gains agree
    statistic: float
    threshold: float
    joint: int  # index of the joint whose gain alone explains most
    # strongest, joint_threshold: what this gain alone explains over its noise, and the value that
    # the largest of the joints seldom exceeds where all gains agree
    strongest: float
    joint_threshold: float
    gain: float  # its gain relative to the other joints
    sigma: float  # standard deviation of the gain
    # deviation of the gain of every joint alone that 95 of 100 such logs show, (n,); infinite where
    # friction and inertia take up all of it
    limits: Array

    @property
    def is_significant(self) -> bool:
        """Whether the torques of the joints contradict each other, or one joint the others."""
        return self.is_beyond_margin or self.strongest > self.joint_threshold

    @property
    def is_beyond_margin(self) -> bool:
        """Whether they contradict each other by more than errors of the friction model explain."""
        return self.statistic > self.threshold

    @property
    def is_contradicted(self) -> bool:
        """Whether they do by more than `LEAST`, so that the result is doubted."""
        return self.is_beyond_margin and abs(self.gain - 1) > LEAST

    @property
    def is_plausible(self) -> bool:
        """Whether the gain may be that of a wrong torque constant."""
        return 1 / SCALE < self.gain < SCALE


def gain_test(lib: Library, samples: Samples, weights: Array) -> GainTest | None:
    """Test the gains of all joints against each other.

    weights (n,) [1/(N·m)²].
    """
    fit = free_fit(lib, samples, weights)
    return None if fit is None else gain_test_of(fit)


def gain_test_of(fit: FreeFit) -> GainTest | None:
    """Test the gains of all joints against each other."""
    n, count = fit.scale.size, len(fit.samples)
    if n < 2:
        return None
    # Columns of ε: the predicted torque of one joint in its rows, less what β and φ take up.
    diagonal = np.zeros((count, n, n))
    diagonal[:, range(n), range(n)] = fit.predicted.reshape(count, n)
    test = score_test(fit, diagonal.reshape(-1, n))
    if test is None:
        return None
    power = np.maximum(np.sum(test.columns**2, axis=0), 1e-300)
    whole = np.sum(diagonal.reshape(-1, n) ** 2, axis=0)
    sigma = np.sqrt(test.density / power)
    # A column that lies in those of β and φ leaves rounding only.
    seen = power > APART**2 * whole
    deviation = test.columns.T @ fit.rest / power
    joint = int(np.argmax(deviation**2 * power))
    joint_threshold = float(chdtri(1, GAIN_SIGNIFICANCE / n))
    return GainTest(
        statistic=test.statistic,
        threshold=MARGIN * test.quantile,
        joint=joint,
        strongest=float((deviation[joint] / sigma[joint]) ** 2),
        joint_threshold=joint_threshold,
        gain=1 + float(deviation[joint]),
        sigma=float(sigma[joint]),
        limits=np.where(seen, GROWTH * (np.sqrt(joint_threshold) + NOTICED) * sigma, np.inf),
    )


@dataclass(frozen=True, slots=True)
class DelayTest:
    """Result of the test."""

    # statistic, threshold: explained residual over its noise, and the value that it seldom exceeds
    # where the stamps agree
    statistic: float
    threshold: float
    delay: float  # δ, by which the torque is stamped too late [s]
    sigma: float  # standard deviation of δ [s]

    @property
    def is_contradicted(self) -> bool:
        """Whether the torque is late or early by more than `LEAST_S`."""
        return self.statistic > self.threshold and abs(self.delay) > LEAST_S

    @property
    def is_usable(self) -> bool:
        """Whether a result with this delay predicts torques, though its intervals do not hold."""
        return abs(self.delay) <= USABLE_S


def delay_test(fit: FreeFit) -> DelayTest | None:
    """Test the time stamps of the torque."""
    column = delay_column(fit)
    test = None if column is None else score_test(fit, column)
    if test is None:
        return None
    power = float(np.sum(test.columns**2))
    return DelayTest(
        statistic=test.statistic,
        threshold=MARGIN * test.quantile,
        delay=float(test.columns[:, 0] @ fit.rest) / power,
        sigma=float(np.sqrt(test.density / power)),
    )


def delay_column(fit: FreeFit) -> Array | None:
    """Change of the predicted torque by a delay of one second."""
    q, dq, n = fit.samples.q, fit.samples.dq, fit.scale.size
    if len(q) < 3:
        return None
    # Mean of two time steps, 2 h = ⟨q_(i+1) − q_(i−1), dq_i⟩ / ⟨dq_i, dq_i⟩.
    moved, speed = (q[2:] - q[:-2]).ravel(), dq[1:-1].ravel()
    double = float(moved @ speed) / max(float(speed @ speed), 1e-300)
    if not double > 0:
        return None
    rate = np.asarray(np.gradient(fit.predicted.reshape(-1, n), double / 2, axis=0))
    return -rate.reshape(-1, 1)


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
