"""URDFs that are no chain: every refusal by name."""

import numpy as np
import pytest

from symgen.chain import Chain, ChainOptions, read_chain
from symgen.errors import InertiaError, SymgenError, UrdfError
from symgen.make.facts import initial_parameters
from tests.conftest import TINY_URDF
from tests.robots import DATA

TREE = (DATA / "tree.urdf").read_text()


def read(text: str, **options: object) -> Chain:
    return read_chain(text, ChainOptions(**options))


BOMB = """<?xml version="1.0"?>
<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]>
<robot name="&c;"><link name="base"/></robot>"""

EXTERNAL = """<?xml version="1.0"?>
<!DOCTYPE robot [<!ENTITY secret SYSTEM "file:///etc/hostname">]>
<robot name="&secret;"><link name="base"/></robot>"""

SECOND_ROD = """
  <joint name="elbow" type="revolute"><parent link="rod"/><child link="tail"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <link name="tail"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
</robot>"""


def tiny(old: str, new: str) -> str:
    """The pendulum with one mistake."""
    assert old in TINY_URDF
    return TINY_URDF.replace(old, new)


def with_joint(body: str) -> str:
    """The pendulum with more in it."""
    return TINY_URDF.replace("</robot>", body + "</robot>")


def test_prefixes_without_xmlns_are_read() -> None:
    """Property: elements of a prefix that nothing declares change no chain, as in ROS."""
    odd = with_joint('<controller:gazebo x:y="1"><grip:on/></controller:gazebo>')
    assert read_chain(odd).joints == read_chain(TINY_URDF).joints
    with pytest.raises(UrdfError, match="xacro instruction <include>"):
        read_chain(with_joint("<xacro:include/>"))


