"""URDF → chain: what is kept, cut, locked, lumped and snapped."""

import numpy as np
import pinocchio
import pytest

from symgen.chain import Chain, ChainOptions, read_chain
from tests.conftest import TINY_URDF
from tests.robots import DATA

TREE = (DATA / "tree.urdf").read_text()
GANTRY = (DATA / "gantry.urdf").read_text()


def read(text: str, **options: object) -> Chain:
    return read_chain(text, ChainOptions(**options))


def test_joints_links_and_limits() -> None:
    """Oracle: the file, read by eye."""
    chain = read(TREE)
    assert [j.name for j in chain.joints] == ["trunk_turn", "left_lift", "left_roll", "right_lift"]
    assert [j.parent for j in chain.joints] == [-1, 0, 1, 0]
    assert [j.link for j in chain.joints] == ["trunk", "left_arm", "left_hand", "right_arm"]
    assert chain.base == "floor"
    assert chain.gravity == (0.0, 0.0, -9.81)
    lift, roll = chain.joints[1], chain.joints[2]
    assert (lift.lower, lift.upper, lift.velocity, lift.effort) == (-1.0, 2.0, 3.0, 20.0)
    assert (roll.kind, roll.lower, roll.upper, roll.velocity) == ("continuous", None, None, None)
    assert chain.joints[3].axis == pytest.approx((0.6, 0.0, 0.8), abs=1e-15)


def test_fixed_bodies_are_lumped_and_named() -> None:
    """Oracle: masses add up: 5 + 0.4 + 0.2 kg on the trunk, whatever hangs on the floor is not."""
    chain = read(TREE)
    assert chain.joints[0].mass == pytest.approx(5.6, abs=1e-15)
    assert [(b.name, b.onto, b.mass) for b in chain.lumped] == [
        ("bracket", "trunk", 0.4),
        ("camera", "trunk", 0.2),
    ]


def test_tip_cuts_branches_and_keeps_brackets() -> None:
    """Property: --tip keeps the path and what is rigidly on it; the rest is cut, not lumped."""
    chain = read(TREE, tip="left_arm")
    assert [j.name for j in chain.joints] == ["trunk_turn", "left_lift"]
    assert chain.removed == ("left_hand", "right_arm")
    assert {b.name for b in chain.lumped} == {"bracket", "camera"}
    assert chain.tip.link == "left_arm"
    assert read(TREE, tip="camera").removed == ("left_arm", "left_hand", "right_arm")


def test_base_cuts_above_and_is_the_base() -> None:
    """Property: --base becomes the base, gravity is in its frame."""
    chain = read(GANTRY, base="rail")
    assert chain.base == "rail"
    assert chain.removed == ("world",)
    turned = pinocchio.rpy.rpyToMatrix(0.5, -0.4, 0.3).T @ [0, 0, -9.81]
    assert chain.gravity == pytest.approx(turned, abs=1e-14)
    arm = read(GANTRY, base="carriage", gravity=(0.0, 9.81, 0.0))
    assert (arm.base, arm.gravity) == ("carriage", (0.0, 9.81, 0.0))
    assert [j.name for j in arm.joints] == ["turn", "plunge", "spin"]


def test_a_payload_is_mounted_before_the_tool_of_the_file() -> None:
    """Property: the tip lies beyond bodies of a tool, the mount does not; a frame has no body."""
    arm = read(TINY_URDF)
    assert arm.mount == arm.tip
    body = TINY_URDF[TINY_URDF.index("<inertial>") : TINY_URDF.index("</link>\n</robot>")]
    tool, parent = "", "rod"
    for link in ("flange", "hand", "finger"):
        tool += f'<link name="{link}">{body * (link != "flange")}</link>'
        tool += f'<joint name="to_{link}" type="fixed"><origin xyz="0 0 0.1"/>'
        tool += f'<parent link="{parent}"/><child link="{link}"/></joint>'
        parent = link
    text = TINY_URDF.replace("</robot>", f"{tool}</robot>")
    chain = read(text)
    assert (chain.tip.link, chain.mount.link) == ("finger", "flange")
    assert chain.tip.translation[2] - chain.mount.translation[2] == pytest.approx(0.2, abs=1e-12)
    assert read(text, tip="finger").mount.link == "finger"


def test_locks_become_part_of_their_parent() -> None:
    """Oracle: the locked quill's mass counts into the arm; --lock twice adds up."""
    chain = read(GANTRY, locks={"plunge": 0.1, "spin": -2.0})
    assert [j.name for j in chain.joints] == ["slide", "turn"]
    assert chain.joints[1].mass == pytest.approx(2 + 0.8 + 0.3 + 0.25, abs=1e-15)


def test_a_mimic_follows_or_is_locked() -> None:
    """Property: a mimic joint has no coordinate of its own, and a lock removes it."""
    mimic = TREE.replace('<axis xyz="1 0 0"/>', '<axis xyz="1 0 0"/><mimic joint="left_lift"/>')
    assert [j.name for j in read(mimic).coordinates] == ["trunk_turn", "left_lift", "right_lift"]
    assert len(read(mimic, locks={"left_roll": 0.0}).joints) == 3


def test_rounded_zeros_are_structural() -> None:
    """Property: cos(π/2) leaves no 6e-17 behind, and negative zero neither."""
    chain = read(GANTRY)
    spin = np.array(chain.joints[3].rotation)
    np.testing.assert_array_equal(spin, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert not np.signbit(spin[spin == 0]).any()
    assert chain.joints[2].axis == (0.0, 0.0, -1.0)


def test_snap_takes_only_what_it_says() -> None:
    """Property: 1.5708 is π/2 only with the setting snap, 1.56 never."""
    rounded = TINY_URDF.replace('xyz="0 0 0.5"', 'xyz="0 0 0.5" rpy="1.5708 0 1.56"')
    exact, snapped = read(rounded), read(rounded, snap=1e-4)
    assert exact.joints[0].rotation[2][1] != 1.0
    assert snapped.joints[0].rotation[2][1] == 1.0
    assert snapped.joints[0].rotation[0][0] == pytest.approx(np.cos(1.56), abs=1e-15)


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (TREE, {}),
        (TREE, {"tip": "camera"}),
        (TREE, {"locks": {"trunk_turn": 0.3, "left_roll": -1.0}}),
        (GANTRY, {"base": "rail"}),
        (GANTRY, {"base": "carriage", "gravity": (0.0, 9.81, 0.0), "locks": {"turn": 0.7}}),
        (TINY_URDF.replace('"0 0 0.5"', '"0 0 0.5" rpy="1.5708 0 0"'), {"snap": 1e-4}),
    ],
)
def test_normalisation_is_idempotent(text: str, options: dict) -> None:
    """Property: the normalised URDF, read again with its gravity and tip, is the same chain."""
    once = read(text, **options)
    again = read(once.urdf, gravity=once.gravity, tip=options.get("tip"))
    assert again.urdf == once.urdf
    assert again.joints == once.joints
    assert (again.base, again.tip, again.gravity) == (once.base, once.tip, once.gravity)
    assert again.lumped == once.lumped


def test_large_limits_and_zero_effort() -> None:
    """Property: 0 velocity or effort is 'not given'; a missing <limit> is no limit."""
    text = TINY_URDF.replace('velocity="3" effort="10"', 'velocity="0" effort="0"')
    joint = read(text).joints[0]
    assert (joint.velocity, joint.effort) == (None, None)
    bare = TINY_URDF.replace('<limit lower="-1" upper="2" velocity="3" effort="10"/>', "")
    joint = read(bare).joints[0]
    assert (joint.lower, joint.upper) == (None, None)
