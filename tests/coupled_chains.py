"""Chains with linear couplings, from a tree with two masters and two followers."""

from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.mechanism import mechanism_from_table
from tests.robots import DATA

TREE = (DATA / "tree.urdf").read_text()
WRIST = {
    "coupling": [
        {"joint": "left_roll", "of": {"trunk_turn": 0.5, "left_lift": -1.25}, "offset": 0.2},
        {"joint": "right_lift", "of": {"left_roll": 2.0}, "offset": -0.1},
    ]
}
"""A joint with two masters, and one that follows it: right = trunk − 2.5 lift + 0.3."""


def coupled(table: dict, urdf: str = TREE, **options: object) -> Chain:
    """Chain of a URDF with the couplings of a table.

    Args:
        table: of a mechanism file.
        urdf: text.
        options: of `ChainOptions`.

    Returns:
        The chain.
    """
    return read_chain(urdf, ChainOptions(mechanism=mechanism_from_table(table, "M"), **options))
