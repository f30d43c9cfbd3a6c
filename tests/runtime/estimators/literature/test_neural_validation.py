"""The nets of friction are chosen on rows that they were not trained on."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.estimators.literature.neural import fit_neural
from runtime.estimators.problem import Problem
from runtime.estimators.regression.samples import Samples, thesis_weights
from runtime.library import Library


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_pattern_that_validation_contradicts_is_not_learned(lib: Library, sign: float) -> None:
    """Property: friction 0.5 cos(3 dq) in training, ± the same in validation.

    With the plus sign a net is kept for every joint; with the minus sign any net that follows the
    training rows doubles the error of the validation rows, so that none is.
    """
    rng = np.random.default_rng(1)

    def samples(amplitude: float) -> Samples:
        q, dq, ddq = rng.normal(size=(3, 400, 7))
        tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + 0.4 * dq
        tau += amplitude * np.cos(3 * dq) + 0.02 * rng.normal(size=dq.shape)
        return Samples(q, dq, ddq, tau, dq[:, :, None])

    train, validation = samples(0.5), samples(sign * 0.5)
    problem = Problem(lib, train, validation, thesis_weights(train.tau), lib.lam0)
    fit = fit_neural(problem)
    assert fit.learned is not None
    learned = np.any(fit.learned.theta, axis=1)
    if sign > 0:
        assert learned.all()
    else:
        assert not learned.any()
        assert fit.notes == ("linear friction predicts the validation data best: no net is kept",)
        poisoned = replace(validation, tau=validation.tau + 1.0)
        assert fit_neural(replace(problem, validation=poisoned)).learned is not None
