"""Inertial priors that are linear in π: equations E π = e and half-spaces a·π ≤ l, each named.

Masses, centres of mass (m·c is linear where c ∈ {c : n·c ≤ d} is n·(m c) ≤ d m) and symmetry planes
are of this kind. A first point strictly inside comes from one cone program; where there is none,
its multipliers name the priors that contradict each other (Farkas). Then the Newton method of
`newton` minimises within the subspace of the equations, with logarithmic barriers.
"""

from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from scipy.linalg import block_diag, null_space
from scipy.sparse import csc_matrix

from runtime.errors import IdentificationError
from runtime.estimators.convex import newton
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.regression.factor import Reduced
from runtime.library import Array
from runtime.library.parameters import N_PARAMETERS

BARRIER = 1e-2  # weight of a half-space's logarithm over γ: small, only near points move
ROOM = 0.05  # largest distance of the first point from the constraints, in units of the prior
LEAST_ROOM = 1e-6  # distance below which no strictly consistent point exists
ROOM_COST = 1e4  # cost of missing distance from constraints, relative to distance from the prior
ACTIVE = 1e-2  # slack, relative to its scale, below which a half-space holds with equality


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintRow:
    """One linear prior, coefficients · π = value or ≤ value."""

    name: str  # entry of the file that states it
    coefficients: Array  # (10 n,)
    value: float  # kg, kg·m or kg·m², as the coefficients require


@dataclass(frozen=True, slots=True)
class Constraints:
    """Linear priors: equations, and upper bounds."""

    equations: tuple[ConstraintRow, ...] = ()
    bounds: tuple[ConstraintRow, ...] = ()


def constrained(
    constraints: Constraints, data: Reduced, prior: Prior, gamma: float | Array
) -> tuple[newton.Minimum, tuple[str, ...]]:
    """Minimise under entropic and linear priors."""
    # W with Wᵀ W the curvature of the prior: ‖W (π − π0)‖² / 2 is D to second order.
    _, blocks = prior.bodies.curvature(prior.centre)
    whiten = np.asarray(block_diag(*(np.linalg.cholesky(b).T for b in blocks)))
    start = _inside(constraints, prior, whiten)
    rows, limits = _stacked(constraints.bounds, start.size)
    inside = newton.HalfSpaces(rows, limits, BARRIER * float(np.min(gamma))) if len(rows) else None
    free = None
    if constraints.equations:
        matrix, _ = _stacked(constraints.equations, start.size)
        scaled = np.asarray(np.linalg.solve(whiten.T, matrix.T).T)  # E in whitened unknowns
        free = newton.Subspace(start, np.asarray(np.linalg.solve(whiten, null_space(scaled))))
    problem = newton.convex_problem(data, prior, gamma, inside, free)
    minimum = newton.minimise_anywhere(problem, start)
    notes: tuple[str, ...] = ()
    if len(rows):
        scale = np.linalg.norm(np.linalg.solve(whiten.T, rows.T), axis=0)
        tight = (limits - rows @ minimum.pi) < ACTIVE * scale
        names = dict.fromkeys(b.name for b, t in zip(constraints.bounds, tight, strict=True) if t)
        if names:
            notes = (
                f"the estimate lies at the limit of the prior on {', '.join(names)}; check it",
            )
    return minimum, notes


