"""PC-IDIM-OLS by a path of falling γ: min ‖A π − b‖² subject to P_k ⪰ 0 (Eq. 3.8).

At weight γ the minimiser satisfies ∇L = γ Σ_k (P_k⁻¹ − P0_k⁻¹) on P_k, so every consistent π with
Σ tr(P0_k⁻¹ P_k) no larger than the minimiser's has L(π) ≥ L(π_γ) − 4 n_links γ: the certificate.
The path starts where the prior dominates, and each minimiser starts the next. Without the trace
term of the prior the logarithm alone would have no minimiser. No cone solver is needed. `compiled`
follows the path.
"""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.convex.eliminate_friction import Reduced
from runtime.estimators.convex.entropic_prior import Prior
from runtime.library import Array
from runtime.library.parameters import N_PARAMETERS

SMALLEST_GAP = 1e-7
"""Certificate at the end of the path, relative to the loss."""
FIRST, SHRINK = 1e-1, 10.0
"""γ at the start in units of the loss, and its ratio from step to step."""
PATIENCE = 60
"""Newton steps per γ: more are needed only where the optimum drifts to implausible bodies."""
EXPLAINED = 1e-9
"""Losses below this share of that of τ̂ = 0 count as rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Minimisers at falling weights γ, towards the optimum of all consistent models."""

    gammas: Array  # weights, falling
    points: Array  # the minimisers π, one row each
    losses: Array  # L at them
    gap: float  # 4 n_links γ at the end plus the Newton decrement: L − L* is no larger
    weight: float  # Σ tr(P0_k⁻¹ P_k) / 4 n at the end: 1 at the prior, large for implausible bodies
    steps: int  # total number of Newton steps
    converged: bool  # whether the minimisation converged at every γ

    def nearest(self, slack: float, optimum: float | None = None) -> Array | None:
        """First point, so the nearest to the prior, within a relative slack of an optimum."""
        bar = float(self.losses[-1]) if optimum is None else optimum
        good = np.flatnonzero(self.losses <= (1 + slack) * bar)
        return np.array(self.points[good[0]]) if good.size else None


def gamma_sequence(data: Reduced, bodies: int, shrink: float = SHRINK) -> Array:
    """Falling weights γ, from `FIRST` of the unexplained loss down to a gap of `SMALLEST_GAP`."""
    # The unexplained loss sets the unit; where it is rounding, a share of the loss of τ̂ = 0 does.
    zero_torque = data.value(np.zeros(data.factor.shape[1]))
    unit = max(data.rest / (2 * data.count), EXPLAINED * zero_torque, 1e-300)
    # Certificate: the gap at the end is 4 n γ.
    last = SMALLEST_GAP * unit / (4 * bodies)
    count = int(np.ceil(np.log(FIRST * unit / last) / np.log(shrink))) + 1
    return np.geomspace(FIRST * unit, last, count)


def path_of(
    prior: Prior,
    gammas: Array,
    points: Array,
    losses: Array,
    decrement: float,
    steps: int,
    converged: bool,
) -> Path:
    """Path of given minimisers, with its certificate."""
    degree = 4 * (points.shape[1] // N_PARAMETERS)
    gap = degree * float(gammas[-1]) + decrement
    weight = float(prior.slope @ points[-1]) / degree
    return Path(gammas, points, losses, gap, weight, steps, converged)
