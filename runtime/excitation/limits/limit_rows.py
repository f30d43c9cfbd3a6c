"""Laws at the samples of a grid, as g(a) ≤ 0 of the coefficients with Jacobian rows on demand.

Every derivative of the motion is linear in a: ∂g/∂a_jm = Σ_d ∂g/∂q_j^(d) φ_m^(d)(t).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from runtime.excitation.limits.nonlinear_limits import Constraint
from runtime.library import Array

NEAR = -0.35
"""Rows above are linearised: what lies lower stays below 0 within a step."""


class LimitRows:
    """Values g(a) of constraints on a grid, (R, N) per constraint, one after another."""

    def __init__(
        self,
        constraints: Sequence[Constraint],
        home: Array,
        basis: Array,
        half: bool,
        tightened: float = 0.0,
    ) -> None:
        """Args:
        constraints: the limits.
        home: (n,) rad or m.
        basis: φ_m and three derivatives at times over the whole duration, (N, M, 4).
        half: the motion is its own mirror image; even constraints look at its first half.
        tightened: added to every g.
        """
        self._constraints, self._home, self._basis = tuple(constraints), home, basis
        self._tightened = tightened
        middle = (len(basis) + 1) // 2
        # A merit is asked first, the rows of the same point after it.
        self._seen: tuple[Array, list[Array]] = np.zeros(0), []
        self._counts = [
            middle if half and constraint.even else len(basis) for constraint in self._constraints
        ]

    def motion(self, a: Array) -> Array:
        """Q, dq, ddq, dddq on the grid, (4, N, n)."""
        motion = np.einsum("jm,tmd->dtj", a, self._basis, optimize=True)
        motion[0] += self._home
        return motion

    def by_constraint(self, a: Array) -> list[Array]:
        """G per constraint, (R, N) each."""
        if not np.array_equal(self._seen[0], a):
            motion = self.motion(a)
            parts = [
                constraint.values(motion[:, :count]).T + self._tightened
                for constraint, count in zip(self._constraints, self._counts, strict=True)
            ]
            self._seen = a.copy(), parts
        return list(self._seen[1])

    def values(self, a: Array) -> Array:
        """All g, one after another."""
        found = [values.ravel() for values in self.by_constraint(a)]
        return np.concatenate(found) if found else np.zeros(0)

    def worst(self, a: Array) -> float:
        """The largest g; −1 where there are no constraints."""
        return float(self.values(a).max(initial=-1.0))

    def linearised(self, a: Array, near: float = NEAR) -> tuple[NDArray[np.intp], Array, Array]:
        """Numbers, values and slopes (rows, n M) of the rows above `near`."""
        values = self.values(a)
        chosen = np.flatnonzero(values > near)
        return chosen, values[chosen], self.jacobian(a, chosen)

    def jacobian(self, a: Array, chosen: NDArray[np.intp]) -> Array:
        """∂g/∂vec(a) of the rows with these numbers, ascending, (rows, n M)."""
        motion = self.motion(a)
        found, first = [np.zeros((0, a.size))], 0
        for constraint, count in zip(self._constraints, self._counts, strict=True):
            last = first + count * len(constraint.labels)
            row, sample = np.divmod(chosen[(chosen >= first) & (chosen < last)] - first, count)
            first = last
            if not row.size:
                continue
            samples, back = np.unique(sample, return_inverse=True)
            slopes = constraint.slopes(motion[:, samples])[back, row]  # (rows, orders, n)
            basis = self._basis[sample][:, :, : constraint.orders]
            chain = np.matmul(basis, slopes)  # (rows, M, n)
            found.append(chain.transpose(0, 2, 1).reshape(len(row), -1))
        return np.concatenate(found)

    def strongest(self, a: Array, count: int = 2) -> list[str]:
        """The rows with the largest g, each of another constraint or joint, largest first."""
        found = [
            (float(g), f"{constraint.kind} ({label})")
            for constraint, values in zip(self._constraints, self.by_constraint(a), strict=True)
            for label, g in zip(constraint.labels, values.max(axis=1), strict=True)
        ]
        return [name for _, name in sorted(found, reverse=True)[:count]]