def _inside(constraints: Constraints, prior: Prior, whiten: Array) -> Array:
    """Point near the centre of the prior, strictly inside: min d − ROOM_COST t, t ≤ ROOM.

    Unknowns are x of π = centre + W⁻¹ x in units of the prior, the distance t from all
    constraints, and d ≥ ‖x‖.
    """
    size = prior.centre.size
    e, e_value = _stacked(constraints.equations, size)
    a, limit = _stacked(constraints.bounds, size)
    # π = centre + back x, x in units of the prior
    back = np.asarray(np.linalg.inv(whiten), dtype=np.float64)
    a_x, e_x = a @ back, e @ back
    scale, length = np.linalg.norm(a_x, axis=1), np.linalg.norm(e_x, axis=1)
    if (scale == 0).any() or (length == 0).any():
        raise IdentificationError(
            "a prior has coefficients that are all zero, so it restricts no parameter; correct its "
            "numbers"
        )
    zero = np.zeros
    cone, room = _consistency(prior, back)
    # Rows b − A x ∈ K: equations, bounds with distance t, t ≤ ROOM, ‖x‖ ≤ d, P̃_k ⪰ t.
    blocks = [
        np.hstack([e_x / length[:, None], zero((len(e), 2))]),
        np.hstack([a_x / scale[:, None], np.ones((len(a), 1)), zero((len(a), 1))]),
        np.hstack([zero((1, size)), [[1.0, 0.0]]]),
        np.hstack([zero((1, size + 1)), [[-1.0]]]),
        np.hstack([-np.eye(size), zero((size, 2))]),
        np.hstack([-cone, room[:, None], zero((len(cone), 1))]),
    ]
    at = prior.centre
    sides = [(e_value - e @ at) / length, (limit - a @ at) / scale, [ROOM], zero(size + 1), room]
    bodies = size // N_PARAMETERS
    cones = [clarabel.ZeroConeT(len(e))] if len(e) else []
    cones += [clarabel.NonnegativeConeT(len(a) + 1), clarabel.SecondOrderConeT(size + 1)]
    cones += [clarabel.PSDTriangleConeT(4)] * bodies
    cost, matrix = np.concatenate([zero(size), [-ROOM_COST, 1.0]]), csc_matrix(np.vstack(blocks))
    solution = solved_cone(cost, matrix, np.concatenate(sides), cones)
    status, x = str(solution.status), np.array(solution.x)
    if status not in {"Solved", "AlmostSolved"} or x[size] < LEAST_ROOM:
        _contradiction(constraints, np.abs(np.array(solution.z)))
    return np.asarray(prior.centre + back @ x[:size])


def _contradiction(constraints: Constraints, multipliers: Array) -> None:
    """Raise with the priors whose multipliers prove that no point satisfies all of them."""
    rows = (*constraints.equations, *constraints.bounds)
    shares = multipliers[: len(rows)]
    guilty = shares > 1e-3 * max(float(shares.max()), 1e-300)
    names = list(dict.fromkeys(r.name for r, g in zip(rows, guilty, strict=True) if g))
    what = f"the prior on {names[0]} cannot hold"
    if len(names) > 1:
        what = f"the priors on {' and '.join(names)} contradict each other"
    raise IdentificationError(
        f"{what}: no physically consistent bodies satisfy them; correct or remove one of them"
    )


def _consistency(prior: Prior, back: Array) -> tuple[Array, Array]:
    """svec of P̃_k(x) = L⁻¹ P_k(back x) L⁻ᵀ with P0 = L Lᵀ, and of the identity, stacked."""
    basis, size = prior.bodies.basis, prior.centre.size
    lower = np.linalg.inv(np.linalg.cholesky(prior.bodies.pseudo_inertia(prior.centre)))
    blocks = [svec(inverse @ basis @ inverse.T) for inverse in lower]
    unit = np.tile(svec(np.eye(4)[None])[:, 0], size // N_PARAMETERS)
    return block_diag(*blocks) @ back, unit


def svec(matrices: Array) -> Array:
    """Upper triangles (10, k) of symmetric matrices (k, 4, 4), √2 beside the diagonal."""
    places = [(i, j) for j in range(4) for i in range(j + 1)]
    return np.array([(1.0 if i == j else np.sqrt(2.0)) * matrices[:, i, j] for i, j in places])


def solved_cone(cost: Array, rows: csc_matrix, sides: Array, cones: list[Any], **how: Any) -> Any:
    """Clarabel's solution of min cost · x with sides − rows x in a product of cones."""
    settings = clarabel.DefaultSettings()
    for name, value in ({"verbose": False} | how).items():
        setattr(settings, name, value)
    flat = csc_matrix((cost.size, cost.size))
    return clarabel.DefaultSolver(flat, cost, rows, sides, cones, settings).solve()


def _stacked(rows: tuple[ConstraintRow, ...], size: int) -> tuple[Array, Array]:
    """Coefficients (rows, size) and values (rows,)."""
    matrix = np.array([r.coefficients for r in rows]).reshape(len(rows), size)
    return matrix, np.array([r.value for r in rows])
