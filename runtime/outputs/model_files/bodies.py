"""Rigid body and pseudo-inertia, and the text of numbers and rotations in files.

P = [[Σ, m c], [m cᵀ, m]],   Σ = Σ_com + m c cᵀ,   I_com = tr(Σ_com) 1 − Σ_com,   P' = T P Tᵀ

P is linear in the mass distribution: the pseudo-inertias of bodies that are fixed to each other
add up, and T = [[R, p], [0, 1]] transforms P to another frame. Source: Wensing, Kim & Slotine
2018.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from runtime.library import Array


@dataclass(frozen=True, slots=True, eq=False)
class RigidBody:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg·m²], axes of the link."""

    mass: float
    com: Array
    inertia: Array

    @property
    def pseudo_inertia(self) -> Array:
        """Pseudo-inertia P (4, 4) about the origin of the link [kg·m², kg·m, kg]."""
        sigma = np.trace(self.inertia) / 2 * np.eye(3) - self.inertia
        P = np.empty((4, 4))
        P[:3, :3] = sigma + self.mass * np.outer(self.com, self.com)
        P[:3, 3] = P[3, :3] = self.mass * self.com
        P[3, 3] = self.mass
        return P

    def entries(self) -> dict[str, float]:
        """Upper triangle of the inertia by name: xx, xy, xz, yy, yz, zz [kg·m²]."""
        axes = {"x": 0, "y": 1, "z": 2}
        return {a + b: float(self.inertia[axes[a], axes[b]]) for a in axes for b in axes if a <= b}


def body_of(P: Array) -> RigidBody:
    """Rigid body of a pseudo-inertia P (4, 4) with non-zero mass."""
    mass = float(P[3, 3])
    com = P[:3, 3] / mass
    sigma = P[:3, :3] - mass * np.outer(com, com)
    return RigidBody(mass, com, np.trace(sigma) * np.eye(3) - sigma)


def smallest_eigenvalue(P: Array) -> float:
    """Smallest eigenvalue of P (4, 4) over its trace; ≥ 0 for a physically consistent body.

    Without a trace it is the eigenvalue itself.
    """
    return float(np.linalg.eigvalsh(P)[0]) / (abs(float(np.trace(P))) or 1.0)


def quaternion(T: Array) -> Array:
    """Rotation of T (4, 4) as a unit quaternion w, x, y, z (4,)."""
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True)
    return np.array([w, x, y, z])


def digits(value: float) -> str:
    """Shortest text that reads back as the same double, bit for bit."""
    return repr(float(value) + 0.0)  # + 0.0 turns −0 into 0


def row(values: Array) -> str:
    """Numbers separated by blanks."""
    return " ".join(map(digits, values))
