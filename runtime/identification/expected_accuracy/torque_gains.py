"""Error of a model by wrong gains of the torque sensors, of which residuals show little.

    τ̂_j = (1 + g_j) τ_j  ⇒  δπ = Σ_j s_j g_j,   s_j = C A_jᵀA_j π / u

A_j are the weighted rows of joint j without their part along its friction columns, C is the
posterior covariance by the rows of all joints. Gains that are equal scale the model, Σ_j s_j ≈ π,
and leave no residual: heavier links need that torque. The model then predicts the torque that the
sensors would measure, which differs from that of the joints by the gains.
"""

import numpy as np

from runtime.estimators.convex import reduce, spread_of
from runtime.identification.expected_accuracy.expected import Knowledge
from runtime.identification.expected_accuracy.planned_samples import MotionSamples
from runtime.library import Array, Library


def gain_slopes(
    lib: Library, moved: MotionSamples, sigma: Array, known: Knowledge, unit: float = 1.0
) -> Array:
    """Change of the estimated parameters per relative error of each torque gain.

    Earlier logs are taken to change in the same way: the sensors are the same.

    Args:
        lib: library of the robot.
        moved: samples of the motion, with one equation per joint.
        sigma: noise of the torque, (n,) N·m or N.
        known: prior, and the parameters of the links.
        unit: u, the variance of a weighted row with its inflation.

    Returns:
        s, (10 n, n) SI.
    """
    n = lib.n_joints
    alone = [reduce(moved.statistics(lib, sigma, only=j), n)[0].factor for j in range(n)]
    root = spread_of(
        known.prior.bodies, known.pi, np.vstack(alone) / np.sqrt(unit), known.kappa
    ).root
    pulls = np.column_stack([rows.T @ (rows @ known.pi) for rows in alone]) / unit
    return np.asarray(root @ (root.T @ pulls))


def torque_of_gains(lib: Library, slopes: Array, gain_error: float, unseen: Array) -> Array:
    """RMS error of the torque of other motions by the gains.

    Args:
        lib: library of the robot.
        slopes: of `gain_slopes`, (10 n, n).
        gain_error: standard deviation of the gain of every joint, relative to one.
        unseen: (n, n_b, n_b) mean of Y_bᵀ Y_b per joint over these motions, of
            `runtime.excitation.search.unseen_motions.unseen_joints`.

    Returns:
        (n,) N·m or N.
    """
    change = gain_error * (lib.base_matrix @ slopes)
    return np.sqrt([np.sum(change * (joint @ change)) for joint in unseen])
