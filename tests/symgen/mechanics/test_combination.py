"""Text of base parameters."""

from symgen.mechanics.combination import describe_combination

NAMES = ["a.m", "b.m", "c.ZZ"]


def test_rounding_of_closed_loops_is_left_out() -> None:
    """Property: entries up to 1e-9 of the largest one are zeros of a least-squares solution."""
    assert describe_combination(NAMES, [2e-10, 1.0, -0.25]) == "b.m - 0.25 c.ZZ"
    assert describe_combination(NAMES, [2e-9, 1.0, 0.0]) == "b.m + 2e-09 a.m"
    assert describe_combination(NAMES, [-1.0, 0.0, 1.0]) == "c.ZZ - a.m"
