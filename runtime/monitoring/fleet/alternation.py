"""Alternation of the units' maxima a posteriori with the centre of the type in closed form.

    P_u = argmin ½ ‖A_u K π − b_u‖² + κ D(P, P0)          one convex problem per unit
    P0 = argmin κ Σ_u D(P_u, X) + κ_0 D(X, P_URDF)        see `centre_of`

This is the EM algorithm for P0 as far as a posterior mean is its mode. From the URDF it would be
slow in directions that a log hardly determines; it begins at the centre of `hierarchy`.
Source: Dempster, Laird & Rubin 1977.
"""

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.convex import Prior, Reduced, convex_problem, prior_from, solve_many
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.parallel import cores

PASSES = 4
"""Largest number of passes."""
STILL = 1e-3
"""Step of the centre, as a standard deviation of a unit, below which the passes end."""


def alternate(
    lib: Library,
    urdf: Prior,
    data: tuple[Array, Array],
    counted: NDArray[np.bool_],
    kappas: tuple[float, float],
    centre: Array,
) -> tuple[Array, Array]:
    """Alternate each unit's maximum a posteriori with the centre of the units that count.

    data (U, n_b, n_b), counted (U,), centre (10 n,) → (U, 10 n).
    """
    bodies, (kappa, kappa_0) = urdf.bodies, kappas
    of_urdf = bodies.pseudo_inertia(urdf.centre)
    to_pi = np.linalg.pinv(bodies.basis.reshape(N_PARAMETERS, 16))
    factors = [np.ascontiguousarray(A @ lib.base_matrix) for A in data[0]]
    starts: list[Array | None] = [None] * len(factors)
    for _ in range(PASSES):
        prior = prior_from(bodies, centre)
        problems = [
            convex_problem(Reduced(A, b, 0.0, 1.0, 1.0), prior, kappa)
            for A, b in zip(factors, data[1], strict=True)
        ]
        minima = solve_many(lib, problems, starts, cores())
        pi = np.stack([minimum.pi for minimum in minima])
        starts = list(pi)
        pseudo = bodies.pseudo_inertia(pi[counted]).reshape(int(counted.sum()), -1, 4, 4)
        X = centre_of(pseudo, of_urdf, kappa, kappa_0)
        moved = (X.reshape(-1, 16) @ to_pi).ravel()
        step, centre = _step(bodies.spread(centre), moved - centre), moved
        if step * np.sqrt(kappa) < STILL:
            break
    return pi, centre


def centre_of(pseudo: Array, urdf: Array, kappa: float, kappa_0: float) -> Array:
    """Centre X of bodies, the minimiser of κ Σ_u D(P_u, X) + κ_0 D(X, P_URDF), in closed form.

    Its slope is 0 where κ_0 X P⁻¹ X + (κ U − κ_0) X = κ Σ P_u, P of the URDF. With P = L Lᵀ,
    X = L W Lᵀ this is κ_0 W² + (κ U − κ_0) W = L⁻¹ (κ Σ P_u) L⁻ᵀ, a quadratic equation of each
    eigenvalue.

    pseudo (U, n, 4, 4), urdf (n, 4, 4) → (n, 4, 4).
    """
    lower = np.linalg.cholesky(urdf)
    inverse = np.linalg.inv(lower)
    whole = inverse @ (kappa * pseudo.sum(axis=0)) @ np.swapaxes(inverse, 1, 2)
    values, vectors = np.linalg.eigh((whole + np.swapaxes(whole, 1, 2)) / 2)
    linear = kappa * len(pseudo) - kappa_0
    # The root above 0, without the difference of two large numbers.
    root = np.sqrt(linear**2 + 4 * kappa_0 * values)
    solved = np.where(linear > 0, 2 * values / (linear + root), (root - linear) / (2 * kappa_0))
    inner = (vectors * solved[:, None]) @ np.swapaxes(vectors, 1, 2)
    return np.asarray(lower @ inner @ np.swapaxes(lower, 1, 2))


def _step(spread: Array, change: Array) -> float:
    """Largest length of a change of a link in units of the prior with κ = 1."""
    links = change.reshape(-1, N_PARAMETERS, 1)
    return float(np.linalg.norm(np.linalg.solve(spread, links), axis=1).max())
