"""−log det P of every link with gradient and Hessian in π, from the library's own P(π).

P is linear in π (Eqs. 3.9, 3.10), so its ten basis matrices B_i = P(e_i) determine it:

    ∂(−log det P)/∂π_i = −tr(P⁻¹ B_i),   ∂²/∂π_i∂π_j = tr(P⁻¹ B_i P⁻¹ B_j).
"""

from typing import NamedTuple

import numpy as np

from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, links

_UNIT = np.eye(4)
_SYMMETRIC = np.array(
    [
        (np.outer(_UNIT[i], _UNIT[j]) + np.outer(_UNIT[j], _UNIT[i])) / (2 if i == j else 2**0.5)
        for i in range(4)
        for j in range(i + 1)
    ]
)
"""An orthonormal basis of symmetric matrices, (10, 4, 4)."""


class Bodies(NamedTuple):
    """Map P(π) = Σ π_i B_i of one body, the same for every link of every robot.

    Attributes:
        basis: B, (10, 4, 4).
    """

    basis: Array

    def pseudo_inertia(self, pi: Array) -> Array:
        """Pseudo-inertia P_k, (n, 4, 4), from π (10 n,)."""
        return (links(pi) @ self.basis.reshape(N_PARAMETERS, 16)).reshape(-1, 4, 4)

    def against(self, matrices: Array) -> Array:
        """Slope tr(M_k B_i) of Σ tr(M_k P_k) in π, (10 n,), for symmetric M (n, 4, 4)."""
        return (matrices.reshape(-1, 16) @ self.basis.reshape(N_PARAMETERS, 16).T).ravel()

    def log_det(self, pi: Array) -> Array | None:
        """log det P_k, (n,); None where a P_k is not positive definite."""
        try:
            lower = np.linalg.cholesky(self.pseudo_inertia(pi))
        except np.linalg.LinAlgError:
            return None
        diagonal = np.diagonal(lower, axis1=1, axis2=2)
        return np.asarray(2 * np.log(diagonal).sum(axis=1))

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
        to_pi = np.linalg.pinv(self.basis.reshape(N_PARAMETERS, 16))
        return np.swapaxes(change.reshape(-1, N_PARAMETERS, 16) @ to_pi, 1, 2)


def bodies_of(lib: Library) -> Bodies:
    """Basis matrices from the kernel of the library, evaluated at unit vectors."""
    unit = np.tile(np.eye(N_PARAMETERS), (1, lib.n_links))
    return Bodies(np.ascontiguousarray(lib.pseudo_inertia(unit)[:, 0]))
