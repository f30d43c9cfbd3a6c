"""Payload on an arm that a campaign has identified.

    τ = Y_b (β + T x) + F φ + o + e

x are the ten parameters of the payload, T the columns of K of the last link. The posterior of β and
φ is the prior of the log with the payload, so that the error of the arm counts in σ of the payload.
With G the information of that motion over β, without offsets, and C the covariance of β, the
motion brings Tᵀ (G⁻¹ + C)⁻¹ T for x.
"""

import numpy as np

from runtime.campaign.estimation import PREPARATION, ArmModel
from runtime.campaign.gear_friction import NAMES, prepared_log
from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import samples_of
from runtime.library import Array
from runtime.recording import Recording

PLAUSIBLE = np.array([20.0, *3 * [5.0], *6 * [2.0]])
"""σ of the parameters before the log [kg, kg·m, kg·m²]: for those that no motion determines."""


def payload_of(model: ArmModel, motion: Recording) -> tuple[Array, Array]:
    """Parameters of a payload from one log.

    Returns (10,) [kg, kg·m, kg·m²].
    """
    result, lib = model.result, model.result.lib
    if result.uncertainty is None or result.uncertainty.information is None:
        raise IdentificationError("expected a model with a posterior; identify with map")
    known = result.uncertainty.information
    samples = samples_of(prepared_log(motion, model.gear, PREPARATION), lib)
    count, n = samples.tau.shape
    base = samples.base_rows(lib)
    # Coefficients φ are joint by joint: those that logs share, then the offsets of the old logs.
    shared, k = len(NAMES) - 1, result.phi.shape[1]
    friction = np.zeros((count, n, n, k))
    for j in range(n):
        friction[:, j, j, :shared] = samples.columns[:, j, :shared]
    offsets = np.broadcast_to(np.eye(n), (count, n, n))
    carried = base @ lib.base_matrix[:, -len(PLAUSIBLE) :]
    rows = np.concatenate([base, friction.reshape(count, n, -1), offsets, carried], axis=2)
    rows = (rows * np.sqrt(result.weights)[:, None]).reshape(count * n, -1)
    target = (samples.tau * np.sqrt(result.weights)).ravel()
    more = n + len(PLAUSIBLE)
    earlier = np.pad(known.statistics.factor, ((0, 0), (0, more)))
    scale = np.sqrt(known.density)
    prior = np.zeros((len(PLAUSIBLE), rows.shape[1]))
    prior[:, -len(PLAUSIBLE) :] = np.diag(scale / PLAUSIBLE)
    matrix = np.concatenate([earlier, rows, prior]) / scale
    wanted = np.concatenate([known.statistics.target, target, np.zeros(len(PLAUSIBLE))]) / scale
    lengths = np.linalg.norm(matrix, axis=0)
    unit = matrix / np.where(lengths > 0, lengths, 1.0)
    left, sizes, turn = np.linalg.svd(unit, full_matrices=False)
    present = sizes > 1e-10 * sizes[0]
    root = (turn[present].T / sizes[present]) / np.where(lengths > 0, lengths, 1.0)[:, None]
    x = root @ (left[:, present].T @ wanted)
    last = root[-len(PLAUSIBLE) :]
    return x[-len(PLAUSIBLE) :], last @ last.T
