"""symgen.emit.programs: patterns of toys, against elimination of random numbers."""

import casadi as ca
import numpy as np
import pytest

from symgen.emit.programs import (
    PANEL,
    Panel,
    Range,
    Run,
    _statistics,
    eliminate,
    fill_in,
    shared_columns,
)
from symgen.emit.ssa import tile_program
from symgen.kernel import Argument, make_kernel

STAIRS = [[1, 1, 1, 1], [0, 1, 1, 1], [0, 0, 0, 1]]
"""A chain: a row has entries from its own column on."""
FORK = [[1, 1, 1, 1], [0, 1, 0, 1], [0, 0, 1, 1]]
"""A trunk with two branches and a right-hand side."""


def random_pattern(seed: int) -> list[list[bool]]:
    rng = np.random.default_rng(seed)
    rows = rng.random((4, 7)) < 0.4
    rows[:, -1] = True
    return rows.tolist()


PATTERNS = [STAIRS, FORK, *(random_pattern(seed) for seed in range(30))]


def test_stairs_do_not_fill_in():
    """Oracle, by hand: each column takes the rows above its step and all columns to the right."""
    panels = eliminate(STAIRS, 3)
    assert panels == (Panel(0, 1, (0,), (1, 2, 3)), Panel(1, 2, (0, 1), (3,)))
    assert fill_in(STAIRS, panels) == []


def test_branches_fill_in_through_the_trunk():
    """Oracle, by hand: the first branch's row mixes with the trunk's and gets its other column."""
    panels = eliminate(FORK, 3)
    assert panels == (
        Panel(0, 1, (0,), (1, 2, 3)),
        Panel(1, 1, (0, 1), (2, 3)),
        Panel(2, 1, (0, 1, 2), (3,)),
    )
    assert fill_in(FORK, panels) == [(1, 2)]


def test_empty_columns_have_no_panel_and_the_right_hand_side_is_only_carried():
    """Property: columns from `count` on are never pivots."""
    assert eliminate([[0, 1, 1]], 2) == (Panel(1, 1, (0,), (2,)),)
    assert eliminate([[0, 0, 1]], 2) == ()
    wide = eliminate([[1] * 30], 29)
    assert {p.width for p in wide} == {PANEL, 29 % PANEL}
    assert sum(p.width for p in wide) == 29


@pytest.mark.parametrize("pattern", PATTERNS)
def test_panels_name_all_that_changes(pattern):
    """Oracle: Householder on random numbers; what a panel does not name stays zero or as it was."""
    rng = np.random.default_rng(0)
    kept = np.zeros((len(pattern[0]), len(pattern[0])))
    panels = eliminate(pattern, len(pattern[0]) - 1)
    for _ in range(3):  # several samples into one triangle
        rows = np.where(pattern, rng.normal(size=np.shape(pattern)), 0.0)
        for panel in panels:
            for c in range(panel.first, panel.first + panel.width):
                assert set(np.flatnonzero(rows[:, c])) <= set(panel.rows)
                stack = np.vstack([kept[c], rows[list(panel.rows)]])
                u = stack[:, c].copy()
                u[0] -= np.linalg.norm(u)
                if not u.any():
                    continue  # the first row of its kind went into the triangle as a whole
                after = stack - np.outer(u, 2 * (u @ stack) / (u @ u))
                inside = {*range(c, panel.first + panel.width), *panel.columns}
                outside = [j for j in range(rows.shape[1]) if j not in inside]
                assert not after[:, outside].any()
                after[1:, c] = 0.0
                kept[c], rows[list(panel.rows)] = after[0], after[1:]
        filled = {(i, c) for i, row in enumerate(pattern) for c, here in enumerate(row) if here}
        allowed = filled | set(fill_in(pattern, panels))
        assert {(int(i), int(c)) for i, c in np.argwhere(rows)} <= allowed


def test_each_joint_lists_its_columns_and_the_torque():
    """Oracle, by hand: three joints of a chain and four base parameters; column 4 is the torque."""
    x = ca.SX.sym("x")
    rows = ca.vertcat(*(ca.horzcat(*row) for row in ([x, x, x, x], [0, 0, x, x], [0, 0, 0, x])))
    regressor = make_kernel(
        "base_regressor", {Argument("x", (1,), "1"): x}, {Argument("Y_b", (3, 4), "1"): rows}, ""
    )
    tables = _statistics({"base_regressor": regressor}, {"base_regressor": tile_program(regressor)})
    assert tables["joint_table"] == [0, 1, 2, 3, 4, 2, 3, 4, 3, 4]
    assert tables["joint_at"] == [0, 5, 8, 10]  # the last entry ends the list of the last joint


def test_columns_that_share_rows():
    """Oracle, by hand: the stairs and the fork; an empty column is in no run."""
    assert shared_columns([[1, 1, 1, 1], [0, 1, 1, 1]]) == (
        Run(0, 1, (Range(0, 4, (0,)),)),
        Run(1, 3, (Range(1, 4, (0, 1)),)),
    )
    assert shared_columns([[1, 0, 0, 1], [0, 1, 0, 1]]) == (
        Run(0, 1, (Range(0, 1, (0,)), Range(3, 4, (0,)))),
        Run(1, 1, (Range(1, 2, (1,)), Range(3, 4, (1,)))),
        Run(3, 1, (Range(3, 4, (0, 1)),)),
    )


@pytest.mark.parametrize("pattern", PATTERNS)
def test_shared_columns_are_all_products(pattern):
    """Oracle: the products of random numbers; every pair of columns is in one range, once."""
    rows = np.where(pattern, np.random.default_rng(0).normal(size=np.shape(pattern)), 0.0)
    gram = np.zeros((rows.shape[1],) * 2)
    for run in shared_columns(pattern):
        for c in range(run.first, run.first + run.width):
            for item in run.ranges:
                for j in range(max(item.first, c), item.end):
                    gram[c, j] += rows[list(item.rows), c] @ rows[list(item.rows), j]
    np.testing.assert_allclose(gram, np.triu(rows.T @ rows), rtol=0, atol=1e-14)
