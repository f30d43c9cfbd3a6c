"""Test of the torque gains of the joints against each other.

    τ_j = (1 + ε_j) (Y_b β + F φ)_j + e_j

The links of an arm load several joints, so that one scale of its torques that is wrong leaves
residuals which no β explains. Columns ε_j are added to the least squares, with the torque of the
free fit as their content; their common factor is not identifiable from the data and drops out.
The explained residual over its noise is χ² with n − 1 degrees of freedom where all gains agree.
Source: Gautier & Briot 2014 for the regression with gains; Breusch & Pagan 1980 for score tests.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from runtime.estimators.regression.coloured_noise import coloured_noise_of_basis
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

SIGNIFICANCE = 1e-4
"""Probability of an alarm where all gains agree, as in the test of the prior."""
MARGIN = 1.6
"""Factor on the quantile for errors of the friction model, as in the test of the prior: 1.3 to 1.5
on a log of a Franka arm; a gain that is 10 % off gives three times and more."""
LEAST = 0.03
"""Deviation of a gain below which a friction model that misses a little explains it as well."""
ROWS = 1500
"""Samples that determine a gain to a percent or better."""
RANK_TOLERANCE = 1e-6
"""Singular value, relative to the largest, below which a direction is absent. The common factor is
absent up to rounding × condition of the fit."""


@dataclass(frozen=True, slots=True)
class GainTest:
    """Result of the test.

    Attributes:
        statistic, threshold: explained residual over its noise, and the value that it
            seldom exceeds where all gains agree.
        joint: index of the joint whose gain alone explains most.
        gain: its gain relative to the other joints.
        sigma: standard deviation of the gain.
    """

    statistic: float
    threshold: float
    joint: int
    gain: float
    sigma: float

    @property
    def is_contradicted(self) -> bool:
        """Whether the torques of the joints contradict each other by more than `LEAST`."""
        return self.statistic > self.threshold and abs(self.gain - 1) > LEAST


def gain_test(lib: Library, samples: Samples, weights: Array) -> GainTest | None:
    """Test the gains of all joints against each other.

    Args:
        lib: library of the robot.
        samples: training samples, of which about `ROWS` evenly spread ones are used.
        weights: diagonal of W, (n,) [1/(N·m)²].

    Returns:
        The test; None for rows of power, for one joint, and for data without residual.
    """
    n = samples.equations
    if n < max(2, lib.n_joints):
        return None
    # Evenly spread rows: S is estimated from their residuals, correlated or not.
    s = samples.rows(slice(None, None, max(1, len(samples) // ROWS)))
    scale = np.sqrt(weights)
    rows = np.concatenate([s.base_rows(lib), s.friction_rows()], axis=2) * scale[:, None]
    count, _, unknowns = rows.shape
    flat, target = rows.reshape(-1, unknowns), (s.tau * scale).ravel()
    basis = _orthonormal(flat / _lengths(flat))
    predicted = basis @ (basis.T @ target)
    rest = target - predicted
    if np.linalg.norm(rest) <= RANK_TOLERANCE * np.linalg.norm(target):
        return None
    # Columns of ε: the predicted torque of one joint in its rows, less what β and φ take up.
    diagonal = np.zeros((count, n, n))
    diagonal[:, range(n), range(n)] = predicted.reshape(count, n)
    columns = diagonal.reshape(-1, n) - basis @ (basis.T @ diagonal.reshape(-1, n))
    gains = _orthonormal(columns)
    explained = gains.T @ rest
    left = rest - gains @ explained
    whole = np.concatenate([basis, gains], axis=1).reshape(count, n, -1)
    density = coloured_noise_of_basis([(whole, left.reshape(count, n))], 1).density
    if not density > 0 or not gains.shape[1]:
        return None
    power = np.maximum(np.sum(columns**2, axis=0), 1e-300)
    deviation = columns.T @ rest / power
    joint = int(np.argmax(deviation**2 * power))
    return GainTest(
        statistic=float(explained @ explained) / density,
        threshold=MARGIN * float(chdtri(gains.shape[1], SIGNIFICANCE)),
        joint=joint,
        gain=1 + float(deviation[joint]),
        sigma=float(np.sqrt(density / power[joint])),
    )


def _lengths(columns: Array) -> Array:
    lengths = np.linalg.norm(columns, axis=0)
    return np.where(lengths > 0, lengths, 1.0)


def _orthonormal(columns: Array) -> Array:
    """Orthonormal basis of the columns, without absent directions."""
    q, upper = np.linalg.qr(columns)
    space, sizes, _ = np.linalg.svd(upper)
    present = sizes > RANK_TOLERANCE * max(float(sizes.max(initial=0.0)), 1e-300)
    return np.asarray(q @ space[:, : len(sizes)][:, present])
