"""The entropic prior: D(π) = Σ_k [tr(P0_k⁻¹ P_k) − log det P_k], smallest at P_k = P0_k.

Up to a constant D is the relative entropy between the mass distributions that P and P0 stand for
(Gaussians of mass m, mean m·c and second moment Σ). To second order it is ½ ‖P0^-½ ΔP P0^-½‖², so
a weight of κ trusts every direction of P0 to a relative standard deviation of 1/√κ.
Source: Lee, Wensing & Park 2019 for the divergence; the floor is this project's.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import IdentificationError
from runtime.estimators.convex.bodies import Bodies, bodies_of
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, links, mass

THIN = 0.05
"""Eigenvalues of a prior's Σ_com below this share of their sum are raised to it: a thin axis that
is wrong in the URDF would otherwise outweigh the data."""

CAD, GRIPPER, NONE = 16.0, 4.0, 1.0
"""Trust κ in a model from CAD, in a gripper or payload, and in a model of unknown quality."""


class Prior(NamedTuple):
    """Entropic prior around given bodies.

    Attributes:
        bodies: map P(π) of one body.
        centre: π0 after the floor, (10 n,); P0_k ≻ 0.
        slope: tr(P0_k⁻¹ B_i), (10 n,): Σ tr(P0_k⁻¹ P_k) = slope · π.
        notes: sentences on what had to be repaired.
    """

    bodies: Bodies
    centre: Array
    slope: Array
    notes: tuple[str, ...] = ()


def prior_from(bodies: Bodies, centre: Array, notes: tuple[str, ...] = ()) -> Prior:
    """Entropic prior around strictly consistent bodies.

    Args:
        bodies: map P(π) of one body.
        centre: π0 of any number n of bodies, (10 n,) or (n, 10).
        notes: sentences on what had to be repaired.

    Returns:
        The prior.

    Raises:
        IdentificationError: a P0_k is not positive definite.
    """
    flat = np.ascontiguousarray(centre, dtype=float).ravel()
    if flat.size % N_PARAMETERS or not np.isfinite(flat).all() or bodies.log_det(flat) is None:
        raise IdentificationError(
            "the prior needs strictly consistent bodies (P ≻ 0 for every link); take "
            "nearest_realisable(pi) of the library first"
        )
    inverse = np.asarray(np.linalg.inv(bodies.pseudo_inertia(flat)), dtype=np.float64)
    return Prior(bodies, flat, bodies.against(inverse), notes)


def prior_of(lib: Library, pi: ArrayLike | None = None, floor: float = THIN) -> Prior:
    """Entropic prior of a robot, with the eigenvalues of Σ_com raised to a floor.

    Args:
        lib: library of the robot.
        pi: π0, (10 n,) [kg, kg·m, kg·m²]; default is that of the URDF.
        floor: smallest eigenvalue of Σ_com relative to their sum.

    Returns:
        The prior; its notes name links that were not consistent.

    Raises:
        IdentificationError: a mass that is not above 0.
    """
    given = lib.pi0 if pi is None else np.asarray(pi, dtype=float)
    masses = mass(links(given))
    usable = np.isfinite(links(given)).all(axis=1) & (masses > 0)
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
