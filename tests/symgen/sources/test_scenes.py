"""Robot files of others: scenes, stray links, joints without a counterpart, and how one goes on."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from runtime.common.child import Limits
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.document import first_element
from symgen.chain.mechanism import Mechanism
from symgen.errors import SymgenError
from symgen.inspect.inspection import inspect_file
from symgen.sources import Source, read_source
from symgen.sources.compiled_mjcf import compile_mjcf

INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
BODY = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
SDF_ARM = """<model name="{0}"><link name="b"/><link name="l"/>
<joint name="{0}1" type="revolute"><parent>b</parent><child>l</child></joint>
<plugin name="p" filename="x"><robotNamespace>/a</robotNamespace></plugin></model>"""
GROUND = '<model name="ground"><static>true</static><link name="g"/></model>'
MASS = '<inertial pos="0 0 .1" mass="1" diaginertia=".01 .01 .01"/>'


def urdf(links: str, *joints: tuple[str, str, str, str]) -> str:
    """URDF of links, those in capitals with a body, and joints: name, kind, parent, child."""
    text = "".join(f'<link name="{n}">{BODY if n.isupper() else ""}</link>' for n in links.split())
    for name, kind, parent, child in joints:
        text += f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        text += f'<child link="{child}"/><axis xyz="0 1 0"/></joint>'
    return f'<robot name="r">{text}</robot>'


def hinges(*names: str) -> str:
    """Nested bodies of MJCF, each on a hinge."""
    inner = hinges(*names[1:]) if names[1:] else ""
    joint = f'<joint name="{names[0]}" axis="0 1 0"/>'
    return f'<body name="{names[0]}_link" pos="0 0 .2">{MASS}{joint}{inner}</body>'


def mjcf(world: str, rest: str = "") -> str:
    """MJCF with a comment that names other formats."""
    return f'<!-- <robot> --><mujoco model="m"><worldbody>{world}</worldbody>{rest}</mujoco>'


def read(
    folder: Path, text: str, suffix: str, model: str | None = None, **locks: float
) -> tuple[Chain, list[str]]:
    path, notes = folder / f"robot.{suffix}", list[str]()
    path.write_text(text)
    found, mechanism = read_source(Source(path, model=model), Mechanism(), notes.append)
    return read_chain(found, ChainOptions(mechanism=mechanism, masses={}, locks=locks)), notes


def names(chain: Chain) -> list[str]:
    return [joint.name for joint in chain.joints]


def test_the_first_element_tells_the_format() -> None:
    """Property: not a comment, an instruction, a DOCTYPE or an element inside."""
    head = '\ufeff<?xml version="1.0"?>\n<!-- <robot> -->\n<!DOCTYPE a [<!ENTITY b "<c>">]>\n'
    assert first_element(head + "<sdf version='1.6'><robot/></sdf>") == "sdf"
    assert first_element("no xml") == ""
    assert first_element("<!-- " * 20_000) == ""


def test_the_robot_of_a_world_is_read(tmp_path: Path) -> None:
    """Property: of SDF the model that moves, or the named one; <robotNamespace> is no URDF."""
    world = '<sdf version="1.6"><world name="w">{}</world></sdf>'
    chain, notes = read(tmp_path, world.format(GROUND + SDF_ARM.format("a")), "sdf")
    assert names(chain) == ["a1"]
    assert notes == ["models without moving joints are left out: ground"]
    two = world.format(GROUND + SDF_ARM.format("a") + SDF_ARM.format("b"))
    assert names(read(tmp_path, two, "sdf", "b")[0]) == ["b1"]
    with pytest.raises(SymgenError, match=r"2 models with moving joints; .*--model: a, b"):
        read(tmp_path, two, "sdf")
    assert inspect_file(tmp_path / "robot.sdf", chosen="a").model.form == "SDF"


def test_a_tilted_model_is_noted(tmp_path: Path) -> None:
    """Property: the pose of a model turns gravity in its frame."""
    arm = SDF_ARM.format("a").replace('"a">', '"a"><pose>0 0 1 1.5707963267948966 0 0</pose>', 1)
    _, notes = read(tmp_path, f'<sdf version="1.6">{arm}</sdf>', "sdf")
    assert "gravity is 0,-9.81,0 m/s²" in notes[0]


def test_the_tree_that_moves_is_the_robot(tmp_path: Path) -> None:
    """Property: links without a joint to it are left out and named; two robots need a choice."""
    arm = ("j", "revolute", "base", "A")
    chain, notes = read(tmp_path, urdf("TABLE base A", arm), "urdf")
    assert (names(chain), notes[0][-5:]) == (["j"], "TABLE")
    both = urdf("b base A B", arm, ("k", "revolute", "b", "B"))
    assert names(read(tmp_path, both, "urdf", "b")[0]) == ["k"]
    with pytest.raises(SymgenError, match=r"has 2 robots that no joint connects.*: b, base"):
        read(tmp_path, both, "urdf")


def test_objects_of_a_scene_are_left_out(tmp_path: Path) -> None:
    """Property: a free body without joints is no free base; welds to it are left out too."""
    box = f'<body name="box"><freejoint/>{MASS}</body>'
    weld = '<equality><weld body1="box" body2="j_link"/></equality>'
    chain, notes = read(tmp_path, mjcf(box + hinges("j", "k"), weld), "xml")
    assert names(chain) == ["j", "k"]
    assert notes == ["bodies that float freely beside the robot are left out: box"]
    assert names(read(tmp_path, mjcf(hinges("j") + hinges("k")), "xml", "k_link")[0]) == ["k"]


def test_an_equality_of_tendons_is_a_coupling(tmp_path: Path) -> None:
    """Oracle: positions that MuJoCo's constraint accepts, x_k = 0.5 (x_j + l − 0.1)."""
    tendons = """<tendon><fixed name="s"><joint joint="j" coef="1"/><joint joint="k" coef="-2"/>
    </fixed><fixed name="t"><joint joint="l" coef="-1"/></fixed></tendon>
    <equality><tendon tendon1="s" tendon2="t" polycoef="0.1 1 0 0 0"/></equality>"""
    text = mjcf(hinges("j", "l", "k"), tendons)
    chain, _ = read(tmp_path, text, "xml")
    assert chain.coupling is not None
    A, b = np.array(chain.coupling.matrix), np.array(chain.coupling.offset)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = A @ [0.4, -0.7] + b
    mujoco.mj_forward(model, data)
    assert names(chain) == ["j", "l", "k"]
    np.testing.assert_allclose(data.efc_pos, 0, atol=1e-15)


