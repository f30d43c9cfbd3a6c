"""Mass, centre of mass and inertia of one body, with the covariance propagated from that of π.

c = h / m,   Σ_com = Σ − h hᵀ / m,   I_com = tr(Σ_com) 1 − Σ_com,   C_x = J C_π Jᵀ
"""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.convex import Bodies
from runtime.library import Array
from runtime.library.parameters import inertia_entries

NAMES = ("mass", "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz")
"""Names of the ten values: kg, m ×3, kg·m² ×6, with the inertia about the centre of mass."""


@dataclass(frozen=True, slots=True)
class Body:
    """One body in one frame.

    Attributes:
        mass: mass, kg.
        com: centre of mass, (3,) m.
        inertia: about the centre of mass, axes of the frame, (3, 3) kg·m².
        covariance: of (mass, com, xx, yy, zz, xy, xz, yz), (10, 10).
    """

    mass: float
    com: Array
    inertia: Array
    covariance: Array

    @property
    def values(self) -> Array:
        """The ten values named by `NAMES`."""
        return np.array([self.mass, *self.com, *inertia_entries(self.inertia)])

    @property
    def sigma(self) -> Array:
        """Standard deviations of the ten values."""
        return np.sqrt(np.diagonal(self.covariance))


def body_of(bodies: Bodies, pi: Array, covariance: Array) -> Body:
    """Mass, centre of mass and inertia from π, with their covariance by the delta method.

    Args:
        bodies: map from π to the pseudo-inertia of one body.
        pi: (10,) [kg, kg·m ×3, kg·m² ×6].
        covariance: of π, (10, 10).

    Returns:
        The body in the frame of π.
    """
    P = bodies.pseudo_inertia(pi)[0]
    m, h = float(P[3, 3]), P[:3, 3]
    inertia = _about((P[:3, :3] - np.outer(h, h) / m)[None])[0]
    slope = jacobian(bodies, pi)
    return Body(m, h / m, inertia, slope @ covariance @ slope.T)


def pi_of_body(bodies: Bodies, mass: float, com: Array, inertia: Array) -> Array:
    """π from mass, centre of mass and inertia, the inverse of `body_of`.

    Args:
        bodies: map from π to the pseudo-inertia of one body.
        mass: kg.
        com: centre of mass, (3,) m.
        inertia: about the centre of mass, (3, 3) kg·m².

    Returns:
        (10,) π [kg, kg·m ×3, kg·m² ×6].
    """
    P = np.zeros((4, 4))
    P[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia + mass * np.outer(com, com)
    P[:3, 3] = P[3, :3] = mass * com
    P[3, 3] = mass
    flat = bodies.basis.reshape(len(bodies.basis), 16)
    return np.asarray(np.linalg.lstsq(flat.T, P.ravel(), rcond=None)[0])


def jacobian(bodies: Bodies, pi: Array) -> Array:
    """∂(mass, com, xx, yy, zz, xy, xz, yz)/∂π.

    pi (10,) [kg, kg·m ×3, kg·m² ×6] → (10, 10).
    """
    P, unit = bodies.pseudo_inertia(pi)[0], bodies.basis
    m, h = P[3, 3], P[:3, 3]
    dm, dh = unit[:, 3, 3], unit[:, :3, 3]
    d_com = (dh - np.outer(dm, h / m)) / m
    cross = dh[:, :, None] * h[None, None, :]
    d_sigma = unit[:, :3, :3] - (cross + np.swapaxes(cross, 1, 2)) / m
    d_inertia = _about(d_sigma + dm[:, None, None] * np.outer(h, h) / m**2)
    return np.vstack([dm, d_com.T, inertia_entries(d_inertia).T])


def _about(sigma: Array) -> Array:
    """tr(Σ) 1 − Σ, (n, 3, 3)."""
    traces = np.trace(sigma, axis1=1, axis2=2)
    return np.asarray(traces[:, None, None] * np.eye(3) - sigma)
