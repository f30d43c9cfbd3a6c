"""PC-IDIM-OLS by following γ down: min ‖A π − b‖² subject to P_k ⪰ 0 (Eq. 3.8), no cone solver.

At weight γ the minimiser satisfies ∇L = γ Σ_k (P_k⁻¹ − P0_k⁻¹) on P_k, so every consistent π with
Σ tr(P0_k⁻¹ P_k) no larger than the minimiser's has L(π) ≥ L(π_γ) − 4 n_links γ: the certificate.
The path starts where the prior rules and each answer starts the next. Without the prior's trace
the logarithm alone would have no minimiser.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from runtime.estimators.convex.eliminate_friction import Reduced
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.convex.newton import ConvexProblem, Minimum, convex_problem, minimise
from runtime.library import Array
from runtime.library.parameters import N_PARAMETERS

SMALLEST_GAP = 1e-7
"""Certificate at the end of the path, relative to the loss."""
FIRST, SHRINK = 1e-1, 10.0
"""γ at the start in units of the loss, and its ratio from step to step."""
PATIENCE = 60
"""Newton steps per γ: more are needed only where the optimum drifts off to absurd bodies."""
EXPLAINED = 1e-9
"""Losses below this share of that of τ̂ = 0 count as rounding."""


@dataclass(frozen=True, slots=True)
class Path:
    """The way to the optimum of all consistent models.

    Attributes:
        gammas: weights, falling.
        points: the minimisers π, one row each.
        losses: L at them.
        gap: 4 n_links γ at the end plus the Newton decrement: L − L* is no larger.
        weight: Σ tr(P0_k⁻¹ P_k) / 4 n at the end: 1 at the prior, large for absurd bodies.
        steps: Newton steps in all.
        converged: at every γ.
    """

    gammas: Array
    points: Array
    losses: Array
    gap: float
    weight: float
    steps: int
    converged: bool

    def nearest(self, slack: float, optimum: float | None = None) -> Array | None:
        """The first point, so the nearest to the prior, within a relative `slack` of an optimum.

        By default that is the path's own end; None where no point comes so near.
        """
        bar = float(self.losses[-1]) if optimum is None else optimum
        good = np.flatnonzero(self.losses <= (1 + slack) * bar)
        return np.array(self.points[good[0]]) if good.size else None


def gamma_sequence(data: Reduced, bodies: int, shrink: float = SHRINK) -> Array:
    """Falling weights, from the loss that no model explains down to `SMALLEST_GAP` of it."""
    silent = data.value(np.zeros(data.factor.shape[1]))
    unit = max(data.rest / (2 * data.count), EXPLAINED * silent, 1e-300)
    last = SMALLEST_GAP * unit / (4 * bodies)
    count = int(np.ceil(np.log(FIRST * unit / last) / np.log(shrink))) + 1
    return np.geomspace(FIRST * unit, last, count)


def follow(
    data: Reduced, prior: Prior, gammas: Array | None = None, most_steps: int = PATIENCE
) -> Path:
    """Minimise at every γ, warm started, up to the first that takes too many steps.

    Args:
        data: least squares over π.
        prior: its centre starts the path.
        gammas: default is `gamma_sequence`.
        most_steps: per γ.
    """
    ladder = (
        gamma_sequence(data, prior.centre.size // N_PARAMETERS)
        if gammas is None
        else np.asarray(gammas, dtype=float)
    )
    found = list(_descent((convex_problem(data, prior, float(g)) for g in ladder), most_steps))
    ladder, ended = ladder[: len(found)], len(found) == len(ladder)
    points, losses = np.array([m.pi for m in found]), np.array([m.loss for m in found])
    steps, converged = sum(m.steps for m in found), ended and found[-1].converged
    return path_of(prior, ladder, points, losses, found[-1].decrement, steps, converged)


def path_of(
    prior: Prior,
    gammas: Array,
    points: Array,
    losses: Array,
    decrement: float,
    steps: int,
    converged: bool,
) -> Path:
    """A path with its certificate."""
    degree = 4 * (points.shape[1] // N_PARAMETERS)
    gap = degree * float(gammas[-1]) + decrement
    weight = float(prior.slope @ points[-1]) / degree
    return Path(gammas, points, losses, gap, weight, steps, converged)


def _descent(problems: Iterator[ConvexProblem], most_steps: int) -> Iterator[Minimum]:
    start = None
    for problem in problems:
        found = minimise(problem, start, most_steps)
        start = found.pi
        yield found
        if not found.converged:
            return
