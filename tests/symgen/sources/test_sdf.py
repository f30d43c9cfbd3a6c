"""SDF as a source: the same mechanism as its URDF, loops by <loop_joint> or a second parent."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.mechanism import Mechanism, mechanism_from_table
from symgen.errors import SymgenError
from symgen.make.facts import initial_parameters
from symgen.mechanics.closure import supplied
from symgen.mechanics.dynamics import inverse_dynamics
from symgen.sources import Source, read_source

INERTIA = "<inertia><ixx>0.01</ixx><iyy>0.03</iyy><izz>0.03</izz><ixy>0.001</ixy></inertia>"
BAR = f"""<sdf version="1.9"><model name="bar">
  <frame name="corner"><pose>0.1 0.2 0.3 0 0 0.5</pose></frame>
  <link name="A"><pose relative_to="corner">0.05 0 0.02 0.1 0 0</pose>
    <inertial><pose>0.2 0.01 0 0 0 0.3</pose><mass>1.1</mass>{INERTIA}</inertial></link>
  <link name="B"><pose relative_to="A">0.4 0 0 0 0 -1.0</pose>
    <inertial><pose>0.2 0 0.02 0 0 0</pose><mass>0.7</mass>{INERTIA}</inertial></link>
  <link name="C"><pose relative_to="corner">0.75 0 0.02 0.1 0 0</pose>
    <inertial><pose>0.1 0 0 0 0 0</pose><mass>0.9</mass>{INERTIA}</inertial></link>
  <joint name="a" type="revolute"><parent>world</parent><child>A</child><pose>-0.05 0 0 0 0 0</pose>
    <axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper><effort>30</effort></limit>
      <dynamics><damping>0.4</damping><friction>0.1</friction></dynamics></axis></joint>
  <joint name="b" type="revolute"><parent>A</parent><child>B</child>
    <axis><xyz expressed_in="A">0 0 1</xyz><limit><lower>-1e16</lower><upper>1e16</upper></limit>
    </axis></joint>
  <joint name="c" type="continuous"><parent>world</parent><child>C</child>
    <axis><xyz>0 0 1</xyz></axis></joint>
  <LOOP name="d" type="revolute"><parent>B</parent><child>C</child>
    <pose relative_to="C">-0.1 0.4 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis></LOOP>
