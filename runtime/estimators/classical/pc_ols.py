"""PC-IDIM-OLS: min ‖R [π; φ] − r‖ subject to P_k(π_k) ⪰ 0 for every link (Eq. 3.8).

It is solved by the path of `convex`, and checked by Clarabel in the second-order-cone form on the
compressed rows; the quadratic form loses half the digits. The convex optimum is the reference for
the loss of every other method. In directions that the motion does not excite it is not unique, and
often implausible, so `fit_pc_ols` stops slightly before it, at the point of the path nearest to the
first guess.
Source: Wensing, Kim & Slotine 2018; document Sec. 3.1.4.
"""

from dataclasses import dataclass, replace

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.sparse import csc_matrix

from runtime.errors import IdentificationError
from runtime.estimators.classical.least_squares import counted_in_links
from runtime.estimators.convex.compiled import PATIENCE, SHRINK, Path, follow_compiled
from runtime.estimators.convex.entropic_prior import prior_of
from runtime.estimators.friction_bounds import Bounds, bounds_of, notes_of, within_bounds
from runtime.estimators.methods import Method
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.factor import Statistics, reduce
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, pi_from_parts

__all__ = ["fit_pc_ols"]

LENGTH = 0.1
"""Unit of length of the scaled unknowns, m: a link's m, m·c/ℓ and I/ℓ² are then of one size."""
SLACK = 1e-3
"""Relative loss above the optimum admitted for staying near the first guess. The optimum itself is
often implausible: for a poorly excited arm of 16 kg it had links of 1400 kg at 1e-5."""
BOUNDARY = 1e-6
"""Relative eigenvalue below which a link of the optimum is a plate or a rod."""
LARGEST_WEIGHT = 4.0
"""Mean tr(P0⁻¹ P)/4 per link up to which the path certifies the optimum; 1 is the prior."""
FINER, MORE_STEPS = 4.0, 200
"""Ratio and steps per γ of the second attempt at a path."""
_SVEC = tuple((i, j) for j in range(4) for i in range(j + 1))


