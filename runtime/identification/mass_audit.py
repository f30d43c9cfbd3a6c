"""Audit of M(q) ≻ 0 over the joint box: a proof where the bodies allow one, else a search.

    proof     every P ≻ 0  ⇒  λ_min(M(q) + diag(J)) ≥ b > 0 for every q  (`Library.least_inertia`)
    search    N uniform positions, then descent of λ_min from the smallest of them

A search that finds no violation bounds the share of the box in which M is not positive definite:
below 1 − 0.05^(1/N) with 95 % confidence. Base parameters of a method without constraints need the
search; a controller that inverts M needs the answer.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from runtime.library import Array, Library

SAMPLES = 4096
STARTS = 4
"""Positions from which λ_min descends; of more, hardly one ends lower."""
CONFIDENCE = 0.95
_HALF_RANGE = {"prismatic": 1.0}
"""Half range of joints without limits [m]; others turn by ±π."""


@dataclass(frozen=True, slots=True)
class MassAudit:
    """Smallest eigenvalue of M(q) + diag(J) over the joint box."""

    # b, a lower bound at every q [kg·m², kg]; None where there is no proof
    proven_bound: float | None
    least: float  # smallest eigenvalue that the search found, an upper bound of the minimum
    at: tuple[float, ...]  # (n,) position of it [rad, m]
    samples: int  # number of uniform positions N
    # bound of the share of the box with an eigenvalue of at most 0, with 95 % confidence; 0 with a
    # proof, None where the search found such a position
    violated_share: float | None

    @property
    def is_positive_definite(self) -> bool:
        """Whether no position with an eigenvalue of at most 0 is known."""
        return self.least > 0

    def sentence(self) -> str:
        """Result of the audit in one sentence."""
        place = ", ".join(f"{x:.2f}" for x in self.at)
        if self.proven_bound is not None:
            return (
                f"M(q) is positive definite at every q: proven eigenvalues from "
                f"{self.proven_bound:.1e} on, {self.least:.1e} is the smallest one seen"
            )
        if self.violated_share is None:
            return (
                f"M(q) is not positive definite: an eigenvalue is {self.least:.1e} at q = {place}; "
                "a controller that inverts M needs a physically consistent result (map, pc-ols)"
            )
        return (
            f"M(q) is positive definite at {self.samples} positions ({self.least:.1e} is the "
            f"smallest eigenvalue), so that with 95 % confidence less than "
            f"{100 * self.violated_share:.2f} % of the joint box violate it; not proven, since "
            "some links are not physically consistent"
        )

    def to_facts(self) -> dict[str, object]:
        """JSON-ready content."""
        return {
            "is_positive_definite": self.is_positive_definite,
            "proven_bound": self.proven_bound,
            "least_eigenvalue": self.least,
            "at": list(self.at),
            "samples": self.samples,
            "violated_share_95": self.violated_share,
        }


def audit_mass(
    lib: Library, pi: Array, rotor: Array | float = 0.0, samples: int = SAMPLES, seed: int = 0
) -> MassAudit:
    """Audit M(q) + diag(J) over the limits of the joints.

    pi (10 L,) [kg, kg·m, kg·m²], rotor (n,) [kg·m², kg].
    """
    rotors = np.broadcast_to(np.asarray(rotor, dtype=float), lib.n_joints)
    lower, upper = joint_box(lib)
    q = np.random.default_rng(seed).uniform(lower, upper, (samples, lib.n_joints))
    least = np.linalg.eigvalsh(lib.mass_matrix(q, pi) + np.diag(rotors))[:, 0]
    best, at = np.inf, q[0]
    for k in np.argsort(least)[:STARTS]:
        descent = minimize(
            lambda x: _least_eigenvalue(lib, pi, rotors, x),
            q[k],
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(lower, upper, strict=True)),
        )
        # Where two eigenvalues meet, λ_min has a kink and the descent may stop early.
        value, place = (descent.fun, descent.x) if descent.fun < least[k] else (least[k], q[k])
        if value < best:
            best, at = float(value), place
    bound = lib.least_inertia(pi, rotors)
    proven = bound if np.isfinite(bound) and bound > 0 else None
    share = None if best <= 0 else 1 - (1 - CONFIDENCE) ** (1 / samples)
    if proven is not None:
        share = 0.0
    return MassAudit(proven, best, tuple(map(float, at)), samples, share)


def joint_box(lib: Library) -> tuple[Array, Array]:
    """Limits of the independent joints; where a joint has none, ±π rad or ±1 m.

    Returns (n,) [rad, m].
    """
    limits = lib.limits()
    half = np.array([_HALF_RANGE.get(joint.kind, np.pi) for joint in lib.manifest.joints])
    lower, upper = limits["lower"], limits["upper"]
    return np.where(np.isfinite(lower), lower, -half), np.where(np.isfinite(upper), upper, half)


def _least_eigenvalue(lib: Library, pi: Array, rotors: Array, q: Array) -> tuple[float, Array]:
    """λ_min and its gradient vᵀ ∂(M v)/∂q, v its eigenvector.

    M v is the torque at rest for the acceleration v, without that of gravity.
    """
    values, vectors = np.linalg.eigh(lib.mass_matrix(q, pi) + np.diag(rotors))
    v, still = vectors[:, 0], np.zeros(lib.n_joints)
    pushed, _, _ = lib.inverse_dynamics_derivatives(q, still, v, pi)
    at_rest, _, _ = lib.inverse_dynamics_derivatives(q, still, still, pi)
    return float(values[0]), v @ (pushed - at_rest)
