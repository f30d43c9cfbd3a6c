"""Linear systems on symbols by rotations of rows: no pivots, no branches.

Q A = U with an upper triangle U of positive diagonal but for its last entry, which has the sign of
det A. Source: Golub & Van Loan, Matrix Computations, 4th ed., Sec. 5.2.5. Not to be differentiated:
at a pair of zeros the rotation has no derivative.
"""

from dataclasses import dataclass

import casadi as ca

from symgen.kernel import Matrix

_TINY = 1e-150
"""Makes the rotation of a pair of zeros the identity, and changes nothing else."""


@dataclass(frozen=True, slots=True)
class Triangle:
    """A square system after elimination.

    Attributes:
        upper: (r, r) U.
        right: (r, m) Q b, with Q A = U.
    """

    upper: Matrix
    right: Matrix

    @property
    def margin(self) -> Matrix:
        """det A of columns of unit length: ±1 for orthogonal columns, 0 for a singular matrix."""
        share = ca.SX(1)
        for k in range(self.upper.shape[0]):
            column = self.upper[: k + 1, k]
            share = share * self.upper[k, k] / ca.sqrt(ca.dot(column, column) + _TINY**2)
        return share

    def solution(self) -> Matrix:
        """A⁻¹ b, (r, m)."""
        r = self.upper.shape[0]
        x = ca.SX(*self.right.shape)
        for k in reversed(range(r)):
            after = ca.mtimes(self.upper[k, k + 1 :], x[k + 1 :, :]) if k + 1 < r else 0
            x[k, :] = (self.right[k, :] - after) / self.upper[k, k]
        return x


def triangle(matrix: Matrix, right: Matrix) -> Triangle:
    """Eliminate a square system."""
    r = matrix.shape[0]
    upper, turned = ca.SX(matrix), ca.SX(right)
    for k in range(r):
        for i in range(k + 1, r):
            if upper[i, k].is_zero():
                continue
            a, b = upper[k, k] + _TINY, upper[i, k]
            share = 1 / ca.sqrt(a * a + b * b)
            c, s = a * share, b * share
            for m in (upper, turned):
                m[k, :], m[i, :] = c * m[k, :] + s * m[i, :], c * m[i, :] - s * m[k, :]
            upper[i, k] = 0
    return Triangle(upper, turned)
