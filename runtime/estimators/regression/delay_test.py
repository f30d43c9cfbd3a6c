"""Test of the time stamps of the torque against those of the motion.

    τ(t) = (Y_b β + F φ)(t − δ) + e ≈ Y_b β + F φ − δ d/dt (Y_b β + F φ) + e

One delay δ for all joints is a column of the least squares, with the derivative of the predicted
torque along the log as its content. The fit takes up most of a delay of some milliseconds as a bias
of its parameters, and `score_test` finds the rest. The time step comes from positions and
velocities of the samples.
"""

from typing import NamedTuple

import numpy as np

from runtime.estimators.regression.score_test import MARGIN, FreeFit, score_test
from runtime.library import Array

LEAST_S = 0.5e-3
"""Delay [s] below which its bias is within the intervals: at 3 ms, 14 % of those of the worst
parameter hold, and the bias is proportional to the delay."""

USABLE_S = 10e-3
"""Delay [s] up to which masses and torques hold and the intervals alone do not: the torque of the
bundled motions changes by 2 % in that time."""


class DelayTest(NamedTuple):
    """Result of the test.

    Attributes:
        statistic, threshold: explained residual over its noise, and the value that it
            seldom exceeds where the stamps agree.
        delay: δ, by which the torque is stamped too late [s].
        sigma: standard deviation of δ [s].
    """

    statistic: float
    threshold: float
    delay: float
    sigma: float

    @property
    def is_contradicted(self) -> bool:
        """Whether the torque is late or early by more than `LEAST_S`."""
        return self.statistic > self.threshold and abs(self.delay) > LEAST_S

    @property
    def is_usable(self) -> bool:
        """Whether a result with this delay predicts torques, though its intervals do not hold."""
        return abs(self.delay) <= USABLE_S


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