def test_missing_meshes_of_stated_inertials(tmp_path: Path) -> None:
    """Property: read with a note; a body whose inertia comes from a mesh needs the file."""
    mesh = '<geom type="mesh" mesh="m"/>'
    asset = '<asset><mesh name="m" file="none.stl"/></asset>'
    chain, notes = read(tmp_path, mjcf(hinges("j").replace(MASS, MASS + mesh), asset), "xml")
    assert chain.joints[0].mass == 1
    assert "none.stl" in notes[0]
    with pytest.raises(SymgenError, match=r"MuJoCo rejects.*none.stl"):
        read(tmp_path, mjcf(hinges("j").replace(MASS, mesh), asset), "xml")


def test_ball_joints_and_free_bases_can_be_locked(tmp_path: Path) -> None:
    """Property: at the pose of the file; the refusal says how, and no other value is taken."""
    ball = mjcf(hinges("j", "k").replace('name="k" axis="0 1 0"', 'name="k" type="ball"'))
    chain, _ = read(tmp_path, ball, "xml", k=0.0)
    assert (names(chain), chain.joints[0].mass) == (["j"], 2.0)
    with pytest.raises(SymgenError, match="--lock k=0 locks it"):
        read(tmp_path, ball, "xml", k=0.3)


def test_links_without_mass_between_joints(tmp_path: Path) -> None:
    """Property: a joint of two axes is read; links without mass at the end are all named."""
    cross = urdf("b m A", ("i", "revolute", "b", "m"), ("j", "revolute", "m", "A"))
    chain, _ = read(tmp_path, cross, "urdf")
    assert (names(chain), chain.assumed) == (["i", "j"], {"m": "no mass"})
    ends = [(n, "prismatic", "A", f"{n}_link") for n in ("f", "g")]
    bare = urdf("b A f_link g_link", ("j", "revolute", "b", "A"), *ends)
    with pytest.raises(SymgenError, match=r"every such joint: --lock f=0 --lock g=0$"):
        read(tmp_path, bare, "urdf")
    assert names(read(tmp_path, bare, "urdf", f=0.0, g=0.0)[0]) == ["j"]


@pytest.mark.parametrize("value", ["1e300", "nan"])
def test_factors_without_a_mechanism_are_refused(tmp_path: Path, value: str) -> None:
    """Property: in <mimic> and in polycoef, by the joint."""
    joint = '<joint name="j2" type="revolute">'
    arm = urdf("b A B", ("j1", "revolute", "b", "A"), ("j2", "revolute", "A", "B"))
    mimic = arm.replace(joint, joint + f'<mimic joint="j1" multiplier="{value}"/>')
    row = f'<equality><joint joint1="k" joint2="j" polycoef="{value} 1 0 0 0"/></equality>'
    for text, suffix in ((mimic, "urdf"), (mjcf(hinges("j", "k"), row), "xml")):
        with pytest.raises(SymgenError, match=r"joint 'j2'|joint 'k'"):
            read(tmp_path, text, suffix)


def test_mujoco_compiles_within_limits(tmp_path: Path) -> None:
    """Property: memory without end is one sentence, and so is time without end."""
    path = tmp_path / "robot.xml"
    field = '<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>'
    path.write_text(mjcf(hinges("j"), field))
    with pytest.raises(SymgenError, match="MuJoCo"):
        read_source(Source(path), Mechanism())
    path.write_text(
        mjcf('<replicate count="100000000" offset="0 0 1"><geom size="1"/></replicate>')
    )
    with pytest.raises(SymgenError, match="it takes more than 1 s of processor time"):
        compile_mjcf(path, Limits(seconds=1, memory=2**32))


def test_equalities_with_mocap_targets_are_left_out(tmp_path: Path) -> None:
    """Property: a weld to a target that a user moves closes no loop; the note names the target."""
    target = '<body name="goal" mocap="true" pos="3 0 0"/>'
    weld = '<equality><weld body1="goal" body2="b_link"/></equality>'
    chain, notes = read(tmp_path, mjcf(hinges("a", "b") + target, weld), "xml")
    assert names(chain) == ["a", "b"]
    assert chain.loops is None
    assert any("targets goal" in note for note in notes)
