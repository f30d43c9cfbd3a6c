"""Many fits by numpy to Pinocchio's regressor: what a predicted variance is held against."""

import numpy as np
import pinocchio
from scipy.stats import chi2

from runtime import to_pinocchio_order
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.recording import Friction
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.settings import JointMotion
from tests.oracle import pinocchio_model

TRIALS = 200

SIGMA = np.array([0.05, 0.05, 0.08, 0.05, 0.02, 0.05, 0.01])
"""Noise of the torques, N·m."""
T = np.arange(1001) / 100


def pinocchio_rows(lib: Library, trajectory: Trajectory, t: np.ndarray) -> np.ndarray:
    """All 10 n columns at each time, in our order, (N, n, 10 n)."""
    model = pinocchio_model(lib.urdf())
    data = model.createData()
    ours = list(to_pinocchio_order(np.arange(lib.pi0.size)).astype(int))
    back = [ours.index(column) for column in range(lib.pi0.size)]
    states = zip(*trajectory.at(lib, t)[:3], strict=True)
    rows = [pinocchio.computeJointTorqueRegressor(model, data, *s)[:, back] for s in states]
    return np.array(rows)


def with_friction(rows: np.ndarray, dq: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """[Y F] with every joint's friction columns on its rows only, (N n, k)."""
    columns = friction_columns(JointMotion(dq), Friction(names))
    count, n, k = columns.shape
    blocks = np.zeros((count, n, n, k))
    for j in range(n):
        blocks[:, j, j] = columns[:, j]
    return np.concatenate([rows, blocks.reshape(count, n, -1)], axis=2).reshape(count * n, -1)


def errors(rows: np.ndarray, sigma: np.ndarray, seed: int) -> np.ndarray:
    """Estimate minus truth of least squares weighted by 1/σ over trials, (TRIALS, k)."""
    noise = np.random.default_rng(seed).normal(size=(len(rows), TRIALS))
    scale = np.tile(sigma, len(rows) // len(sigma))
    # With the rows and the noise over σ the noise has variance one.
    return np.linalg.lstsq(rows / scale[:, None], noise, rcond=None)[0].T


def assert_variance(sample: np.ndarray, expected: float, freedom: float) -> None:
    """Σ e² over trials / expected is χ² of `freedom` per trial: within its 1e-6 quantiles.

    200 trials of one number leave ± 50 %, of 64 numbers ± 6 %; 0.3 % more because the prediction
    takes the mean of both ends' samples for one of 1000, and the log has 1001.
    """
    low, high = chi2.ppf([1e-6, 1 - 1e-6], TRIALS * freedom) / (TRIALS * freedom)
    ratio = float(np.mean(sample) / expected)
    assert low * 0.997 <= ratio <= high * 1.003, (low, ratio, high)
