"""A descent: problem, compressed samples, and a start; the same for every optimiser."""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.optimizers import Status
from runtime.estimators.problem import Problem
from runtime.estimators.regression import Statistics
from runtime.estimators.regression.torque_objective import TorqueObjective
from runtime.library import Array, LeastSquares
from runtime.library.compiled_descent import CONVERGED, DIVERGED, PATIENCE, STALLED

STATUS = {
    0: Status.MAX_ITERATIONS,
    PATIENCE: Status.PATIENCE,
    DIVERGED: Status.DIVERGED,
    CONVERGED: Status.CONVERGED,
    STALLED: Status.STALLED,
}
"""Why a compiled loop ended: number of the C code → status."""


@dataclass(frozen=True, slots=True)
class Descent:
    """Problem with its objective, its compressed training and validation samples, and a start.

    x0 = [λ, ψ], or [θ, ψ] with log-Cholesky coordinates θ where `cholesky` is set. `unit` is the
    unit of mass of the problem, kg.
    """

    problem: Problem
    objective: TorqueObjective
    statistics: Statistics
    validation: Statistics
    x0: Array
    cholesky: bool = False
    unit: float = 1.0

    def bodies(self, x: Array) -> Array:
        """π (10 n,) at x."""
        lib, bodies = self.problem.lib, x[: self.objective.n_lam]
        return lib.pi_from_cholesky(bodies) if self.cholesky else lib.pi_from_lam(bodies)

    def validation_loss(self, x: Array) -> float:
        """Loss of the validation samples at x."""
        return self.validation.value(self.bodies(x), self.objective.split(x)[1])


def descent_of(
    problem: Problem,
    objective: TorqueObjective,
    x0: Array,
    cholesky: bool = False,
    unit: float = 1.0,
) -> Descent:
    """Descent from x0 with the compressed samples that it needs."""
    train, validation = problem.statistics(), problem.validation_statistics()
    return Descent(problem, objective, train, validation, x0, cholesky, unit)


def least_squares(statistics: Statistics, unit: Array) -> LeastSquares:
    """Mean loss in y = [β; ψ] with a triangular factor."""
    scale = 1 / (2 * statistics.n_samples)
    if not unit.size:  # the factor over β alone is triangular already
        return LeastSquares(statistics.factor, statistics.target, statistics.rest, scale)
    columns = statistics.factor.copy()
    columns[:, statistics.n_base :] *= unit.ravel()
    width = len(statistics.target)
    rows = np.column_stack([columns, statistics.target])
    triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    return LeastSquares(triangle[:, :width], triangle[:, width], statistics.rest, scale)