# name → (text, words of the message)
MALFORMED = {
    "empty": ("", "not well-formed XML"),
    "broken": (TINY_URDF[:200], "not well-formed XML"),
    "binary": ("\0\1\2", "not well-formed XML"),
    "entity-bomb": (BOMB, "declares a DTD or entities"),
    "external-entity": (EXTERNAL, "declares a DTD or entities"),
    # as a chain it is no URDF; build reads SDF, of which this one has no link
    "sdf": ("<sdf><model/></sdf>", "first element is <robot>, got <sdf>|defines no link"),
    "no-link": ("<robot name='x'/>", "defines no link"),
    "xacro": (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="a"/></robot>',
        "xacro instruction <include>; expand it first",
    ),
    "mimic": (
        tiny('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="other"/>'),
        "the coupling of joint 'swing' names 'other', which is not a moving joint",
    ),
    "floating": (tiny('"revolute"', '"floating"'), "joint 'swing' has the type 'floating'"),
    "planar": (tiny('"revolute"', '"planar"'), "joint 'swing' has the type 'planar'"),
    "no-type": (tiny(' type="revolute"', ""), "joint 'swing' has the type ''"),
    "nothing-moves": (tiny('"revolute"', '"fixed"'), "no joint of this URDF moves"),
    "zero-mass": (tiny('mass value="1.5"', 'mass value="0"'), "link 'rod' moves .* no mass"),
    "no-inertial": (
        TINY_URDF[: TINY_URDF.index("<inertial>")] + "</link></robot>",
        "link 'rod' moves with joint 'swing' but has no mass",
    ),
    "half-inertial": (tiny('<mass value="1.5"/>', ""), "'rod' needs both <mass> and <inertia>"),
    "negative-mass": (tiny('value="1.5"', 'value="-1.5"'), "'rod' has the negative mass -1.5 kg"),
    "nan-mass": (tiny('value="1.5"', 'value="nan"'), "'rod': mass needs 1 finite .* got 'nan'"),
    "word-mass": (tiny('value="1.5"', 'value="heavy"'), "'rod': mass needs .* got 'heavy'"),
    "inf-inertia": (tiny('izz="0.01"', 'izz="inf"'), "'rod': inertia izz needs 1 finite"),
    "missing-inertia": (tiny(' izz="0.01"', ""), "'rod': inertia izz needs 1 finite"),
    "nan-limit": (tiny('upper="2"', 'upper="nan"'), "'swing': limit upper needs 1 finite"),
    "crossed-limits": (
        tiny('upper="2"', 'upper="-2"'),
        "'swing' has lower limit -1 above upper limit -2",
    ),
    "negative-effort": (tiny('effort="10"', 'effort="-10"'), "negative effort limit -10"),
    "zero-axis": (tiny('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), "'swing' has the axis 0 0 0"),
    "short-axis": (tiny('axis xyz="0 1 0"', 'axis xyz="0 1"'), "axis needs 3 finite"),
    "nan-origin": (tiny('xyz="0 0 0.5"', 'xyz="0 nan 0"'), "joint 'swing': origin xyz needs 3"),
    "two-links": (with_joint('<link name="rod"/>'), "two links are called 'rod'"),
    "two-joints": (
        with_joint('<joint name="swing" type="fixed"/>'),
        "two joints are called 'swing'",
    ),
    "nameless": (with_joint("<link/>"), "a <link> has no name"),
    "unknown-child": (tiny('child link="rod"', 'child link="rood"'), "names the link 'rood'"),
    "no-parent": (tiny('<parent link="base"/>', ""), "joint 'swing' has no <parent link"),
    "two-roots": (with_joint('<link name="island"/>'), "this URDF has 2: base, island"),
    "two-parents": (
        with_joint('<joint name="x" type="fixed"><parent link="base"/><child link="rod"/></joint>'),
        "link 'rod' has two parent joints, 'swing' and 'x'",
    ),
    "loop": (
        TINY_URDF.replace("</robot>", SECOND_ROD).replace(
            '<parent link="base"/>', '<parent link="tail"/>'
        ),
        "the joints of rod, tail form a loop",
    ),
    "loop-without-root": (
        TINY_URDF.replace("</robot>", SECOND_ROD)
        .replace('<parent link="base"/>', '<parent link="tail"/>')
        .replace('<link name="base"/>', ""),
        "exactly one root link, this URDF has 0",
    ),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed_urdf(name: str) -> None:
    """Property: one sentence that names the culprit; never another exception."""
    text, message = MALFORMED[name]
    with pytest.raises(UrdfError, match=message) as caught:
        read(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tip": "hand"}, "--tip names the link 'hand'.*its links are floor, trunk"),
        ({"base": "roof"}, "--base names the link 'roof'"),
        (
            {"base": "left_arm", "tip": "right_arm", "gravity": (0, 0, -1)},
            "is not reached from --base",
        ),
        ({"base": "left_arm"}, "joint 'trunk_turn' moves .* give it with --gravity"),
        ({"gravity": (0.0, float("nan"), 1.0)}, "--gravity needs three finite numbers"),
        ({"locks": {"wrist": 0.0}}, "--lock names the joint 'wrist'.*its joints are trunk_turn"),
        ({"locks": {"camera_mount": 0.0}}, "'camera_mount', which is fixed"),
        ({"locks": {"left_lift": float("inf")}}, "--lock left_lift=inf: expected a finite value"),
        ({"snap": 1.0}, "the setting snap needs an angle between 0 and 0.1 rad, got 1"),
        ({"tip": "floor"}, "no joint of this URDF moves"),
    ],
)
def test_options_that_do_not_fit(options: dict, message: str) -> None:
    """Property: the message names the option and what the URDF offers instead."""
    with pytest.raises(UrdfError, match=message):
        read(TREE, **options)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('izz="0.01"', 'izz="0.5"', "inertia of link 'rod' is not physically consistent"),
        ('iyy="0.02"', 'iyy="-0.02"', "inertia of link 'rod' is not physically consistent"),
        (
            'ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"',
            'ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"',
            "link 'rod' has a mass but zero inertia",
        ),
    ],
)
def test_impossible_inertia(old: str, new: str, message: str) -> None:
    """Property: refused by name without --settings project=true, repaired and reported with it."""
    chain = read(tiny(old, new))
    with pytest.raises(InertiaError, match=f"{message}.*--settings project=true"):
        initial_parameters(chain, project=False)
    pi, projected = initial_parameters(chain, project=True)
    assert projected["rod"] > 0
    assert pi[0] == 1.5
    sane, nothing = initial_parameters(read(TINY_URDF), project=True)
    assert not nothing
    np.testing.assert_allclose(sane[1:4], pi[1:4], rtol=1e-15)


def test_deep_chains_are_read_or_refused() -> None:
    """Property: a thousand links in a row are a sentence or a chain, never a stack overflow."""
    links = "".join(f'<link name="l{k}"/>' for k in range(1200))
    joints = "".join(
        f'<joint name="j{k}" type="fixed"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(1199)
    )
    with pytest.raises(SymgenError):
        read(f"<robot name='long'>{links}{joints}</robot>")


def test_limits_that_are_all_zero_are_not_stated() -> None:
    """Property: exporters write them; a joint that is locked between 0 and 0 has an effort."""
    stated = 'lower="-1" upper="2" velocity="3" effort="10"'
    zero = TINY_URDF.replace(stated, 'lower="0" upper="0" velocity="0" effort="0"')
    (joint,) = read_chain(zero).joints
    assert (joint.lower, joint.upper, joint.velocity, joint.effort) == (None, None, None, None)
    (locked,) = read_chain(zero.replace('effort="0"', 'effort="5"')).joints
    assert (locked.lower, locked.upper, locked.effort) == (0.0, 0.0, 5.0)
