"""Rotations at their singular points, and the 3×3 eigenproblem."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from symgen.mechanics.spatial import axis_rotation, exp_so3, log_so3, symmetric_eigen
from tests.taylor import Array, assert_second_order, taylor_slope

EPS = float(np.finfo(float).eps)

_omega = ca.SX.sym("omega", 3)
_matrix = ca.SX.sym("matrix", 3, 3)
EXP = ca.Function("exp", [_omega], [exp_so3(_omega)])
LOG = ca.Function("log", [_matrix], [log_so3(_matrix)])
SLOPE = ca.Function("slope", [_omega], [ca.jacobian(ca.vec(exp_so3(_omega)), _omega)])
EIGEN = ca.Function("eigen", [_matrix], list(symmetric_eigen(_matrix)))

AXES = [
    np.array(axis) / np.linalg.norm(axis)
    for axis in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (0, 3, 4), (-2, 1, 5), (0, -1, 1)]
]
ANGLES = [0.0, 1e-300, 1e-16, 1e-9, 0.01 - 1e-12, 0.01 + 1e-12, 1.0, 3.0, np.pi - 1e-7, np.pi]


def rotation(omega: Array) -> Array:
    return np.array(EXP(omega))


def logarithm(matrix: Array) -> Array:
    return np.array(LOG(matrix)).ravel()


def rodrigues(axis: Array, angle: float) -> Array:
    """The textbook form with a given axis, free of any division by θ."""
    k = np.cross(np.eye(3), axis)  # [axis×]
    return np.eye(3) + np.sin(angle) * k + 2 * np.sin(angle / 2) ** 2 * k @ k


@pytest.mark.parametrize("axis", AXES, ids=str)
@pytest.mark.parametrize("angle", ANGLES)
def test_exp_and_log_at_the_edges(axis: Array, angle: float) -> None:
    """Oracle: Rodrigues' formula; the logarithm finds the angle again from 0 to π."""
    omega = angle * axis
    r = rotation(omega)
    np.testing.assert_allclose(r, rodrigues(axis, angle), rtol=0, atol=4 * EPS)
    back = logarithm(r)
    assert np.linalg.norm(back) <= np.pi * (1 + EPS)
    # At θ = π the two ends ±ω are one rotation, and rounding of R decides which comes back.
    distance = np.abs(back - omega).max()
    if np.pi - angle < 1e-15:
        distance = min(distance, np.abs(back + omega).max())
    # R is rounded to EPS, θ is as well conditioned as R: the quaternion loses no digits.
    assert distance <= 8 * EPS * max(1.0, angle)


@pytest.mark.parametrize(
    ("diagonal", "positive"), [((1, -1, -1), 0), ((-1, 1, -1), 1), ((-1, -1, 1), 2)]
)
def test_log_of_an_exact_half_turn(diagonal: tuple[int, int, int], positive: int) -> None:
    """Oracle: a half turn about a coordinate axis is +π about it, without rounding."""
    expected = np.zeros(3)
    expected[positive] = np.pi
    np.testing.assert_array_equal(logarithm(np.diag(np.array(diagonal, dtype=float))), expected)


def test_log_of_a_half_turn_is_positive_first() -> None:
    """Property: at θ = π the first non-zero component is positive (errata to Eqs. 2.10–2.12)."""
    falling = ([0.0, -0.6, 0.8], [-0.6, 0.8, 0.0], [0.0, 0.0, -1.0], [-0.36, 0.48, 0.8])
    for v in (*falling, [0.6, 0.8, 0.0], [0.36, 0.48, 0.8]):
        axis = np.array(v)
        half_turn = 2 * np.outer(axis, axis) - np.eye(3)
        omega = logarithm(half_turn)
        assert omega[np.flatnonzero(np.abs(omega) > 1e-12)[0]] > 0
        np.testing.assert_allclose(rotation(omega), half_turn, rtol=0, atol=8 * EPS)


unit = st.floats(-1, 1)


@given(st.tuples(unit, unit, unit), st.floats(0, np.pi))
@example((0.0, 0.0, 1.0), 1e-160)
def test_log_inverts_exp(direction: tuple[float, float, float], angle: float) -> None:
    """Property: exp(log(exp(ω))) = exp(ω), orthogonal with determinant +1, for every ω."""
    norm = np.linalg.norm(direction)
    omega = np.array(direction) / norm * angle if norm > 1e-6 else np.zeros(3)
    r = rotation(omega)
    np.testing.assert_allclose(r @ r.T, np.eye(3), rtol=0, atol=8 * EPS)
    assert np.linalg.det(r) == pytest.approx(1.0, abs=8 * EPS)
    np.testing.assert_allclose(rotation(logarithm(r)), r, rtol=0, atol=16 * EPS)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.0099, 0.0101, 1.0, 3.1])
