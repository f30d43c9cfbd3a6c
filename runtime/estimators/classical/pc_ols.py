"""PC-IDIM-OLS: min ‖R [π; φ] − r‖ subject to P_k(π_k) ⪰ 0 for every link (Eq. 3.8).

It is solved by a path of falling weights γ of the prior,

    min over π of  L(π) + γ Σ_k [tr(P0_k⁻¹ P_k) − log det P_k]

The minimiser at weight γ satisfies ∇L = γ Σ_k (P_k⁻¹ − P0_k⁻¹) on P_k, so every consistent π with
Σ tr(P0_k⁻¹ P_k) no larger than the minimiser's has L(π) ≥ L(π_γ) − 4 n_links γ: the certificate.
The path starts where the prior dominates, and each minimiser starts the next. Without the trace
term of the prior the logarithm alone would have no minimiser. No cone solver is needed.

Clarabel checks the optimum in the second-order-cone form on the compressed rows; the quadratic form
loses half the digits. The optimum is the reference for the loss of every other method. In
directions that the motion does not excite it is not unique, and often implausible, so `fit_pc_ols`
stops slightly before it, at the point of the path nearest to the first guess.
Source: Wensing, Kim & Slotine 2018; document Sec. 3.1.4.
"""

from dataclasses import dataclass, replace

import clarabel
import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csc_matrix

from runtime.errors import IdentificationError
from runtime.estimators.classical.least_squares import counted_in_links
from runtime.estimators.convex.entropic_prior import Prior, bodies_of, prior_of
from runtime.estimators.convex.newton import DECREMENT, ConvexProblem, solved_cone, svec, task_of
from runtime.estimators.methods import Method
from runtime.estimators.problem import Bounds, Fit, Problem, bounds_of, notes_of, within_bounds
from runtime.estimators.regression.factor import Elimination, Reduced, Statistics, reduce
from runtime.library import Array, Library
from runtime.library.compiled_descent import CompiledConvex
from runtime.library.parameters import N_PARAMETERS, pi_from_parts

LENGTH = 0.1  # unit of length of scaled unknowns, m: m, m·c/ℓ and I/ℓ² are then of one size
SLACK = 1e-3
"""Relative loss above the optimum admitted for staying near the first guess. The optimum itself is
often implausible: for a poorly excited arm of 16 kg it had links of 1400 kg at 1e-5."""
BOUNDARY = 1e-6  # relative eigenvalue below which a link of the optimum is a plate or a rod
LARGEST_WEIGHT = 4.0  # mean tr(P0⁻¹ P)/4 per link up to which the path certifies; 1 is the prior
FINER, MORE_STEPS = 4.0, 200  # ratio and steps per γ of the second attempt at a path
TIGHT = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-10)  # of Clarabel
SMALLEST_GAP = 1e-7  # certificate at the end of the path, relative to the loss
FIRST, SHRINK = 1e-1, 10.0  # γ at the start in units of the loss, and its ratio from step to step
PATIENCE = 60  # Newton steps per γ; more only where the optimum drifts to implausible bodies
EXPLAINED = 1e-9  # losses below this share of that of τ̂ = 0 count as rounding


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


def follow_compiled(
    lib: Library, data: Reduced, prior: Prior, shrink: float = SHRINK, most_steps: int = PATIENCE
) -> Path:
    """Follow a path by the compiled Newton method."""
    bodies = prior.centre.size // N_PARAMETERS
    gammas = gamma_sequence(data, bodies, shrink)
    task = task_of(ConvexProblem(data, prior, np.ones(bodies)), gammas)
    (a,) = CompiledConvex(lib.binding, [task], DECREMENT, most_steps).run()
    ended, tried = float(a.decrements[-1]), gammas[: len(a.losses)]
    return path_of(prior, tried, a.points, a.losses, ended, int(a.steps.sum()), a.converged)


@dataclass(frozen=True, slots=True, eq=False)
class ConvexOptimum:
    """The smallest loss that any physically consistent model reaches on the data."""

    loss: float  # L at the optimum, (1/N) Σ ½ rᵀWr
    pi: Array  # pi, phi: a point that reaches it, (10 n,) and (n k,)
    phi: Array
    # certificate: L − L* is at most this among models of no larger Σ tr(P0_k⁻¹ P_k); NaN from
    # Clarabel, which stops at 1e-10 of ‖r‖
    gap: float
    status: str  # how it was computed


def convex_optimum(
    lib: Library,
    statistics: Statistics,
    first_guess: Array | None = None,
    bounds: Bounds | None = None,
) -> ConvexOptimum:
    """Smallest loss of any physically consistent model, by the path from a first guess.

    Where the path drifts to implausible bodies its certificate is weak, and Clarabel solves it.
    """
    prior = prior_of(lib, first_guess)

    def solved(part: Statistics) -> tuple[Array, Array, ConvexOptimum]:
        data, eliminated = reduce(part, lib.n_joints)
        best = _best(lib, part, eliminated, follow_compiled(lib, data, prior))
        return best.phi, lib.base_matrix @ best.pi, best

    if bounds is None:
        return solved(statistics)[2]
    phi, best, _ = within_bounds(statistics, bounds, solved)
    return replace(best, phi=phi)


