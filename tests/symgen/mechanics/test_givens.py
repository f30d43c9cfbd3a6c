"""Linear systems by rotations of rows; oracles are numpy's solve and det."""

import casadi as ca
import numpy as np
import pytest

from symgen.mechanics.loop_equations import triangle


@pytest.mark.parametrize("size", [1, 2, 4])
def test_solution_and_margin_are_those_of_numpy(size: int) -> None:
    """Oracle: A⁻¹ b, and det A over the lengths of its columns; a swap of rows turns its sign."""
    rng = np.random.default_rng(size)
    a, b = rng.normal(size=(size, size)), rng.normal(size=(size, 2))
    for matrix in (a, a[::-1]):
        system = triangle(ca.DM(matrix), ca.DM(b))
        # Rounding over a condition of some tens.
        np.testing.assert_allclose(value(system.solution()), np.linalg.solve(matrix, b), rtol=1e-12)
        expected = np.linalg.det(matrix / np.linalg.norm(matrix, axis=0))
        np.testing.assert_allclose(value(system.margin), [[expected]], rtol=1e-12)


def test_zeros_on_the_diagonal_need_no_pivot() -> None:
    """Oracle: a cyclic permutation, of det 1, turned back by hand; an entry of zero is left."""
    matrix = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    x, rows = ca.SX.sym("x"), [ca.SX(ca.DM(row)).T for row in matrix]
    system = triangle(ca.vertcat(*rows) * x, ca.SX(ca.DM([[2.0], [4.0], [6.0]])))
    solved = ca.Function("solved", [x], [system.solution(), system.margin, system.upper])
    solution, margin, upper = (np.asarray(part) for part in solved(2.0))
    np.testing.assert_allclose(solution, [[3.0], [1.0], [2.0]], rtol=1e-15)
    np.testing.assert_allclose(margin, [[1.0]], rtol=1e-15)
    np.testing.assert_allclose(upper, 2 * np.eye(3), atol=1e-15)


def test_a_singular_matrix_has_no_margin() -> None:
    """Oracle: two equal columns have det 0, and a column of zeros is divided by no zero."""
    equal = triangle(ca.DM([[3.0, 3.0], [4.0, 4.0]]), ca.DM([[1.0], [1.0]]))
    np.testing.assert_allclose(value(equal.margin), [[0.0]], atol=1e-15)
    absent = triangle(ca.DM([[0.0, 1.0], [0.0, 1.0]]), ca.DM([[1.0], [1.0]]))
    assert value(absent.margin) == 0.0


def test_a_pair_of_zeros_is_not_turned() -> None:
    """Property: rows whose entries of a column come out as zeros stay as they are, and finite."""
    x = ca.SX.sym("x")
    system = triangle(ca.vertcat(ca.horzcat(x, 3), ca.horzcat(x, 5)), ca.SX(ca.DM([1.0, 2.0])))
    turned = ca.Function("turned", [x], [ca.horzcat(system.upper, system.right)])(0.0)
    np.testing.assert_array_equal(np.asarray(turned), [[0.0, 3.0, 1.0], [0.0, 5.0, 2.0]])


def value(matrix: ca.SX) -> np.ndarray:
    return np.asarray(ca.evalf(ca.SX(matrix)))
