"""Dense linear algebra beyond `numpy.linalg`: triangular systems, Cholesky, pivoted QR.

LAPACK as `scipy.linalg` calls it, with the same results to the bit.
"""

from importlib import import_module

import numpy as np

from runtime.numerics import Array
from runtime.numerics.extension import extension

_USED = (
    *("dtrtrs", "dpotrf", "dpotri", "dpotrs", "dpocon"),
    *("dgeqp3", "dorgqr", "dgesdd", "dgesdd_lwork"),
)
lapack = extension("scipy.linalg._flapack", _USED) or import_module("scipy.linalg.lapack")
"""Functions of LAPACK by name."""


def block_diag(*blocks: Array) -> Array:
    """Matrix with the given ones on its diagonal."""
    whole = np.zeros(np.sum([block.shape for block in blocks], axis=0, dtype=int))
    row = column = 0
    for block in blocks:
        height, width = block.shape
        whole[row : row + height, column : column + width] = block
        row, column = row + height, column + width
    return whole


def solve_triangular(upper: Array, right: Array) -> Array:
    """Solution X of U X = B."""
    if not right.size:
        return np.zeros(right.shape)
    if upper.flags.f_contiguous:
        solution, info = lapack.dtrtrs(upper, right)
    else:  # the transpose is in the order of LAPACK
        solution, info = lapack.dtrtrs(upper.T, right, lower=True, trans=True)
    if info:
        raise np.linalg.LinAlgError(f"diagonal element {info} of a triangular matrix is zero")
    return np.asarray(solution)


def solve_positive(matrix: Array, right: Array) -> Array:
    """Solution x of A x = b by the Cholesky factor of A.

    matrix (n, n), right (n,) → (n,).
    """
    factor, info = lapack.dpotrf(matrix, lower=True, clean=False)
    if info:
        raise np.linalg.LinAlgError(f"leading minor {info} is not positive definite")
    return np.asarray(lapack.dpotrs(factor, right, lower=True)[0])


def pivoted_qr(matrix: Array) -> tuple[Array, Array, Array]:
    """Factors Q, R and the order p of A[:, p] = Q R, with falling |R_kk|.

    matrix (m, n) → (m, m).
    """
    rows, columns = matrix.shape
    # The first call of each returns the size of its work space, which changes the order of sums.
    work = int(lapack.dgeqp3(matrix, lwork=-1)[-2][0])
    packed, order, tau = lapack.dgeqp3(matrix, lwork=work)[:3]
    unit = np.empty((rows, rows))
    unit[:, :columns] = packed
    work = int(lapack.dorgqr(unit, tau, lwork=-1)[-2][0])
    q = lapack.dorgqr(unit, tau, lwork=work)[0]
    return q, np.triu(packed), order - 1


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


def null_space(matrix: Array) -> Array:
    """Orthonormal basis of the vectors z with A z = 0."""
    rows, columns = matrix.shape
    work = int(lapack.dgesdd_lwork(rows, columns)[0].real)
    _, sizes, turn, info = lapack.dgesdd(matrix, lwork=work)
    if info:
        raise np.linalg.LinAlgError("the singular values of a matrix do not converge")
    least = np.finfo(np.float64).eps * max(rows, columns) * np.max(sizes, initial=0.0)
    return np.asarray(turn[int(np.sum(sizes > least)) :].T)
