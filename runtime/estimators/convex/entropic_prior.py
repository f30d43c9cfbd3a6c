"""The entropic prior: D(π) = Σ_k [tr(P0_k⁻¹ P_k) − log det P_k], smallest at P_k = P0_k.

Up to a constant D is the relative entropy between the mass distributions that P and P0 stand for
(Gaussians of mass m, mean m·c and second moment Σ). To second order it is ½ ‖P0^-½ ΔP P0^-½‖², so
a weight of κ trusts every direction of P0 to a relative standard deviation of 1/√κ. P is linear in
π (Eqs. 3.9, 3.10), so its ten basis matrices B_i = P(e_i) determine it:

    ∂(−log det P)/∂π_i = −tr(P⁻¹ B_i),   ∂²/∂π_i∂π_j = tr(P⁻¹ B_i P⁻¹ B_j).

The posterior covariance of π is C = (ÃᵀÃ + κ B)⁻¹, Ã the data's rows over their noise, B the
curvature of D. Source: Lee, Wensing & Park 2019 for the divergence; Laplace's approximation
(MacKay 2003, Ch. 27); the floor is this project's.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from runtime.errors import IdentificationError
from runtime.estimators.regression.posterior import Posterior, posterior_of
from runtime.library import Array, Library
from runtime.library.parameters import FIRST_MOMENT, MASS, N_PARAMETERS, centre_of_mass, links, mass

_UNIT = np.eye(4)
_SYMMETRIC = np.array(  # an orthonormal basis of symmetric matrices, (10, 4, 4)
    [
        (np.outer(_UNIT[i], _UNIT[j]) + np.outer(_UNIT[j], _UNIT[i])) / (2 if i == j else 2**0.5)
        for i in range(4)
        for j in range(i + 1)
    ]
)
THIN = 0.05
"""Eigenvalues of a prior's Σ_com below this share of their sum are raised to it: a thin axis that
is wrong in the URDF would otherwise outweigh the data."""
AS_STATED = 1e-4  # the same of bodies that count as stated: 1 % of their size is rounding of a file
CAD, GRIPPER, NONE = 16.0, 4.0, 1.0  # trust κ in CAD, a gripper or payload, an unknown model


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """Map P(π) = Σ π_i B_i of one body, the same for every link of every robot."""

    basis: Array  # B, (10, 4, 4)

    def pseudo_inertia(self, pi: Array) -> Array:
        """Pseudo-inertia P_k, (n, 4, 4), from π (10 n,)."""
        return (links(pi) @ self.basis.reshape(N_PARAMETERS, 16)).reshape(-1, 4, 4)

    def pi_of(self, matrices: Array) -> Array:
        """Parameters π_k, (n, 10), of pseudo-inertias or changes of them, (n, 4, 4)."""
        to_pi = np.linalg.pinv(self.basis.reshape(N_PARAMETERS, 16))
        return np.asarray(matrices.reshape(-1, 16) @ to_pi)

    def against(self, matrices: Array) -> Array:
        """Slope tr(M_k B_i) of Σ tr(M_k P_k) in π, (10 n,), for symmetric M (n, 4, 4)."""
        return (matrices.reshape(-1, 16) @ self.basis.reshape(N_PARAMETERS, 16).T).ravel()

    def log_det(self, pi: Array) -> Array | None:
        """log det P_k, (n,); None where a P_k is not positive definite."""
        try:
            lower = np.linalg.cholesky(self.pseudo_inertia(pi))
        except np.linalg.LinAlgError:
            return None
        return np.asarray(2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1))

    def curvature(self, pi: Array) -> tuple[Array, Array]:
        """Traces tr(P_k⁻¹ B_i), (n, 10), and tr(P_k⁻¹ B_i P_k⁻¹ B_j), (n, 10, 10)."""
        inverse = np.linalg.inv(self.pseudo_inertia(pi))
        moved = inverse[:, None] @ self.basis
        count = len(inverse)
        turned = np.swapaxes(moved, 2, 3).reshape(count, N_PARAMETERS, 16)
        return (
            np.trace(moved, axis1=2, axis2=3),
            moved.reshape(count, N_PARAMETERS, 16) @ np.swapaxes(turned, 1, 2),
        )

    def spread(self, pi: Array) -> Array:
        """Root R of the inverse Hessian of −log det P, R Rᵀ, per body, (n, 10, 10).

        It is accurate next to the boundary, too: with P = C Cᵀ the change C E Cᵀ has the length
        ‖E‖ for every symmetric E, so the columns are those of an orthonormal basis of them, and
        nothing is inverted.
        """
        lower = np.linalg.cholesky(self.pseudo_inertia(pi))[:, None]
        change = lower @ _SYMMETRIC @ np.swapaxes(lower, 2, 3)
        size = N_PARAMETERS
        return np.swapaxes(self.pi_of(change).reshape(-1, size, size), 1, 2)


def bodies_of(lib: Library) -> Bodies:
    """Basis matrices from the kernel of the library, evaluated at unit vectors."""
    unit = np.tile(np.eye(N_PARAMETERS), (1, lib.n_links))
    return Bodies(np.ascontiguousarray(lib.pseudo_inertia(unit)[:, 0]))


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Entropic prior around given bodies."""

    bodies: Bodies  # map P(π) of one body
    centre: Array  # π0 after the floor, (10 n,); P0_k ≻ 0
    slope: Array  # tr(P0_k⁻¹ B_i), (10 n,): Σ tr(P0_k⁻¹ P_k) = slope · π
    notes: tuple[str, ...] = ()  # sentences on what had to be repaired
    is_of_type: bool = False  # whether its trust was estimated from other units of the robot's type

    def thinnest(self) -> Array:
        """Smallest eigenvalue of Σ_com of every link, (n,) [kg·m²]."""
        P = self.bodies.pseudo_inertia(self.centre)
        at_com = P[:, :3, :3] - P[:, :3, 3:] * P[:, 3:, :3] / P[:, 3:, 3:]
        return np.asarray(np.linalg.eigvalsh(at_com)[:, 0])