def test_exp_derivative(angle: float) -> None:
    """Derivative: of exp on both sides of the branch; finite at θ = 0, where it is [e_k×]."""
    omega = angle * AXES[5]
    slope = np.array(SLOPE(omega))
    assert np.isfinite(slope).all()
    if angle == 0.0:
        generators = [np.cross(np.eye(3), e).ravel(order="F") for e in np.eye(3)]
        np.testing.assert_allclose(slope, np.array(generators).T, rtol=0, atol=EPS)
    v = AXES[3]
    assert_second_order(taylor_slope(lambda w: rotation(w).ravel(order="F"), omega, v, slope @ v))


def test_exp_gradient_at_zero() -> None:
    """Derivative: reverse mode at θ = 0, where 0 · ∞ of the unused branch would be NaN."""
    seed = ca.DM(np.arange(9.0).reshape(3, 3))
    reverse = ca.jtimes(ca.vec(exp_so3(_omega)), _omega, ca.vec(seed), True)
    gradient = np.array(ca.Function("g", [_omega], [reverse])(np.zeros(3))).ravel()
    # ⟨S, [e_k×]⟩ picks differences of the seed's entries.
    s = np.array(seed)
    expected = [s[2, 1] - s[1, 2], s[0, 2] - s[2, 0], s[1, 0] - s[0, 1]]
    np.testing.assert_array_equal(gradient, expected)


def test_axis_rotation() -> None:
    """Oracle: Rodrigues' formula; the zeros of an aligned axis are structural."""
    for axis in AXES:
        ours = np.array(axis_rotation(ca.DM(axis), ca.DM(0.7)))
        np.testing.assert_allclose(ours, rodrigues(axis, 0.7), rtol=0, atol=2 * EPS)
    q = ca.SX.sym("q")
    assert axis_rotation(ca.sparsify(ca.DM([0, 0, 1])), q).nnz() == 5


entries = st.floats(-1e3, 1e3, allow_subnormal=False)


@given(st.lists(entries, min_size=6, max_size=6))
@example([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
@example([1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
@example([0.0] * 6)
@example([2.0, 1e-9, 0.0, 2.0, 1e-9, 2.0])
@example([1.0, 1e-200, 0.0, 1.0, 0.0, 3.0])
def test_symmetric_eigen(upper: list[float]) -> None:
    """Oracle: numpy.linalg.eigvalsh; property: S = R J Rᵀ, det R = +1, the sign rule."""
    a, b, c, d, e, f = upper
    s = np.array([[a, b, c], [b, d, e], [c, e, f]])
    values, vectors = (np.array(part) for part in EIGEN(s))
    values = values.ravel()
    # Jacobi is backward stable: every entry is right to rounding × the norm of S.
    scale = 32 * EPS * max(np.abs(s).max(), np.finfo(float).tiny)
    assert (np.diff(values) >= 0).all()
    np.testing.assert_allclose(values, np.linalg.eigvalsh(s), rtol=0, atol=scale)
    np.testing.assert_allclose(vectors @ np.diag(values) @ vectors.T, s, rtol=0, atol=scale)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(3), rtol=0, atol=32 * EPS)
    assert np.linalg.det(vectors) == pytest.approx(1.0, abs=32 * EPS)
    for column in vectors.T[:2]:
        largest = np.abs(column).max()
        assert column.max() >= largest * (1 - 4 * EPS)


def test_symmetric_eigen_keeps_small_eigenvalues() -> None:
    """Oracle: exact eigenvalues of a diagonal scaling; the small one keeps its digits."""
    s = np.array([[1.0, 0, 0], [0, 1e-6, 1e-9], [0, 1e-9, 1e-12]])
    values = np.array(EIGEN(s)[0]).ravel()
    # The 2×2 block has determinant 0 up to one rounding of 1e-18, so its eigenvalue is ≤ 1e-28.
    assert abs(values[0]) < 1e-27
    assert values[1] == pytest.approx(1e-6 + 1e-12, rel=4 * EPS)
