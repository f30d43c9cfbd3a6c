"""Linear couplings q_all = A q + b: rows, chains, cycles, and all equations against Pinocchio."""

import numpy as np
import pytest

from symgen.chain import ChainOptions, read_chain
from symgen.chain.mechanism import mechanism_from_table, table_from_mechanism
from symgen.errors import UrdfError
from tests.coupled_chains import TREE, WRIST, coupled


def with_mimics(*mimics: tuple[str, str]) -> str:
    """The tree with <mimic> elements: joint, attributes."""
    text = TREE
    for joint, attributes in mimics:
        head, tail = text.split(f'<joint name="{joint}"', 1)
        text = f'{head}<joint name="{joint}"' + tail.replace(
            "</joint>", f"<mimic {attributes}/></joint>", 1
        )
    return text


def test_rows_are_substituted_along_chains() -> None:
    """Oracle: A and b by hand."""
    coupling = coupled(WRIST).coupling
    assert coupling is not None
    assert coupling.independent == (0, 1)
    np.testing.assert_array_equal(coupling.matrix, [[1, 0], [0, 1], [0.5, -1.25], [1, -2.5]])
    np.testing.assert_allclose(coupling.offset, [0, 0, 0.2, 0.3], atol=1e-16)


def test_mimic_and_table_say_the_same() -> None:
    """Property: <mimic> with multiplier and offset is a row of the table, which replaces it."""
    mimic = with_mimics(("left_roll", 'joint="left_lift" multiplier="-0.5" offset="0.25"'))
    row = {"joint": "left_roll", "of": {"left_lift": -0.5}, "offset": 0.25}
    assert read_chain(mimic).coupling == coupled({"coupling": [row]}).coupling
    assert coupled(WRIST, mimic).coupling == coupled(WRIST).coupling


def test_named_independent_joints_are_solved_for() -> None:
    """Property: the same mechanism by other coordinates: A x_w + b gives the same postures."""
    ours, others = (
        coupled(WRIST).coupling,
        coupled(WRIST | {"independent": ["left_roll", "left_lift"]}).coupling,
    )
    assert ours is not None
    assert others is not None
    assert others.independent == (2, 1)
    turned = coupled(WRIST | {"independent": ["left_lift", "trunk_turn"]}).coupling
    assert turned is not None
    np.testing.assert_array_equal(turned.matrix, np.array(ours.matrix)[:, ::-1])
    posture = np.array(ours.matrix) @ [0.3, -0.7] + ours.offset
    again = np.array(others.matrix) @ posture[list(others.independent)] + others.offset
    np.testing.assert_allclose(again, posture, atol=1e-15)


def test_a_follower_narrows_the_range_of_its_master() -> None:
    """Oracle: right_lift ∈ [−2, 1] = −2 left_lift + 0.5 leaves left_lift [−0.25, 1.25]; its speed
    limit 3 rad/s leaves 1.5 rad/s.
    """
    row = {"joint": "right_lift", "of": {"left_lift": -2.0}, "offset": 0.5}
    lift = coupled({"coupling": [row]}).coordinates[1]
    assert (lift.lower, lift.upper, lift.velocity) == (-0.25, 1.25, 1.5)


def test_a_locked_master_locks_its_followers() -> None:
    """Property: a follower of a locked joint stands still where the coupling puts it."""
    text = with_mimics(("right_lift", 'joint="left_lift" multiplier="2" offset="0.1"'))
    followed = read_chain(text, ChainOptions(locks={"left_lift": 0.3}))
    by_hand = read_chain(TREE, ChainOptions(locks={"left_lift": 0.3, "right_lift": 0.7}))
    assert followed.coupling is None
    assert followed.joints[0].mass == by_hand.joints[0].mass
    np.testing.assert_allclose(followed.joints[0].com, by_hand.joints[0].com, atol=1e-15)