def prior_from(bodies: Bodies, centre: Array, notes: tuple[str, ...] = ()) -> Prior:
    """Entropic prior around strictly consistent bodies."""
    flat = np.ascontiguousarray(centre, dtype=float).ravel()
    if flat.size % N_PARAMETERS or not np.isfinite(flat).all() or bodies.log_det(flat) is None:
        raise IdentificationError(
            "the prior needs strictly consistent bodies (P ≻ 0 for every link); take "
            "nearest_realisable(pi) of the library first"
        )
    inverse = np.asarray(np.linalg.inv(bodies.pseudo_inertia(flat)), dtype=np.float64)
    return Prior(bodies, flat, bodies.against(inverse), notes)


def prior_of(lib: Library, pi: ArrayLike | None = None, floor: float = THIN) -> Prior:
    """Entropic prior of a robot about π, with the eigenvalues of Σ_com raised to a floor."""
    given = lib.pi0 if pi is None else np.asarray(pi, dtype=float)
    usable = np.isfinite(links(given)).all(axis=1) & (mass(links(given)) > 0)
    if not usable.all():
        bad = [name for name, good in zip(lib.link_names, usable, strict=True) if not good]
        raise IdentificationError(
            f"the prior needs finite parameters and positive masses; correct {', '.join(bad)} "
            "in the URDF or in the first guess"
        )
    absent = lib.relative_eigenvalues(given) <= 0
    notes: tuple[str, ...] = ()
    if absent.any():
        names = ", ".join(np.array(lib.link_names)[absent])
        notes = (
            f"the first guess of {names} is not physically consistent; the nearest consistent "
            "one is taken as prior",
        )
    return prior_from(bodies_of(lib), lib.nearest_realisable(given, floor), notes)


def prior_about(lib: Library, guess: Array, centre: Array | None) -> Prior:
    """Entropic prior about a stated centre, or about a first guess."""
    if centre is None:
        return prior_of(lib, guess)
    return replace(prior_of(lib, centre, floor=0.0), is_of_type=True)


def log_evidence(prior: Prior, rows: Array, target: Array, kappa: float, pi: Array) -> float:
    """Logarithm of the probability of data A π = b + e, e ~ N(0, 1), but for a constant.

        ½ log |C| − ‖A π̂ − b‖²/2 − κ Σ_k [tr(P0_k⁻¹ P̂_k) − log det P̂_k] − (κ + 5/2) Σ_k log det P0_k

    at the most probable π̂: the prior is the Wishart density of 2 κ + 5 degrees of freedom about
    P0/2κ, integrated by Laplace's method.
    """
    now, then = prior.bodies.log_det(pi), prior.bodies.log_det(prior.centre)
    if now is None or then is None:
        return -np.inf
    rest = rows @ pi - target
    volume = np.linalg.slogdet(spread_of(prior.bodies, pi, rows, kappa).root)[1]
    cost = rest @ rest / 2 + kappa * (prior.slope @ pi - now.sum())
    return float(volume - cost - (kappa + 2.5) * then.sum())


def spread_of(
    bodies: Bodies, pi: Array, rows: Array, kappa: float, target: Array | None = None
) -> Posterior:
    """Posterior of π by rows (m, 10 n) and the curvature of the prior at consistent bodies."""
    # R₀ R₀ᵀ = (κ B)⁻¹
    return posterior_of(rows, target, prior=block_diag(*bodies.spread(pi)) / np.sqrt(kappa))


def com_sigma(root: Array, pi: Array) -> list[Array | None]:
    """σ of the centre of mass c of every link [m], δc = (δ(m c) − c δm)/m; None without m."""
    sigmas: list[Array | None] = []
    for body, rows in zip(links(pi), root.reshape(-1, N_PARAMETERS, root.shape[1]), strict=True):
        slope = rows[FIRST_MOMENT] - np.outer(centre_of_mass(body), rows[MASS])
        sigmas.append(np.linalg.norm(slope / mass(body), axis=1) if mass(body) else None)
    return sigmas
