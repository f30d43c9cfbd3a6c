"""Friction by linear columns and a small net of them, in turn with the rigid body.

Twice: the net is trained on τ − Y π − F φ; then π and φ are estimated from τ − net, physically
consistent each time.
Source: the idea of Hu, Xiong et al.; inputs dq, tanh(dq/ε) and the Dahl state.
"""

from dataclasses import replace

import numpy as np

from runtime.errors import NeedsError
from runtime.estimators.classical.wls import with_torque
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.friction_net import FrictionNet, train
from runtime.estimators.method import Method
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.samples import Samples
from runtime.library import Array

ROUNDS = 2
"""Rounds of training the nets and estimating π and φ."""
INPUTS = ("viscous", "coulomb", "dahl")
"""Friction columns that are the inputs of the nets by default."""


def fit_neural(problem: Problem) -> Fit:
    """Identify π and φ by the most probable consistent model, and the rest of friction by nets."""
    if not problem.train.columns.shape[2]:
        raise NeedsError(
            "the method nn needs friction columns as inputs of its nets, got none; name some, for "
            f"example --friction {','.join(INPUTS)}"
        )
    unseen, data = problem.validation, problem.train
    fit = fit_map(problem)
    for round_ in range(ROUNDS):
        rng = np.random.default_rng([problem.seed, round_])
        net = train(
            data.columns,
            _rest(problem, data, fit),
            unseen.columns,
            _rest(problem, unseen, fit),
            rng,
        )
        without = with_torque(data, data.tau - net.torque(data.columns))
        fit = fit_map(replace(problem, train=without))
    learned = int(np.sum(np.any(net.theta, axis=1)))
    error = _error(problem, unseen, fit, net)
    status = (
        f"{ROUNDS} rounds; nets for {learned} of {problem.lib.n_joints} joints, which leave "
        f"{error:.3g} N·m of the validation torque"
    )
    notes = (
        () if learned else ("linear friction predicts the validation data best: no net is kept",)
    )
    return replace(fit, status=status, iterations=ROUNDS, optimum=None, net=net, notes=notes)


def _rest(problem: Problem, samples: Samples, fit: Fit) -> Array:
    """Residual τ − Y π − F φ, (N, n)."""
    rigid = samples.rigid(problem.lib, fit.pi)
    return samples.tau - rigid - samples.friction(fit.phi)


def _error(problem: Problem, samples: Samples, fit: Fit, net: FrictionNet) -> float:
    """RMS of the torque that model and nets leave, N·m."""
    rest = _rest(problem, samples, fit) - net.torque(samples.columns)
    return float(np.sqrt(np.mean(rest**2)))


NEURAL = Method(
    "nn",
    "consistent, with a small net per joint for the friction that linear columns leave over",
    fit_neural,
    label="neural",
    default_columns=INPUTS,
    uses_validation=True,
    when_recommended="the log contains friction that linear columns do not describe; try "
    "--friction auto, too",
)
