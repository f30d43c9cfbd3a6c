"""Robots of modified DH rows: kinematics against the product of matrices, and refusals."""

import casadi as ca
import numpy as np
import pytest

from symgen.chain import ChainOptions, read_chain
from symgen.chain.dh import robot_from_rows
from symgen.errors import UrdfError
from symgen.mechanics.kinematics import link_poses

ROWS = {
    "name": "arm",
    "independent": ["q3", "q1"],
    "link": [
        {"name": "one", "a": 0.1, "alpha": 0.3, "d": -0.2, "theta": 0.4, "joint": "q1"},
        {"name": "two", "parent": "one", "a": 0.2, "alpha": -1.2, "d": 0.1, "of": {"q1": -2.0}},
        {"name": "plate", "parent": "two", "a": 0.05, "alpha": 0.7, "theta": -0.3, "d": 0.02},
        {"name": "three", "parent": "plate", "alpha": 1.1, "theta": 0.2, "joint": "q3",
         "kind": "prismatic"},
    ],
}  # fmt: skip


def matrix(a: float, alpha: float, d: float, theta: float) -> np.ndarray:
    """Rot_x(α) Trans_x(a) Rot_z(θ) Trans_z(d), written out (Craig, eq. 3.6)."""
    ct, st, cal, sal = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [ct, -st, 0, a],
            [st * cal, ct * cal, -sal, -sal * d],
            [st * sal, ct * sal, cal, cal * d],
            [0, 0, 0, 1],
        ]
    )


def test_rows_give_their_transforms() -> None:
    """Oracle: the product of the matrices of the textbook, with coupling and fixed row."""
    text, mechanism = robot_from_rows(ROWS, "test")
    chain = read_chain(text, ChainOptions(masses={}, mechanism=mechanism))
    assert [joint.name for joint in chain.coordinates] == ["q3", "q1"]
    q = ca.SX.sym("q", 2)
    slide, turn = 0.15, 0.7
    poses = np.asarray(ca.Function("f", [q], [link_poses(chain, q)])([slide, turn]))
    one = matrix(0.1, 0.3, -0.2, 0.4 + turn)
    two = one @ matrix(0.2, -1.2, 0.1, -2 * turn)
    three = two @ matrix(0.05, 0.7, 0.02, -0.3) @ matrix(0.0, 1.1, slide, 0.2)
    expected = np.vstack([one, two, three])
    np.testing.assert_allclose(poses, expected, atol=1e-14)


def test_rows_state_limits() -> None:
    """Property: limits of a slide, of a joint with a master, which count for it, and of a joint
    that turns without end.
    """
    rows = [
        {"name": "a", "joint": "q1", "velocity": 2.0, "effort": 9.0},
        {"name": "b", "of": {"q1": 2.0}, "lower": -1.0, "upper": 3.0},
        {"name": "c", "joint": "q3", "kind": "prismatic", "lower": 0.0, "upper": 0.2},
    ]
    text, mechanism = robot_from_rows({"link": rows}, "test")
    turn, slide = read_chain(text, ChainOptions(masses={}, mechanism=mechanism)).coordinates
    assert (turn.lower, turn.upper, turn.velocity, turn.effort) == (-0.5, 1.5, 2.0, 9.0)
    assert (slide.lower, slide.upper, slide.velocity) == (0.0, 0.2, None)


REFUSED = {
    "limits of a fixed row": (
        {"link": [{"name": "a", "upper": 1.0}]},
        "'a' is fixed and has upper",
    ),
    "no rows": ({"name": "x"}, r"tables \[\[link\]\]"),
    "unknown parent": (
        {"link": [{"name": "a", "joint": "q"}, {"name": "b", "parent": "c"}]},
        "'c'",
    ),
    "two of a name": ({"link": [{"name": "a", "joint": "q"}] * 2}, "occurs twice"),
    "joint and of": ({"link": [{"name": "a", "joint": "q", "of": {"q": 1.0}}]}, "joint and of"),
    "unknown kind": ({"link": [{"name": "a", "joint": "q", "kind": "screw"}]}, "'screw'"),
    "word": (
        {"link": [{"name": "a", "joint": "q", "d": "long"}]},
        r"link\[0\].d expects a number, got 'long'; correct it",
    ),
    "unknown key": ({"link": [{"name": "a", "joint": "q", "length": 1.0}]}, "unknown key 'length'"),
    "no name": ({"link": [{"joint": "q"}]}, r"expects the key name in link\[0\], got none; add it"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_row_is_refused(case: str) -> None:
    """Property: one sentence that names the row and the key."""
    table, sentence = REFUSED[case]
    with pytest.raises(UrdfError, match=sentence) as caught:
        robot_from_rows(table, "test")
    assert "\n" not in str(caught.value)
