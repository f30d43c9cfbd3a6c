"""Rotations, 3-vectors and the pose of one joint on CasADi `SX | DM`.

Every function is an expression, so one definition serves symbols and numbers.
Source: document Sec. 2.1–2.2 with its errata (logarithm through the quaternion, 0 ≤ θ ≤ π).
"""

from dataclasses import dataclass

import casadi as ca

from symgen.chain import Joint
from symgen.chain.model import FLOATING
from symgen.kernel import Matrix

_LEAST_ANGLE = 1e-100  # rad; keeps 1/θ finite at θ = 0 and changes nothing else
_HALF_TURN = 1e-15  # magnitude of the quaternion's scalar (or vector) part that counts as zero
_JACOBI_SWEEPS = 6
"""Sweeps after which cyclic Jacobi has converged for every 3×3 matrix, by its quadratic rate."""


@dataclass(frozen=True, slots=True)
class Pose:
    """R and p of a frame in its parent's frame, and the joint axis in the frame itself."""

    rotation: Matrix
    translation: Matrix
    axis: Matrix


def exp_so3(omega: Matrix) -> Matrix:
    """R = I + A [ω×] + B [ω×]² (Eq. 2.7), with the coefficients of `so3_coefficients`."""
    a, b, _ = so3_coefficients(omega)
    cosine = 1 - b * ca.dot(omega, omega)
    rotation = ca.diag(ca.vertcat(cosine, cosine, cosine)) + a * ca.skew(omega)
    for i in range(3):
        for j in range(i + 1):
            product = b * (omega[i] * omega[j])  # of [ω×]² = ω ωᵀ − θ² 1, once for both places
            rotation[i, j] += product
            if j < i:
                rotation[j, i] += product
    return rotation


