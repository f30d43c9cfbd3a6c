"""Constraints at the samples of a grid, as g(a) ≤ 0 of the coefficients.

Jacobian rows are computed on demand. Every derivative of the motion is linear in a:
∂g/∂a_jm = Σ_d ∂g/∂q_j^(d) φ_m^(d)(t).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from runtime.excitation.limits.dependent_joints import DependentPosition, DependentVelocity
from runtime.excitation.limits.distance_limits import TipSpeed
from runtime.excitation.limits.nonlinear_limits import Braking, Constraint
from runtime.excitation.limits.torque_limits import Torque, TorqueRate
from runtime.library import Array

NEAR = -0.35
"""Rows above this value are linearised; what lies lower stays below 0 within a step."""


def spared(constraint: Constraint, share: float) -> float:
    """Amount by which g is raised so that g ≤ 0 leaves a share of the limit unused."""
    if isinstance(constraint, TipSpeed):
        return (1 - share**2) / 2
    uses = Braking | Torque | TorqueRate | DependentPosition | DependentVelocity
    return 1 - share if isinstance(constraint, uses) else 0.0


def unit_of(constraint: Constraint, share: float) -> float:
    """Part of the limit that is the unit of g, so that g is use − 1 of the share.

    Coefficients at the bounds are as small as the share. In units of the whole limit a motion far
    beyond the share of another one has a small g, and a penalty that outweighs the cost for whole
    limits does not outweigh it.
    """
    return share**2 if isinstance(constraint, TipSpeed) else share


class LimitRows:
    """Values g(a) of constraints on a grid, (R, N) per constraint, one after another.

    With a share, g is in units of the share: (use − share) / share.
    """

    def __init__(
        self,
        constraints: Sequence[Constraint],
        home: Array,
        basis: Array,
        half: bool,
        tightened: float = 0.0,
        share: float = 1.0,
    ) -> None:
        """Rows of constraints on a grid."""
        self._constraints, self._home, self._basis = tuple(constraints), home, basis
        self._tightened = tightened
        self._spared = [spared(each, share) for each in self._constraints]
        self._units = [unit_of(each, share) for each in self._constraints]
        middle = (len(basis) + 1) // 2
        # The merit comes first and the rows of the same point after it: values are computed once.
        self._seen: tuple[Array, list[Array]] = np.zeros(0), []
        self._counts = [
            middle if half and constraint.even else len(basis) for constraint in self._constraints
        ]

    def motion(self, a: Array) -> Array:
        """Values q, dq, ddq, dddq on the grid, (4, N, n)."""
        motion = np.tensordot(self._basis, a, axes=(1, 1)).transpose(1, 0, 2)
        motion[0] += self._home
        return motion

    def by_constraint(self, a: Array) -> list[Array]:
        """Values g per constraint, (R, N) each."""
        if not self._constraints:  # a long grid of the motion takes a gigabyte for nothing
            return []
        if not np.array_equal(self._seen[0], a):
            motion = self.motion(a)
            parts = [
                (constraint.values(motion[:, :count]).T + more) / unit + self._tightened
                for constraint, count, more, unit in zip(
                    self._constraints, self._counts, self._spared, self._units, strict=True
                )
            ]
            self._seen = a.copy(), parts
        return list(self._seen[1])

    def values(self, a: Array) -> Array:
        """All values g, one constraint after another."""
        parts = [values.ravel() for values in self.by_constraint(a)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def worst(self, a: Array) -> float:
        """Largest g; −1 where there are no constraints."""
        return float(self.values(a).max(initial=-1.0))

    def linearised(self, a: Array, near: float = NEAR) -> tuple[NDArray[np.intp], Array, Array]:
        """Rows that a step could violate.

        a (n, M) → (m,).
        """
        values = self.values(a)
        chosen = np.flatnonzero(values > near)
        return chosen, values[chosen], self.jacobian(a, chosen)

    def jacobian(self, a: Array, chosen: NDArray[np.intp]) -> Array:
        """Slopes ∂g/∂vec(a) of chosen rows.

        a (n, M), chosen (m,) → (m, n M).
        """
        motion = self.motion(a)
        blocks, first = [np.zeros((0, a.size))], 0
        for constraint, count, unit in zip(
            self._constraints, self._counts, self._units, strict=True
        ):
            last = first + count * len(constraint.labels)
            row, sample = np.divmod(chosen[(chosen >= first) & (chosen < last)] - first, count)
            first = last
            if not row.size:
                continue
            samples, back = np.unique(sample, return_inverse=True)
            slopes = constraint.slopes(motion[:, samples])[back, row] / unit  # (rows, orders, n)
            basis = self._basis[sample][:, :, : constraint.orders]
            # Chain rule over the derivatives of the motion: Σ_d ∂g/∂q^(d) φ^(d), (rows, M, n).
            chain = np.matmul(basis, slopes)
            blocks.append(chain.transpose(0, 2, 1).reshape(len(row), -1))
        return np.concatenate(blocks)

    def strongest(self, a: Array, count: int = 2) -> list[str]:
        """Names of the rows with the largest g, each of another constraint or joint."""
        named = [
            (float(g), f"{constraint.kind} ({label})")
            for constraint, values in zip(self._constraints, self.by_constraint(a), strict=True)
            for label, g in zip(constraint.labels, values.max(axis=1), strict=True)
        ]
        return [name for _, name in sorted(named, reverse=True)[:count]]
