"""The convex estimators: maximum a posteriori with an entropic prior, and its limit PC-IDIM-OLS.

    min over π of (‖A π − b‖² + ρ)/2N + Σ_k γ_k [tr(P0_k⁻¹ P_k) − log det P_k]

Every minimiser is strictly consistent, P_k ≻ 0. Source: Lee, Wensing & Park 2019 (prior);
Wensing, Kim & Slotine 2018 (P ⪰ 0); document Sec. 3.1.4.
"""

from runtime.estimators.convex.compiled import follow_compiled, follow_many, solve, solve_many
from runtime.estimators.convex.eliminate_friction import Elimination, Reduced, reduce, reduced_of
from runtime.estimators.convex.entropic_prior import (
    CAD,
    GRIPPER,
    NONE,
    Bodies,
    Prior,
    bodies_of,
    com_sigma,
    prior_from,
    prior_of,
    spread_of,
)
from runtime.estimators.convex.newton import (
    ConvexProblem,
    HalfSpaces,
    Minimum,
    Subspace,
    convex_problem,
    minimise,
    minimise_anywhere,
)
from runtime.estimators.convex.path import Path, follow

__all__ = [
    "CAD",
    "GRIPPER",
    "NONE",
    "Bodies",
    "ConvexProblem",
    "Elimination",
    "HalfSpaces",
    "Minimum",
    "Path",
    "Prior",
    "Reduced",
    "Subspace",
    "bodies_of",
    "com_sigma",
    "convex_problem",
    "follow",
    "follow_compiled",
    "follow_many",
    "minimise",
    "minimise_anywhere",
    "prior_from",
    "prior_of",
    "reduce",
    "reduced_of",
    "solve",
    "solve_many",
    "spread_of",
]