@dataclass(frozen=True, slots=True, eq=False)
class ConvexOptimum:
    """The smallest loss that any physically consistent model reaches on the data."""

    loss: float  # L at the optimum, (1/N) Σ ½ rᵀWr
    pi: Array  # pi, phi: a point that reaches it, (10 n,) and (n, k)
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

    Where the path drifts to implausible bodies its certificate is weak, and Clarabel solves the
    problem instead.

    first_guess (10 n,) [kg, kg·m, kg·m²].
    """

    def solved(part: Statistics) -> tuple[Array, Array, ConvexOptimum]:
        best = _best(lib, part, _followed(lib, part, first_guess))
        return best.phi.ravel(), lib.base_matrix @ best.pi, best

    if bounds is None:
        return solved(statistics)[2]
    phi, best, _ = within_bounds(statistics, bounds, solved)
    return replace(best, phi=phi.reshape(best.phi.shape))


def fit_pc_ols(problem: Problem) -> Fit:
    """Identify by PC-IDIM-OLS: the nearest point to the guess within `SLACK` of the optimum."""
    lib, statistics = problem.lib, problem.statistics()
    names = problem.friction_names
    statistics = statistics.without(counted_in_links(statistics, lib, names))
    guess = lib.pi_from_lam(problem.start)

    def solved(part: Statistics) -> tuple[Array, Array, Fit]:
        fit = _nearest(lib, part, guess)
        return fit.phi.ravel(), lib.base_matrix @ fit.pi, fit

    bounds = bounds_of(problem, is_passive=True)
    phi, fit, held = within_bounds(statistics, bounds, solved)
    notes = notes_of(held, bounds, lib.joint_names, names)
    return replace(fit, phi=phi.reshape(problem.train.columns.shape[1:]), notes=notes)


def _nearest(lib: Library, statistics: Statistics, guess: Array) -> Fit:
    """First point of the path from a guess within `SLACK` of the optimum."""
    path = _followed(lib, statistics, guess)
    best = _best(lib, statistics, path)
    near = path.nearest(SLACK, best.loss)
    if near is None:
        path = _followed(lib, statistics, guess, FINER, MORE_STEPS)
        near = path.nearest(SLACK, best.loss)
    pi = path.points[-1] if near is None else near
    how = "stopped before coming within" if near is None else "within"
    _, eliminated = reduce(statistics, lib.n_joints)
    edge = lib.relative_eigenvalues(best.pi).min() < BOUNDARY
    return Fit(
        pi=pi,
        phi=eliminated.phi(pi).reshape(lib.n_joints, -1),
        lam=lib.lam_from_pi(pi),
        status=(
            f"{how} {SLACK:g} of the convex optimum {best.loss:.6g} ({best.status})"
            + (", which lies on the boundary of consistency" if edge else "")
        ),
        iterations=path.steps,
        optimum=best.loss,
    )


def _followed(
    lib: Library,
    statistics: Statistics,
    guess: Array | None,
    shrink: float = SHRINK,
    most_steps: int = PATIENCE,
) -> Path:
    data, _ = reduce(statistics, lib.n_joints)
    return follow_compiled(lib, data, prior_of(lib, guess), shrink, most_steps)


def _best(lib: Library, statistics: Statistics, path: Path) -> ConvexOptimum:
    pi, loss = path.points[-1], float(path.losses[-1])
    if not path.converged or path.weight > LARGEST_WEIGHT:
        return cone_optimum(lib, statistics)
    _, eliminated = reduce(statistics, lib.n_joints)
    phi = eliminated.phi(pi).reshape(lib.n_joints, -1)
    return ConvexOptimum(loss, pi, phi, path.gap, f"path of {path.steps} Newton steps")


def cone_optimum(lib: Library, statistics: Statistics) -> ConvexOptimum:
    """Convex optimum by Clarabel, min t with ‖R x − r‖ ≤ t and P_k ⪰ 0, also on the boundary."""
    cones = _Cones(lib, statistics)
    size = cones.width
    cost = np.zeros(size + 1)
    cost[-1] = 1.0
    x, status = _solve(cost, [cones.residual_cone(), cones.consistency(extra=1)])
    pi, phi = cones.unscaled(x[:size])
    return ConvexOptimum(statistics.value(pi, phi), pi, phi, np.nan, f"Clarabel: {status}")


class _Cones:
    """Cones of the problem in scaled unknowns x = [π̂; φ], π̂ in units of kg and `LENGTH`."""

    def __init__(self, lib: Library, statistics: Statistics) -> None:
        scale = np.tile(pi_from_parts(1.0, LENGTH, LENGTH**2), lib.n_links)
        self._factor = statistics.over_pi()
        friction = np.linalg.norm(self._factor[:, scale.size :], axis=0)
        sizes = np.linalg.norm(self._factor[:, : scale.size] * scale, axis=0)
        # Of a single joint most columns are 0; of arms the median counts all of them.
        typical = np.median(sizes) or np.median(sizes[sizes > 0])
        self._lib = lib
        self._scale = np.concatenate([scale, typical / np.where(friction > 0, friction, typical)])
        self._statistics = statistics
        self._unit = max(float(np.linalg.norm(statistics.target)), 1e-30)

    @property
    def width(self) -> int:
        return int(self._scale.size)

    def unscaled(self, x: Array) -> tuple[Array, Array]:
        values = x * self._scale
        n_pi = self._lib.pi0.size
        return values[:n_pi], values[n_pi:].reshape(self._lib.n_joints, -1)

    def residual_cone(self) -> "_Block":
        """‖R x − r‖ ≤ the last unknown, in units of ‖r‖."""
        matrix = self._factor * self._scale / self._unit
        top = np.zeros((1, self.width + 1))
        top[0, -1] = -1.0
        a = np.vstack([top, np.hstack([-matrix, np.zeros((len(matrix), 1))])])
        b = np.concatenate([[0.0], -self._statistics.target / self._unit])
        return _Block(a, a != 0, b, [clarabel.SecondOrderConeT(len(b))])

    def consistency(self, extra: int) -> "_Block":
        """P̂_k ⪰ 0 per link: svec(P̂_k) = S π̂_k, with S from the kernel P(π) of the library."""
        n, lib = self._lib.n_links, self._lib
        size = N_PARAMETERS * n
        unit = np.tile(np.eye(N_PARAMETERS), (1, n))
        blocks = lib.pseudo_inertia(unit)[:, 0]
        root2 = np.sqrt(2.0)
        one = np.array([[p[i, j] * (1.0 if i == j else root2) for p in blocks] for i, j in _SVEC])
        a = np.hstack([-block_diag(*[one] * n), np.zeros((size, self.width + extra - size))])
        whole = block_diag(*[np.ones_like(one)] * n)
        stored = np.hstack([whole, np.zeros((size, a.shape[1] - whole.shape[1]))]) > 0
        return _Block(a, stored, np.zeros(size), [clarabel.PSDTriangleConeT(4)] * n)


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """Rows b − A x ∈ K, and which entries of A are stored."""

    a: Array
    stored: NDArray[np.bool_]
    b: Array
    cones: list[object]


def _solve(cost: Array, blocks: list[_Block]) -> tuple[Array, str]:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    settings.max_iter = 200
    matrix = np.vstack([block.a for block in blocks])
    # Entries that are zero by chance are stored, too: what is stored decides the last digits.
    places = np.nonzero(np.vstack([block.stored for block in blocks]))
    solution = clarabel.DefaultSolver(
        csc_matrix((cost.size, cost.size)),
        cost,
        csc_matrix((matrix[places], places), shape=matrix.shape),
        np.concatenate([block.b for block in blocks]),
        [cone for block in blocks for cone in block.cones],
        settings,
    ).solve()
    status = str(solution.status)
    if status not in {"Solved", "AlmostSolved"}:
        raise IdentificationError(
            f"Clarabel did not solve the convex problem (status {status}); check the data for "
            "outliers and the units of torque"
        )
    return np.array(solution.x), status


PC_OLS = Method(
    "pc-ols",
    "convex program with linear matrix inequalities: the optimum (Eq. 3.8)",
    fit_pc_ols,
    label="PC-IDIM-OLS",
    from_statistics=True,
    bounds_friction=True,
)