def test_a_mechanism_survives_the_manifest() -> None:
    """Property: the table of the manifest reads as the mechanism it was written from."""
    table = {
        "coupling": [{"joint": "j", "of": {"k": 2.0}, "offset": 0.1}],
        "independent": ["k"],
        "friction": [{"name": "jaw", "of": {"k": 1.0, "l": -1.0}}],
        "spring": [
            {"name": "a", "joint": "k", "rest": 0.2},
            {"parent": "A", "child": "B", "parent_xyz": [1, 2, 3], "child_xyz": [0, 0, 1]},
        ],
        "known_torque": [
            {"of": {"k": 1.0}, "polynomial": [0.5, 1.0]},
            {"joint": "k", "x": [0.0, 1.0], "torque": [2.0, 3.0]},
        ],
    }
    mechanism = mechanism_from_table(table, "M")
    assert mechanism_from_table(table_from_mechanism(mechanism), "again") == mechanism


REFUSED = {
    "cycle of mimics": (
        with_mimics(("left_roll", 'joint="right_lift"'), ("right_lift", 'joint="left_roll"')),
        {},
        "the couplings form a cycle: 'left_roll' follows 'right_lift', 'right_lift' follows "
        "'left_roll'",
    ),
    "mimic of itself": (
        with_mimics(("left_roll", 'joint="left_roll"')),
        {},
        "cycle: 'left_roll' follows 'left_roll'",
    ),
    "unknown master": (
        with_mimics(("left_roll", 'joint="nobody"')),
        {},
        "'left_roll' names 'nobody', which is not a moving joint",
    ),
    "coupling of an unknown joint": (
        with_mimics(),
        {"coupling": [{"joint": "nobody", "of": {"left_lift": 1.0}}]},
        "a coupling names 'nobody', which is not a moving joint",
    ),
    "torque curve without points": (
        with_mimics(),
        {"known_torque": [{"joint": "left_lift"}]},
        "needs either polynomial = .*, or points x",
    ),
    "mimic without a joint": (
        with_mimics(("left_roll", 'multiplier="2"')),
        {},
        "the <mimic> of joint 'left_roll' names no joint",
    ),
    "multiplier": (
        with_mimics(("left_roll", 'joint="left_lift" multiplier="two"')),
        {},
        "'left_roll': mimic multiplier",
    ),
    "infinite offset": (
        with_mimics(("left_roll", 'joint="left_lift" offset="inf"')),
        {},
        "'left_roll': mimic offset",
    ),
    "unknown joint": (TREE, {"coupling": [{"joint": "x", "of": {"left_lift": 1}}]}, "names 'x'"),
    "two rows": (TREE, {"coupling": [WRIST["coupling"][0]] * 2}, "'left_roll' has two couplings"),
    "all dependent": (
        TREE,
        {
            "coupling": [
                {"joint": a, "of": {b: 1.0}}
                for a, b in zip(
                    ("trunk_turn", "left_lift", "left_roll", "right_lift"),
                    ("left_lift", "left_roll", "right_lift", "trunk_turn"),
                    strict=True,
                )
            ]
        },
        "every joint follows another one: 'trunk_turn' follows 'left_lift'",
    ),
    "no factors": (TREE, {"coupling": [{"joint": "left_roll", "of": {}}]}, "needs of = "),
    "word as factor": (
        TREE,
        {"coupling": [{"joint": "left_roll", "of": {"left_lift": "1"}}]},
        r"coupling\[0\].of.left_lift expects a number, got '1'; correct it",
    ),
    "unknown key": (TREE, {"couplings": []}, "unknown key 'couplings'"),
    "table, not tables": (
        TREE,
        {"coupling": {"joint": "a"}},
        r"coupling expects a list, got {'joint': 'a'}; correct it",
    ),
    "singular choice": (
        TREE,
        WRIST | {"independent": ["left_roll", "right_lift"]},
        "'?left_roll, right_lift'? do not determine the others",
    ),
    "unknown independent": (TREE, WRIST | {"independent": ["a", "b"]}, "independent names 'a'"),
    "curve by polynomial and by points": (
        TREE,
        {"known_torque": [{"joint": "left_lift", "polynomial": [1.0], "x": [0.0, 1.0]}]},
        "needs either polynomial = .*, or points x",
    ),
    "independent without coupling": (TREE, {"independent": ["left_lift"]}, "no coupling"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_coupling_is_refused_in_a_sentence(case: str) -> None:
    """Property: one sentence that names the joint or the key."""
    urdf, table, sentence = REFUSED[case]
    with pytest.raises(UrdfError, match=sentence) as caught:
        coupled(table, urdf)
    assert "\n" not in str(caught.value)
