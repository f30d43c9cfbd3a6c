"""The one posterior of linear rows: estimate, covariance, and the directions that rows determine.

    A x = b + e,   e ~ N(0, 1):   C = (AᵀA)⁺ = R Rᵀ,   x̂ = C Aᵀ b,   A R orthonormal

Rows are over their noise; a prior of some unknowns is further rows, diag(1/σ). The singular value
decomposition is that of the triangle of A over columns of length one: no Gram matrix squares the
condition, and neither x̂ nor the rank depends on units. Directions that are absent have no part in
R. With a prior x ~ N(0, R₀ R₀ᵀ) of all unknowns nothing is absent, and in its units the information
is 1 + (A R₀)ᵀ(A R₀), which has no cancellation:

    A R₀ = U Σ Vᵀ:   R = R₀ V (1 + Σ²)^-½,   x̂ = R (1 + Σ²)^-½ Σ Uᵀ b

Source: least squares by orthogonal factors (Golub & Van Loan, Sec. 5.5); Bayes' rule.
"""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array

ROUNDING = 1e-9  # singular value over the largest below which a measured direction is rounding
APART = 1e-6  # the same for columns less others: rounding × condition of the others
INVOLVED = 1e-6
"""Share of an unknown in an absent direction above which it is not determined: the square root of
rounding, 1e-8, with a margin."""
DETERMINED = 0.1  # posterior over prior variance below which the data determine a parameter


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Normal posterior of p unknowns of linear rows."""

    mean: Array  # x̂, (p,), or (p, k) of k right-hand sides, of least length; 0 without one
    root: Array  # R, C = R Rᵀ, (p, r)
    sizes: Array  # singular values of the unit columns, or in units of the prior, descending
    absent: Array  # scaled directions that the rows do not determine, (p − r, p); none with a prior
    prior_root: Array  # R₀, (p, q); empty without a prior of all unknowns

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
    def share(self) -> Array:
        """Posterior over prior variance of every unknown, (p,), in (0, 1]."""
        return np.minimum(np.sum(self.root**2, axis=1) / np.sum(self.prior_root**2, axis=1), 1.0)

    @property
    def determined(self) -> int:
        """Number of directions in which the rows carry ten times the information of the prior."""
        return int(np.sum(1 / (1 + self.sizes**2) < DETERMINED))

    def share_of(self, matrix: Array) -> Array:
        """Posterior over prior variance of linear combinations (m, p) of the unknowns, (m,)."""
        after = np.sum((matrix @ self.root) ** 2, axis=1)
        return np.asarray(after / np.sum((matrix @ self.prior_root) ** 2, axis=1))

    def step(self, slope: Array) -> Array:
        """Newton step C g from the slope g, (p,)."""
        return np.asarray(self.root @ (self.root.T @ slope))


def posterior_of(
    rows: Array,
    target: Array | None = None,
    *,
    prior: Array | None = None,
    rank: float = ROUNDING,
    lengths: Array | None = None,
    least: float = 0.0,
    is_wide: bool = False,
) -> Posterior:
    """Posterior of the unknowns of linear rows A, with a prior R₀ of all unknowns or without.

    Rows (N, n, p) are those of joints, each of which uses a part of the columns only; a target is
    (m,), (m, k) or (N, n). Singular values are relative to the largest, or to `least` where it is
    larger; `lengths` are those of the columns before others were taken out of them. With `is_wide`
    absent directions stay at the value that decides, whose σ every threshold rejects.
    """
    p, whole = rows.shape[-1], rows
    if target is not None:
        aim = target if target.ndim == rows.ndim else target[..., None]
        whole = np.concatenate([rows, aim], axis=-1)
    if rows.ndim == 3:
        whole = triangle_of_joints(whole)
    elif len(whole) > whole.shape[1]:
        whole = np.asarray(np.linalg.qr(whole, mode="r"))
    norms = np.linalg.norm(whole[:, :p], axis=0) if lengths is None else lengths
    scale = np.diag(1 / np.where(norms > 0, norms, 1.0)) if prior is None else prior
    space, sizes, turn = np.linalg.svd(whole[:, :p] @ scale)
    sizes = np.pad(sizes, (0, scale.shape[1] - len(sizes)))
    if prior is None:
        floor = rank * max(float(sizes.max(initial=1e-300)), least)
        count = p if is_wide else int(np.sum(sizes > floor))
        spread = np.maximum(sizes, floor)[:count]
    else:
        count, spread = len(sizes), np.sqrt(1 + sizes**2)
    root = scale @ turn[:count].T / spread
    used = min(count, len(space))
    along = (sizes[:used] / spread[:used])[:, None] * (space.T @ whole[:, p:])[:used]
    mean = root[:, :used] @ along
    if target is None or target.ndim < rows.ndim or rows.ndim == 3:
        mean = mean.sum(axis=1)
    none = np.zeros((p, 0)) if prior is None else prior
    return Posterior(mean, root, sizes[:count], turn[count:], none)


def least_squares(matrix: Array, target: Array) -> tuple[Array, Array]:
    """Least squares with unit columns: x of least length, and b − A x; b (m,) or (m, k)."""
    x = posterior_of(matrix, target).mean
    return x, np.asarray(target - matrix @ x)


def orthonormal(
    columns: Array, rank: float = ROUNDING, lengths: Array | None = None, least: float = 0.0
) -> Array:
    """Orthonormal basis A R of columns (m, p), to rounding over `rank`: (m, at most p)."""
    return np.asarray(columns @ posterior_of(columns, rank=rank, lengths=lengths, least=least).root)


def triangle_of_joints(rows: Array) -> Array:
    """Triangle R (p, p), RᵀR = Σ_j X_jᵀ X_j, joint by joint: each uses some of the columns."""
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

    with the columns u that the joint uses: rows X (N, n, p), root M (p, r) → (N, n, k).
    """
    used = np.any(rows, axis=0)
    factors = [np.asarray(np.linalg.qr(root[each].T, mode="r")).T for each in used]
    basis = np.zeros((*rows.shape[:2], max(each.shape[1] for each in factors)))
    for j, factor in enumerate(factors):
        basis[:, j, : factor.shape[1]] = rows[:, j][:, used[j]] @ factor
    return basis
