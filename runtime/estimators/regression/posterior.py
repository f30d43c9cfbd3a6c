"""The one posterior of linear rows: estimate, covariance, and the directions that rows determine.

    A x = b + e,   e ~ N(0, 1):   C = (AᵀA)⁺ = R Rᵀ,   x̂ = C Aᵀ b,   A R orthonormal

Rows are over their noise; a prior of x is further rows, diag(1/σ). The singular value decomposition
is that of the triangle of A over columns of length one: no Gram matrix squares the condition, and
neither x̂ nor the rank depends on units. Directions that are absent have no part in R.
Source: least squares by orthogonal factors (Golub & Van Loan, Sec. 5.5).
"""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array

ROUNDING = 1e-9
"""Singular value over the largest, below which a direction of measured columns is rounding."""
APART = 1e-6
"""The same for columns that others were taken out of: rounding × condition of the others."""
INVOLVED = 1e-6
"""Share of an unknown in an absent direction above which it is not determined: the square root of
rounding, 1e-8, with a margin."""


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Normal posterior of p unknowns of linear rows.

    Attributes:
        mean: x̂ of least length over unit columns, (p,), or (p, k) of k right-hand sides; empty
            without one.
        root: R, C = R Rᵀ, (p, r).
        lengths: of the columns, 1 where they are zero, (p,).
        sizes: singular values of the unit columns in the r directions, descending.
        absent: directions of the unit columns that the rows do not determine, (p − r, p).
    """

    mean: Array
    root: Array
    lengths: Array
    sizes: Array
    absent: Array

    @property
    def covariance(self) -> Array:
        """C, (p, p); zero in absent directions."""
        return np.asarray(self.root @ self.root.T)

    @property
    def sigma(self) -> Array:
        """Standard deviations, (p,); NaN where an unknown is not determined."""
        involved = np.linalg.norm(self.absent, axis=0) > INVOLVED
        return np.where(involved, np.nan, np.linalg.norm(self.root, axis=1))

    @property
    def wide_root(self) -> Array:
        """R with a standard deviation of 1/`ROUNDING` in absent directions, (p, p)."""
        floor = ROUNDING * float(self.sizes.max(initial=np.finfo(float).tiny ** 0.25))
        return np.hstack([self.root, self.absent.T / floor / self.lengths[:, None]])

    def step(self, slope: Array) -> Array:
        """Newton step C g.

        Args:
            slope: g, (p,).
        """
        return np.asarray(self.root @ (self.root.T @ slope))


def posterior_of(
    rows: Array,
    target: Array | None = None,
    *,
    rank: float = ROUNDING,
    lengths: Array | None = None,
    least: float = 0.0,
) -> Posterior:
    """Posterior of the unknowns of linear rows.

    Args:
        rows: A over the noise, (m, p); (N, n, p) of joints, each of which uses a part of the
            columns only.
        target: b over the noise, (m,), (m, k) or (N, n).
        rank: singular value of unit columns, relative to the largest, below which a direction is
            absent.
        lengths: of the columns before others were taken out of them, (p,); default is theirs.
        least: the same decision as if the largest singular value were this one at least.

    Returns:
        The posterior.
    """
    p = rows.shape[-1]
    whole = rows if target is None else np.concatenate([rows, _columns_of(target, rows)], axis=-1)
    if rows.ndim == 3:
        whole = triangle_of_joints(whole)
    elif len(whole) > whole.shape[1]:
        whole = np.asarray(np.linalg.qr(whole, mode="r"))
    unit, aim = whole[:, :p], whole[:, p:]
    own = np.linalg.norm(unit, axis=0) if lengths is None else lengths
    own = np.where(own > 0, own, 1.0)
    space, sizes, turn = np.linalg.svd(unit / own)
    present = sizes > rank * max(float(sizes.max(initial=1e-300)), least)
    count = int(present.sum())
    root = turn[:count].T / sizes[:count] / own[:, None]
    mean = root @ (space[:, :count].T @ aim)
    shape = (0,) if target is None else (p,) if target.ndim < rows.ndim else mean.shape
    return Posterior(mean.reshape(shape), root, own, sizes[:count], turn[count:])


def _columns_of(target: Array, rows: Array) -> Array:
    return target if target.ndim == rows.ndim else target[..., None]


def least_squares(matrix: Array, target: Array) -> tuple[Array, Array]:
    """Least squares with unit columns: x of least length, and the residual b − A x.

    matrix (m, p), target (m,) or (m, k) → (p,) or (p, k), as target.
    """
    x = posterior_of(matrix, target).mean
    return x, np.asarray(target - matrix @ x)


def orthonormal(
    columns: Array, rank: float = ROUNDING, lengths: Array | None = None, least: float = 0.0
) -> Array:
    """Orthonormal basis A R of columns, to rounding over `rank`, without absent directions.

    columns (m, p) → (m, at most p).
    """
    return np.asarray(columns @ posterior_of(columns, rank=rank, lengths=lengths, least=least).root)


def triangle_of_joints(rows: Array) -> Array:
    """Triangle R with RᵀR = Σ_j X_jᵀ X_j, joint by joint: each uses a part of the columns only.

    rows (N, n, p) → (p, p).
    """
    _, n, p = rows.shape
    parts = [np.zeros((p, p))]
    for j in range(n):
        block = rows[:, j]
        used = block.any(axis=0)
        factor = np.linalg.qr(block[:, used], mode="r")
        parts.append(np.zeros((len(factor), p)))
        parts[-1][:, used] = factor
    return np.asarray(np.linalg.qr(np.vstack(parts[::-1]), mode="r"))


def basis_of_joints(rows: Array, root: Array) -> Array:
    """Q with the sums of squares of X M over the columns, joint by joint, and with fewer columns.

        Q_j Q_jᵀ = X_j M Mᵀ X_jᵀ,   Q_j = X_ju L,   L Lᵀ = M_u M_uᵀ

    with the columns u that the joint uses.

    rows (N, n, p), root (p, r) → (N, n, k).
    """
    used = np.any(rows, axis=0)
    factors = [np.asarray(np.linalg.qr(root[each].T, mode="r")).T for each in used]
    basis = np.zeros((*rows.shape[:2], max(each.shape[1] for each in factors)))
    for j, factor in enumerate(factors):
        basis[:, j, : factor.shape[1]] = rows[:, j][:, used[j]] @ factor
    return basis