def so3_coefficients(omega: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """A = sin θ / θ, B = (1 − cos θ)/θ² and C = (1 − A)/θ², θ = |ω|.

    B and C are those of the right Jacobian 1 − B [ω×] + C [ω×]² of the exponential (Solà, Deray,
    Atchuthan, A micro Lie theory, 2018, Appendix B). The chord 2 sin(θ/2)/θ is computed without
    cancellation, so A and B are exact to rounding. C and the derivatives of A and B lose digits as
    1/θ² and 1/θ, but they are always multiplied by θ² and θ. `_LEAST_ANGLE` keeps them finite at 0,
    where other implementations use a series.
    """
    theta = ca.sqrt(ca.dot(omega, omega) + _LEAST_ANGLE**2)
    share = 1 / theta
    chord = 2 * ca.sin(theta / 2) * share
    a = chord * ca.cos(theta / 2)
    return a, chord * chord / 2, (1 - a) * share * share


def _shepperd_quaternion(rotation: Matrix) -> Matrix:
    """Unit quaternion (w, x, y, z) from the largest of trace and diagonal (Shepperd 1978)."""
    r = rotation
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    off = [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]
    best = ca.vertcat(1 + trace, *off)
    largest = trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        v: list[Matrix] = [0, 0, 0]
        v[i] = 1 + r[i, i] - r[j, j] - r[k, k]
        v[j] = r[i, j] + r[j, i]
        v[k] = r[i, k] + r[k, i]
        better = r[i, i] > largest
        best = ca.if_else(better, ca.vertcat(off[i], *v), best)
        largest = ca.if_else(better, r[i, i], largest)
    return best / ca.norm_2(best)


def log_so3(rotation: Matrix) -> Matrix:
    """ω with exp(ω) = R, |ω| ≤ π, by the quaternion; at π the first non-zero entry is above 0."""
    quaternion = _shepperd_quaternion(rotation)
    w, v = quaternion[0], quaternion[1:4]
    first = v[2]
    for i in (1, 0):
        first = ca.if_else(ca.fabs(v[i]) > _HALF_TURN, v[i], first)
    at_pi = ca.fabs(w) < _HALF_TURN
    flip = ca.if_else(at_pi, first < 0, w < 0)
    sign = ca.if_else(flip, -1.0, 1.0)
    w, v = ca.fabs(w), sign * v
    norm = ca.norm_2(v)
    tiny = norm < _HALF_TURN
    scale = ca.if_else(tiny, 2.0, 2 * ca.atan2(norm, w) / ca.if_else(tiny, 1.0, norm))
    return scale * v


def axis_rotation(axis: Matrix, angle: Matrix) -> Matrix:
    """Rodrigues' rotation about a constant unit axis; zeros of the axis stay structural zeros."""
    s, c = ca.sin(angle), ca.cos(angle)
    return ca.DM.eye(3) * c + ca.skew(axis) * s + ca.mtimes(axis, axis.T) * (1 - c)


def symmetric_eigen(matrix: Matrix) -> tuple[Matrix, Matrix]:
    """S = R diag(J) Rᵀ of a symmetric 3×3 matrix, J ascending, det R = +1.

    Cyclic Jacobi with a fixed number of sweeps: the iteration count does not depend on the data,
    equal eigenvalues need no special case, and small eigenvalues keep their digits.
    Columns 1 and 2 are signed so that their entry of largest magnitude is positive;
    column 3 = column 1 × column 2 (errata, rule of Table B.5).
    """
    a = [[matrix[i, j] for j in range(3)] for i in range(3)]
    columns = [ca.DM.eye(3)[:, i] for i in range(3)]
    # Each rotation in the plane (p, q) makes a[p][q] zero (Golub & Van Loan, Sec. 8.5.2).
    for _ in range(_JACOBI_SWEEPS):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            k = 3 - p - q
            zero = a[p][q] == 0  # guards the division; the rotation is then the identity
            tau = (a[q][q] - a[p][p]) / (2 * ca.if_else(zero, 1.0, a[p][q]))
            # t = tan of the smaller angle, the root of t² + 2 τ t − 1 = 0 without cancellation
            t = ca.if_else(tau < 0, -1.0, 1.0) / (ca.fabs(tau) + ca.sqrt(1 + tau * tau))
            t = ca.if_else(zero, 0.0, t)
            c = 1 / ca.sqrt(1 + t * t)
            s = t * c
            a[p][p], a[q][q] = a[p][p] - t * a[p][q], a[q][q] + t * a[p][q]
            kp, kq = a[k][p], a[k][q]
            a[k][p] = a[p][k] = c * kp - s * kq
            a[k][q] = a[q][k] = s * kp + c * kq
            a[p][q] = a[q][p] = 0
            columns[p], columns[q] = (
                c * columns[p] - s * columns[q],
                s * columns[p] + c * columns[q],
            )
    values = [a[i][i] for i in range(3)]
    for i, j in ((0, 1), (1, 2), (0, 1)):  # sort ascending: a network of three comparisons
        swap = values[j] < values[i]
        for each in (values, columns):
            first, second = ca.if_else(swap, each[j], each[i]), ca.if_else(swap, each[i], each[j])
            each[i], each[j] = first, second
    first, second = _signed(columns[0]), _signed(columns[1])
    return ca.vertcat(*values), ca.horzcat(first, second, ca.cross(first, second))


def _signed(v: Matrix) -> Matrix:
    """±v with the entry of largest magnitude positive."""
    largest = v[0]
    for i in (1, 2):
        largest = ca.if_else(ca.fabs(v[i]) > ca.fabs(largest), v[i], largest)
    return ca.if_else(largest < 0, -1.0, 1.0) * v


def joint_pose(joint: Joint, q: Matrix) -> Pose:
    """Pose of a joint's frame in its parent's frame; q has six entries for a free base."""
    rotation, translation = ca.SX(ca.DM(joint.rotation)), ca.SX(ca.DM(joint.translation))
    axis = ca.DM(joint.axis)
    if joint.kind == FLOATING:
        return Pose(exp_so3(q[3:]), q[:3], axis)
    if joint.kind == "prismatic":
        return Pose(rotation, translation + ca.mtimes(rotation, axis) * q, axis)
    return Pose(ca.mtimes(rotation, axis_rotation(axis, q)), translation, axis)
