"""λ-Adam without link 7 (Fig. 5.4): its λ is constant, the weight of joint 7 is zero.

The document omits "the gradient-based update associated with link 7" and does not state its initial
value. Here link 7 has its true parameters, as Table 5.9 suggests (errata).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.descent.adam import Preset
from runtime.estimators.descent.fit import fit_of, start_of
from runtime.estimators.optimizers import Adam, descend_validated
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.torque_objective import TorqueObjective
from runtime.library import Array, Library

LINK = 6
"""Index of link 7, from 0."""


def link_rows(lib: Library) -> NDArray[np.bool_]:
    """Mask (10 n,) of the entries of λ that belong to link 7."""
    return np.arange(lib.lam0.size) // (lib.lam0.size // lib.n_links) == LINK


def fit_frozen(problem: Problem, truth: Array, preset: Preset, places: list[Array]) -> Fit:
    """Fit by the descent in NumPy, because the compiled one updates every link."""
    lib, batch = problem.lib, preset.batch or len(problem.train)
    frozen = link_rows(lib)
    weights = np.where(np.arange(lib.n_joints) == LINK, 0.0, problem.weights)
    start = np.where(frozen, truth, problem.start)
    descent = start_of(replace(problem, weights=weights, start=start))
    # Friction coefficients follow λ in x and are never frozen.
    fixed = np.concatenate([frozen, np.zeros(descent.x0.size - frozen.size, dtype=bool)])
    objective, size = descent.objective, len(problem.train)
    held = TorqueObjective(lib, problem.validation, weights, objective.unit)
    rng = np.random.default_rng(problem.seed)

    def value_gradient(x: Array) -> tuple[float, Array]:
        places.append(x)
        loss, slope = objective.value_gradient(x, rng.integers(0, size, batch))
        return loss, np.where(fixed, 0.0, slope)

    outcome = descend_validated(
        Adam(value_gradient, preset.adam), descent.x0, held.value, preset.rule
    )
    return fit_of(descent, outcome)
