"""Test of the torque gains of the joints against each other.

    τ_j = (1 + ε_j) (Y_b β + F φ)_j + e_j

The links of an arm load several joints, so that one scale of its torques that is wrong leaves
residuals which no β explains. Columns ε_j are added to the least squares, with the torque of the
free fit as their content; their common factor is not identifiable from the data and drops out.
The explained residual over its noise is χ² with n − 1 degrees of freedom where all gains agree, and
that of the column of one joint alone with one.
Source: Gautier & Briot 2014 for the regression with gains; `score_test` for the test.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from runtime.estimators.regression.samples import Samples
from runtime.estimators.regression.score_test import (
    MARGIN,
    RANK_TOLERANCE,
    FreeFit,
    free_fit,
    score_test,
)
from runtime.library import Array, Library

SIGNIFICANCE = 1e-3
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


class GainTest(NamedTuple):
    """Result of the test.

    Attributes:
        statistic, threshold: explained residual over its noise, and the value that it
            seldom exceeds where all gains agree.
        joint: index of the joint whose gain alone explains most.
        strongest, joint_threshold: what this gain alone explains over its noise, and the
            value that the largest of the joints seldom exceeds where all gains agree.
        gain: its gain relative to the other joints.
        sigma: standard deviation of the gain.
        limits: deviation of the gain of every joint alone that 95 of 100 such logs show, (n,);
            infinite where friction and inertia take up all of it.
    """

    statistic: float
    threshold: float
    joint: int
    strongest: float
    joint_threshold: float
    gain: float
    sigma: float
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
    seen = power > RANK_TOLERANCE**2 * whole
    deviation = test.columns.T @ fit.rest / power
    joint = int(np.argmax(deviation**2 * power))
    joint_threshold = float(chdtri(1, SIGNIFICANCE / n))
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
