"""Strictly convex quadratic programmes with many rows of which few are active.

    min ½ xᵀP x + qᵀx  s.t.  A x ≤ b

With P = L Lᵀ, y = Lᵀx + L⁻¹q and B = L⁻¹Aᵀ this is the point of least distance from the origin,
min |y| s.t. Bᵀy ≤ b + BᵀL⁻¹q = h, whose dual is one nonnegative least squares problem (Lawson and
Hanson 1974, ch. 23.4): with u ≥ 0 that minimises |[B; hᵀ] u + e|, e the last unit vector, and ρ its
residual, y = −ρ_y / ρ_e, and u / ρ_e are the multipliers. Active rows are exact, to rounding.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import nnls

from runtime.excitation.search.conic import Block
from runtime.library import Array

_EMPTY = 1e-12
"""Residual ρ_e below which the rows leave no point, to rounding."""


class QuadraticProgramme:
    """Objective ½ xᵀP x + qᵀx, factored once for any number of sets of rows."""

    def __init__(self, quadratic: Array, linear: Array) -> None:
        """Factor the objective."""
        self._factor, status = lapack.dpotrf(quadratic, lower=True, clean=True)
        self.is_convex = status == 0
        """P is positive definite."""
        self._shift = self._lower(linear) if self.is_convex else linear
        self._size = float(np.linalg.norm(self._shift)) or 1.0

    def solve(self, blocks: Sequence[Block]) -> tuple[Array, list[Array]] | None:
        """Solve for blocks of rows b − A x ≥ 0."""
        if not self.is_convex:
            return None
        a, b = (np.concatenate([getattr(one, name) for one in blocks]) for name in ("a", "b"))
        images = self._lower(a.T)
        # In units of |L⁻¹q|, which |y| does not exceed where x = 0 is admissible: ρ_e ≥ ½ then.
        heights = (b + self._shift @ images) / self._size
        target = np.append(np.zeros(len(images)), -1.0)
        try:
            u = nnls(np.vstack([images, heights]), target)[0]
        except RuntimeError:  # more iterations than three per row
            return None
        remaining = 1.0 + heights @ u
        if not remaining > _EMPTY:
            return None
        multipliers = u * (self._size / remaining)
        y = -(images @ multipliers)
        x = lapack.dtrtrs(self._factor, y - self._shift, lower=True, trans=True)[0]
        ends = np.cumsum([len(one.b) for one in blocks])[:-1]
        return x, np.split(multipliers, ends)

    def _lower(self, right: Array) -> Array:
        """Solution X of L X = B."""
        return np.asarray(lapack.dtrtrs(self._factor, right, lower=True)[0])