</model></sdf>"""
TWICE, LOOP = BAR.replace("LOOP", "joint"), BAR.replace("LOOP", "loop_joint")
SAME = """<robot name="bar"><link name="world"/>{links}
  <joint name="a" type="revolute"><parent link="world"/><child link="A"/>
    <origin xyz="{a}" rpy="0.1 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="30" velocity="0"/></joint>
  <joint name="b" type="continuous"><parent link="A"/><child link="B"/>
    <origin xyz="0.45 0 0" rpy="0 0 -1"/><axis xyz="0 0 1"/></joint>
  <joint name="c" type="continuous"><parent link="world"/><child link="C"/>
    <origin xyz="{c}" rpy="0.1 0 0.5"/><axis xyz="0 0 1"/></joint></robot>"""


def from_file(path: Path, text: str) -> Chain:
    path.write_text(text)
    urdf, mechanism = read_source(Source(path), Mechanism())
    return read_chain(urdf, ChainOptions(mechanism=mechanism))


def turned(x: float, y: float, z: float) -> np.ndarray:
    """A point of the frame `corner` in the model."""
    c, s = np.cos(0.5), np.sin(0.5)
    return np.array([0.1 + c * x - s * y, 0.2 + s * x + c * y, 0.3 + z])


def by_hand() -> Chain:
    """The same linkage as a URDF, its frames computed by hand."""
    links = "".join(
        f'<link name="{name}"><inertial><origin xyz="{xyz}" rpy="0 0 {yaw}"/><mass value="{mass}"/>'
        '<inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0.001" ixz="0" iyz="0"/></inertial></link>'
        for name, xyz, yaw, mass in (
            ("A", "0.25 0.01 0", 0.3, 1.1),
            ("B", "0.2 0 0.02", 0, 0.7),
            ("C", "0.1 0 0", 0, 0.9),
        )
    )
    a, c = (" ".join(map(repr, map(float, turned(x, 0, 0.02)))) for x in (0.0, 0.75))
    # the hinge of the loop in A's frame (x from its joint), then in B's
    in_a = np.array([0.75 - 0.1, 0.4]) - [0.45, 0]
    turn = np.array([[np.cos(1), -np.sin(1)], [np.sin(1), np.cos(1)]])
    loop = {
        "parent": "B",
        "child": "C",
        "parent_xyz": [*(turn @ in_a).tolist(), 0.0],
        "parent_rpy": [0.0, 0.0, 1.0],
        "child_xyz": [-0.1, 0.4, 0.0],
        "kind": "revolute",
    }
    options = ChainOptions(mechanism=mechanism_from_table({"loop": [loop]}, "M"))
    return read_chain(SAME.format(links=links, a=a, c=c), options)


@pytest.mark.parametrize("text", [TWICE, LOOP])
def test_sdf_is_the_mechanism_of_its_urdf(text: str, tmp_path: Path) -> None:
    """Oracle: joints, limits and τ equal those of the URDF with [[loop]] written by hand."""
    ours, other = from_file(tmp_path / "bar.sdf", text), by_hand()
    assert [j.name for j in ours.coordinates] == ["a"] == [j.name for j in other.coordinates]
    assert [(j.kind, j.lower, j.effort) for j in ours.joints] == [
        (j.kind, j.lower, j.effort) for j in other.joints
    ]
    x = [ca.SX.sym(name, 1) for name in ("q", "dq", "ddq")]
    torques = []
    for chain in (ours, other):
        pi, _ = initial_parameters(chain, False)
        tau = supplied(chain, inverse_dynamics(chain, *x, ca.DM(pi)), x[0])
        function = ca.Function("f", x, [tau])
        torques.append([float(function(q, 1.3, -2.0)) for q in (-0.2, 0.0, 0.3)])
    assert np.isfinite(torques[0]).all()
    np.testing.assert_allclose(torques[0], torques[1], atol=1e-12)


def test_mimics_and_damping_are_read(tmp_path: Path) -> None:
    """Property: x = multiplier (leader − reference) + offset; damping stands in <dynamics>."""
    mimic = (
        '<axis><xyz>0 0 1</xyz><mimic joint="a" axis="axis"><multiplier>2</multiplier>'
        "<offset>0.5</offset><reference>0.1</reference></mimic></axis>"
    )
    tree = LOOP[: LOOP.index("<loop_joint")] + "</model></sdf>"
    tree = tree.replace(
        "<child>C</child>\n    <axis><xyz>0 0 1</xyz></axis>", f"<child>C</child>{mimic}"
    )
    chain = from_file(tmp_path / "tree.sdf", tree)
    assert chain.coupling is not None
    assert chain.coupling.matrix[-1] == (2.0, 0.0)
    assert chain.coupling.offset[-1] == pytest.approx(0.3)
    assert 'damping="0.40000000000000002" friction="0.10000000000000001"' in chain.urdf


REFUSED = {
    "no model": ("<sdf version='1.9'></sdf>", "expected an <sdf> with a <model>"),
    "damaged": (LOOP.replace("</model>", ""), "not well-formed XML"),
    "DTD": ("<!DOCTYPE sdf [<!ENTITY a 'b'>]>" + LOOP, "declares a DTD"),
    "nested": (LOOP.replace("</model>", "<include/></model>"), "a nested <include>"),
    "unknown link": (LOOP.replace("<parent>A</parent>", "<parent>Z</parent>"), "names 'Z'"),
    "no child": (LOOP.replace("<child>A</child>", ""), "joint 'a' has no <child>"),
    "unknown frame": (LOOP.replace('relative_to="A"', 'relative_to="Z"'), "the frame 'Z'"),
    "circle": (LOOP.replace('relative_to="A"', 'relative_to="b"'), "refer to each other"),
    "type": (LOOP.replace('name="c" type="continuous"', 'name="c" type="screw"'), "type 'screw'"),
    "loop type": (LOOP.replace('"d" type="revolute"', '"d" type="gearbox"'), "type 'gearbox'"),
    "two of a name": (LOOP.replace('link name="C"', 'link name="B"'), "a name of its own"),
    "damping": (LOOP.replace("<damping>0.4", "<damping>much"), "joint 'a': damping needs 1"),
    "a word": (LOOP.replace("0.1 0.2 0.3 0 0 0.5", "0.1 b 0.3 0 0 0"), "'corner': pose needs 6"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_damaged_sdf_is_refused(case: str, tmp_path: Path) -> None:
    """Property: one sentence that names the joint, the frame or the file."""
    text, sentence = REFUSED[case]
    with pytest.raises(SymgenError, match=sentence) as caught:
        from_file(tmp_path / "bar.sdf", text)
    assert "\n" not in str(caught.value)