def fit_pc_ols(problem: Problem) -> Fit:
    """Identify by PC-IDIM-OLS: the nearest point to the guess within `SLACK` of the optimum."""
    lib, statistics = problem.lib, problem.statistics()
    names = problem.friction_names
    statistics = statistics.without(counted_in_links(statistics, lib, names))
    guess = lib.pi_from_lam(problem.start)

    def solved(part: Statistics) -> tuple[Array, Array, Fit]:
        fit = _nearest(lib, part, guess)
        return fit.phi, lib.base_matrix @ fit.pi, fit

    bounds = bounds_of(problem, is_passive=True)
    phi, fit, held = within_bounds(statistics, bounds, solved)
    notes = notes_of(held, bounds, lib.joint_names, names)
    return replace(fit, phi=phi.reshape(problem.train.shape), notes=notes)


def _nearest(lib: Library, statistics: Statistics, guess: Array) -> Fit:
    """First point of the path from a guess within `SLACK` of the optimum."""
    (data, eliminated), prior = reduce(statistics, lib.n_joints), prior_of(lib, guess)
    path = follow_compiled(lib, data, prior)
    best = _best(lib, statistics, eliminated, path)
    near = path.nearest(SLACK, best.loss)
    if near is None:
        path = follow_compiled(lib, data, prior, FINER, MORE_STEPS)
        near = path.nearest(SLACK, best.loss)
    pi = path.points[-1] if near is None else near
    how = "stopped before coming within" if near is None else "within"
    edge = lib.relative_eigenvalues(best.pi).min() < BOUNDARY
    status = f"{how} {SLACK:g} of the convex optimum {best.loss:.6g} ({best.status})"
    status += ", which lies on the boundary of consistency" if edge else ""
    return Fit(pi, eliminated.phi(pi), lib.lam_from_pi(pi), status, path.steps, optimum=best.loss)


def _best(
    lib: Library, statistics: Statistics, eliminated: Elimination, path: Path
) -> ConvexOptimum:
    if not path.converged or path.weight > LARGEST_WEIGHT:
        return cone_optimum(lib, statistics)
    pi, how = path.points[-1], f"path of {path.steps} Newton steps"
    return ConvexOptimum(float(path.losses[-1]), pi, eliminated.phi(pi), path.gap, how)


def cone_optimum(lib: Library, statistics: Statistics) -> ConvexOptimum:
    """Convex optimum by Clarabel, min t with ‖R x − r‖ ≤ t and P_k ⪰ 0, also on the boundary.

    Unknowns are those of the links in units of kg and `LENGTH`, friction coefficients in units that
    give their columns the length of those of links, and t in units of ‖r‖.
    """
    n, size = lib.n_links, lib.pi0.size
    factor, target = statistics.over_pi(), statistics.target
    bodies = np.tile(pi_from_parts(1.0, LENGTH, LENGTH**2), n)
    friction = np.linalg.norm(factor[:, size:], axis=0)
    sizes = np.linalg.norm(factor[:, :size] * bodies, axis=0)
    # Of a single joint most columns are 0; of arms the median counts all of them.
    typical = np.median(sizes) or np.median(sizes[sizes > 0])
    scale = np.concatenate([bodies, typical / np.where(friction > 0, friction, typical)])
    unit = max(float(np.linalg.norm(target)), 1e-30)
    residual = np.zeros((1 + len(factor), scale.size + 1))
    residual[0, -1], residual[1:, :-1] = -1.0, -factor * scale / unit
    # svec(P̂_k) = S π̂_k, with S from the kernel P(π) of the library.
    triangles = svec(bodies_of(lib).basis)
    consistency, of_link = np.zeros((2, size, scale.size + 1))
    consistency[:, :size] = -block_diag(*[triangles] * n)
    of_link[:, :size] = block_diag(*[np.ones_like(triangles)] * n)
    # Entries that are zero by chance are stored, too: what is stored decides the last digits.
    matrix, stored = np.vstack([residual, consistency]), np.vstack([residual != 0, of_link > 0])
    places, width = np.nonzero(stored), scale.size + 1
    rows = csc_matrix((matrix[places], places), shape=matrix.shape)
    sides = np.concatenate([[0.0], -target / unit, np.zeros(size)])
    cones = [clarabel.SecondOrderConeT(len(residual)), *[clarabel.PSDTriangleConeT(4)] * n]
    solution = solved_cone(np.eye(width)[-1], rows, sides, cones, **TIGHT, max_iter=200)
    status = str(solution.status)
    if status not in {"Solved", "AlmostSolved"}:
        raise IdentificationError(
            f"Clarabel did not solve the convex problem (status {status}); check the data for "
            "outliers and the units of torque"
        )
    x = np.array(solution.x)[:-1] * scale
    pi, phi = x[:size], x[size:]
    return ConvexOptimum(statistics.value(pi, phi), pi, phi, np.nan, f"Clarabel: {status}")


PC_OLS = Method(
    "pc-ols",
    "convex program with linear matrix inequalities: the optimum (Eq. 3.8)",
    fit_pc_ols,
    label="PC-IDIM-OLS",
    from_statistics=True,
    bounds_friction=True,
)
