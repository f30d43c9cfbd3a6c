"""Rows and posterior of the gains of motor currents, with the links as nuisance parameters.

    i_j = c_j A_j K (π0 + R z) + e_j,    z ~ N(0, 1),    A_j without friction

The algebra of `one_log`: Gauss–Newton, evidence and covariance on one triangle per channel.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from runtime.estimators.convex import CAD, bodies_of, prior_of
from runtime.library import Array, Library

SCALE = 2e-3
"""Relative standard deviation of a scale."""
_PASSES, _HALVINGS, _DONE = 60, 12, 1e-12
_CLOSE = 1e-3
"""Step of z, in standard deviations of the prior, at which the passes end."""


@dataclass(frozen=True, slots=True)
class GainRows:
    """Rows of every channel and of the masses over z, with π = π0 + R z.

    Attributes:
        slopes: ∂(A_j K π)/∂z on the triangle of the channel, (n, r, w).
        model: A_j K π0 on it, (n, r).
        current: (n, r).
        root: R, (10 n, w).
        known: rows of the weighed masses over z in units of their σ, (m, w).
        surplus: weighed masses less those of the URDF, over σ, (m,).
        count: number of samples.
    """

    slopes: Array
    model: Array
    current: Array
    root: Array
    known: Array
    surplus: Array
    count: int

    @property
    def width(self) -> int:
        """Number w of directions of the prior."""
        return int(self.slopes.shape[2])

    def noise(self, z: Array, c: Array) -> Array:
        """Residual RMS of the channels.

        z (w,), c (n,) [A/(N·m)] → (n,) [A].
        """
        rest = self.current - c[:, None] * (self.model + self.slopes @ z)
        return np.asarray(np.sqrt(np.sum(rest**2, axis=1) / self.count))

    def rest(self, z: Array, c: Array, unit: Array) -> Array:
        """Residuals of channels, prior and masses, over their noise.

        z (w,), c (n,) [A/(N·m)], unit (n,) [A] → (n r + w + m,).
        """
        current = (self.current - c[:, None] * (self.model + self.slopes @ z)) / unit[:, None]
        return np.concatenate([current.ravel(), -z, self.surplus - self.known @ z])

    def jacobian(self, z: Array, c: Array, unit: Array) -> Array:
        """Derivative of the fitted values by (z, ln |c|), over the noise.

        z (w,), c (n,) [A/(N·m)], unit (n,) [A] → (n r + w + m, w + n).
        """
        n, r, w = self.slopes.shape
        scale = (c / unit)[:, None]
        J = np.zeros((n * r + w + len(self.known), w + n))
        J[: n * r, :w] = (scale[:, :, None] * self.slopes).reshape(n * r, w)
        along = scale * (self.model + self.slopes @ z)
        for j in range(n):
            J[j * r : (j + 1) * r, w + j] = along[j]
        J[n * r : n * r + w, :w] = np.eye(w)
        J[n * r + w :, :w] = self.known
        return J


def gain_rows(base: Array, current: Array, lib: Library, known: Array, kg: Array) -> GainRows:
    """Rows on one triangle per channel.

    base (N, n, n_b), current (N, n) [A], known (m, 10 n), kg (m,) [kg].
    """
    spread = bodies_of(lib).spread(prior_of(lib, lib.pi0).centre) / np.sqrt(CAD)
    root = np.asarray(block_diag(*spread))
    n, width = current.shape[1], base.shape[2]
    triangles = np.zeros((n, width + 1, width + 1))
    for j in range(n):
        R = np.linalg.qr(np.column_stack([base[:, j], current[:, j]]), mode="r")
        triangles[j, : len(R)] = R
    slopes = triangles[:, :, :-1]
    return GainRows(
        slopes=slopes @ (lib.base_matrix @ root),
        model=slopes @ (lib.base_matrix @ lib.pi0),
        current=triangles[:, :, -1],
        root=root,
        known=known @ root / (SCALE * kg)[:, None],
        surplus=(kg - known @ lib.pi0) / (SCALE * kg),
        count=len(base),
    )


def _slopes(reduced: GainRows, z: Array) -> Array:
    """c of least squares at π = π0 + R z, (n,)."""
    model = reduced.model + reduced.slopes @ z
    both = np.sum(model * reduced.current, axis=1)
    return np.asarray(both / np.maximum(np.sum(model**2, axis=1), 1e-300))


def most_probable(
    reduced: GainRows, z: Array | None = None, density: float = 1.0
) -> tuple[Array, Array]:
    """Most probable c with z integrated out, and z there.

        min ½ ‖rest(z, c)‖² + ½ log det H(c),    H = ∂²/∂z² of the first term

    The mode in (z, c) alone makes c too large: π = π0 + R z is longer than π0 in every direction
    that the data determine. ∂/∂ ln c_j of the second term is the number d_j of directions that
    channel j determines (MacKay 2003, Ch. 27). Gauss–Newton on z, with c eliminated (variable
    projection, Kaufman 1975) and with the noise of the present residuals.

    z (w,) → (w,).
    """
    w = reduced.width
    z = np.zeros(w) if z is None else z
    c = _slopes(reduced, z)
    for _ in range(_PASSES):
        unit = reduced.noise(z, c) * np.sqrt(density)
        J, rest = reduced.jacobian(z, c, unit), reduced.rest(z, c, unit)
        model = reduced.model + reduced.slopes @ z
        directions = _directions(reduced, c, unit)
        longer = np.sum(model[:, None] @ reduced.slopes, axis=1)
        pull = (directions / np.maximum(np.sum(model**2, axis=1), 1e-300)) @ longer
        along, J = J[:, w:], J[:, :w]
        along = along / np.maximum(np.linalg.norm(along, axis=0), 1e-300)
        free = J - along @ (along.T @ J)
        step = np.linalg.solve(free.T @ free, J.T @ rest + pull)

        def cost(z: Array, c: Array, unit: Array = unit, d: Array = directions) -> float:
            rest = reduced.rest(z, c, unit)
            return float(rest @ rest / 2 + d @ np.log(np.maximum(np.abs(c), 1e-300)))

        before = cost(z, c)
        for _ in range(_HALVINGS):  # a full step may leave the range of the linear model
            moved = z + step, _slopes(reduced, z + step)
            if cost(*moved) <= before + _DONE * abs(before):
                break
            step = step / 2
        z, c = moved
        if np.linalg.norm(step) <= _CLOSE:
            break
    return z, c


def _directions(reduced: GainRows, c: Array, unit: Array) -> Array:
    """d_j = tr(H⁻¹ c_j² G_jᵀG_j), (n,): directions of z that each channel determines."""
    rows = reduced.slopes * (c / unit)[:, None, None]
    grams = np.swapaxes(rows, 1, 2) @ rows
    H = np.eye(reduced.width) + reduced.known.T @ reduced.known + grams.sum(axis=0)
    return np.asarray(np.trace(np.linalg.solve(H, grams), axis1=1, axis2=2))


def covariance_of_gains(
    reduced: GainRows, z: Array, c: Array, density: float, width: float
) -> Array:
    """Covariance of ln |c| for a prior of `width` times its spread.

    z (w,), c (n,) → (n, n).
    """
    unit = reduced.noise(z, c) * np.sqrt(density)
    J, n = reduced.jacobian(z, c, unit), len(c)
    first = reduced.current.size
    J[first : first + reduced.width] /= width
    lengths = np.linalg.norm(J, axis=0)
    inverse = np.linalg.pinv(J / lengths, rcond=1e-12) / lengths[:, None]
    return np.asarray(inverse[-n:] @ inverse[-n:].T)
