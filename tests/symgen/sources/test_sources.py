"""Robot files as users have them: MJCF against MuJoCo, packages, xacro, published robots."""

import importlib.util
from pathlib import Path

import casadi as ca
import mujoco
import numpy as np
import pytest

from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.mechanism import Mechanism, mechanism_from_table
from symgen.errors import BuildError, SymgenError
from symgen.make.facts import initial_parameters
from symgen.mechanics.closure import supplied
from symgen.mechanics.dynamics import inverse_dynamics
from symgen.mechanics.kinematics import all_accelerations, all_positions, all_rates
from symgen.ros.packages import Packages
from symgen.sources import Source, published_urdf, read_source
from tests.conftest import TINY_URDF

HAND = """<mujoco model="hand"><compiler angle="radian" autolimits="true"/>
  <option gravity="0 0 -9.81"><flag contact="disable"/></option>
  <worldbody><body name="stand" pos="0.1 0 0.2" euler="0.2 0.1 0.3">
    <body name="arm" pos="0 0.1 0.3" quat="0.9 0.1 0.3 0.2">
      <joint name="lift" type="hinge" axis="0.6 0 0.8" pos="0.02 -0.03 0.05" range="-1 2"
        ref="0.4" damping="0.3" frictionloss="0.2"/>
      <joint name="slide" type="slide" axis="0 1 0" pos="0.02 0 0" ref="0.05"/>
      <inertial pos="0.03 0.02 0.1" mass="2" fullinertia="0.02 0.03 0.025 0.001 0.002 -0.001"/>
      <body name="finger" pos="0.2 0 0.1" euler="0 0.5 0">
        <joint name="curl" type="hinge" axis="0 1 0" pos="0 0 0.02" ref="-0.2"/>
        <inertial pos="0 0 0.05" mass="0.3" diaginertia="0.001 0.002 0.001"/>
        <body name="nail" pos="0 0 0.1">
          <inertial pos="0.01 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
        </body>
      </body>
      <body name="thumb" pos="-0.1 0 0.1">
        <joint name="bend" type="hinge" axis="1 0 0" ref="0.1"/>
        <inertial pos="0 0 0.04" mass="0.2" diaginertia="0.001 0.001 0.0005"/>
      </body>
    </body></body></worldbody>
  <equality><joint joint1="bend" joint2="curl" polycoef="0.3 -1.5 0 0 0"/></equality>
</mujoco>"""


def from_file(path: Path) -> Chain:
    text, mechanism = read_source(Source(path), Mechanism())
    return read_chain(text, ChainOptions(mechanism=mechanism))


def test_mjcf_moves_like_mujoco(tmp_path: Path) -> None:
    """Oracle: MuJoCo's inverse dynamics, projected on the equality; anchors, refs, two joints of
    one body and a welded body included. 1e-9 kg of the link between two joints is below rounding.
    """
    path = tmp_path / "hand.xml"
    path.write_text(HAND)
    chain = from_file(path)
    assert [joint.name for joint in chain.coordinates] == ["lift", "slide", "curl"]
    assert (chain.joints[0].lower, chain.joints[0].upper) == (-1.0, 2.0)
    pi, _ = initial_parameters(chain, False)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.dof_damping[:] = 0
    data = mujoco.MjData(model)
    at = [int(model.joint(joint.name).dofadr[0]) for joint in chain.joints]
    assert chain.coupling is not None
    A = np.array(chain.coupling.matrix)
    x = [ca.SX.sym(name, 3) for name in ("q", "dq", "ddq")]
    function = ca.Function(
        "f", x, [all_positions(chain, x[0]), inverse_dynamics(chain, *x, ca.DM(pi))]
    )
    rng = np.random.default_rng(0)
    for _ in range(10):
        q, dq, ddq = rng.normal(0, [[0.5], [2], [5]], (3, 3))
        positions, tau = (np.asarray(value).ravel() for value in function(q, dq, ddq))
        data.qpos[at], data.qvel[at], data.qacc[at] = positions, A @ dq, A @ ddq
        curl, bend = (data.joint(name).qpos[0] for name in ("curl", "bend"))
        assert bend - 0.1 == pytest.approx(0.3 - 1.5 * (curl + 0.2), abs=1e-14)
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(tau, A.T @ data.qfrc_inverse[at], atol=1e-7)


def test_a_package_is_found_by_option_and_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: package:// through the setting package, ROS_PACKAGE_PATH and AMENT_PREFIX_PATH."""
    folder = tmp_path / "src/robots/my_arm"
    (folder / "urdf").mkdir(parents=True)
    (folder / "package.xml").write_text("<package/>")
    (folder / "urdf/arm.urdf").write_text(TINY_URDF)
    name = Path("package://my_arm/urdf/arm.urdf")
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    for root in (folder, tmp_path / "src"):
        source = Source(name, packages=Packages((root,)))
        assert read_source(source, Mechanism())[0] == TINY_URDF
    with pytest.raises(BuildError, match=r"package 'my_arm' is not found.*--settings package=DIR"):
        read_source(Source(name), Mechanism())
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path / 'src'}")
    assert read_source(Source(name), Mechanism())[0] == TINY_URDF
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    installed = tmp_path / "install/share/my_arm/urdf"
    installed.mkdir(parents=True)
    (installed / "arm.urdf").write_text(TINY_URDF)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    assert read_source(Source(name), Mechanism())[0] == TINY_URDF


XACRO = """<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="1.5"/><xacro:include filename="$(find parts)/rod.xacro"/>
<link name="base"/><xacro:rod mass="$(arg mass)" length="$(arg length)"/></robot>"""
ROD = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:macro name="rod" params="mass length">
<link name="rod"><inertial><origin xyz="0 0 ${length / 2}"/><mass value="${mass}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="continuous">
<parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint>
</xacro:macro></robot>"""


@pytest.mark.skipif(
    importlib.util.find_spec("xacro") is None,
    reason="SKIPPED LOUDLY: the package xacro is not installed",
)
def test_xacro_is_expanded_with_arguments_and_packages(tmp_path: Path) -> None:
    """Property: the setting arg and $(find …) count; a missing argument is one sentence."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/package.xml").write_text("<package/>")
    (tmp_path / "parts/rod.xacro").write_text(ROD)
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(XACRO)
    packages = Packages((tmp_path,))
    source = Source(path, {"length": "0.4", "mass": "2.5"}, packages)
    (joint,) = read_chain(read_source(source, Mechanism())[0]).joints
    assert (joint.mass, joint.com) == (2.5, (0.0, 0.0, 0.2))
    for bad, sentence in (
        (Source(path, {}, packages), r"arm\.urdf\.xacro'.*length.*--settings arg=NAME=VALUE"),
        (Source(path, {"length": "long"}, packages), "xacro cannot expand"),
        (Source(path, {"length": "1"}), "the ROS package 'parts' is not found"),
        (Source(tmp_path / "no.xacro"), "there is no such file"),
    ):
        with pytest.raises(BuildError, match=sentence) as caught:
            read_source(bad, Mechanism())
        assert "\n" not in str(caught.value)


def test_a_published_robot_is_found_by_name() -> None:
    """Property: by the name of a URDF or of its folder; an unknown name lists near ones."""
    if importlib.util.find_spec("hppfcl") is None and not _has_examples():
        pytest.skip("SKIPPED LOUDLY: example-robot-data is not installed")
    assert published_urdf("talos_full_v2").name == "talos_full_v2.urdf"
    assert published_urdf("romeo").name == "romeo.urdf"
    with pytest.raises(BuildError, match="'no_such_robot'"):
        published_urdf("no_such_robot")


def _has_examples() -> bool:
    try:
        return published_urdf("romeo").is_file()
    except BuildError:
        return False


REFUSED = {
    "ball joint": (
        HAND.replace('type="slide" axis="0 1 0"', 'type="ball"'),
        "joint 'slide' has the type 'spherical'.*--lock slide=0",
    ),
    "quadratic": (HAND.replace("0.3 -1.5 0 0 0", "0.3 -1.5 2 0 0"), "polynomial of degree 2"),
    "tendon": (
        HAND.replace(
            "<equality>",
            '<tendon><fixed name="t"><joint joint="bend" coef="1"/></fixed></tendon><equality>'
            '<tendon tendon1="t"/><tendon tendon1="t"/>',
        ),
        "equality of tendon 't' determines no joint",
    ),
    "damaged": (HAND.replace("</mujoco>", ""), "MuJoCo cannot parse"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_mjcf_without_counterpart_is_refused(case: str, tmp_path: Path) -> None:
    """Property: one sentence that names the joint, the equality or the file."""
    text, sentence = REFUSED[case]
    path = tmp_path / "hand.xml"
    path.write_text(text)
    with pytest.raises(SymgenError, match=sentence) as caught:
        from_file(path)
    assert "\n" not in str(caught.value)


FIVE_BAR = """<mujoco model="five"><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="A1" quat="0.96 0 -0.28 0"><joint name="a1" axis="0 1 0" pos="0.02 0 0.01"/>
    <inertial pos="0.2 0.01 0" mass="1.1" diaginertia="0.01 0.03 0.03"/>
    <body name="A2" pos="0.4 0 0" quat="0.96 0 0.28 0"><joint name="a2" axis="0 1 0" ref="0.3"/>
      <inertial pos="0.2 0 0.02" mass="0.7" diaginertia="0.01 0.02 0.02"/>
      <site name="tip" pos="0.35 0 0"/>
    </body></body>
  <body name="B1" pos="0.7 0.05 0" quat="0.8 0 -0.6 0"><joint name="b1" axis="0 1 0"/>
    <inertial pos="0.15 0 0" mass="0.9" diaginertia="0.01 0.02 0.02"/>
    <body name="B2" pos="0.3 0 0" quat="0.9 0 0.43589 0"><joint name="b2" axis="0 1 0"/>
      <inertial pos="0.1 0 0" mass="0.5" diaginertia="0.005 0.01 0.01"/>
    </body></body></worldbody>
  <equality><connect body1="A2" body2="B2" anchor="0.35 0 0"/></equality>
</mujoco>"""


@pytest.mark.parametrize("weld", [False, True])
def test_connect_and_weld_are_loops(tmp_path: Path, weld: bool) -> None:
    """Oracle: positions of all joints keep the points, and the frames of a weld, together in
    MuJoCo; τ is MuJoCo's inverse dynamics of the tree projected by differences of the positions.
    """
    text = FIVE_BAR.replace("<connect", "<weld") if weld else FIVE_BAR
    path = tmp_path / "five.xml"
    path.write_text(text)
    choice = {"independent": ["a1"] if weld else ["a1", "b1"]}
    stated = read_source(Source(path), mechanism_from_table(choice, "M"))
    assert stated[1].loop[0].kind == ("fixed" if weld else "spherical")
    chain = read_chain(stated[0], ChainOptions(mechanism=stated[1]))
    n = len(chain.coordinates)
    assert n == (1 if weld else 2)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    at = [int(model.joint(joint.name).dofadr[0]) for joint in chain.joints]
    pi, _ = initial_parameters(chain, False)
    x = [ca.SX.sym(name, n) for name in ("q", "dq", "ddq")]
    results = ca.vertcat(
        all_positions(chain, x[0]),
        all_rates(chain, *x[:2]),
        all_accelerations(chain, *x),
        inverse_dynamics(chain, *x, ca.DM(pi)),
    )
    function = ca.Function("f", x, [supplied(chain, results, x[0])])
    # the point of `weld` is given in body 2 first, that of `connect` in body 1
    ends = [int(model.eq_obj1id[0]), int(model.eq_obj2id[0])][:: -1 if weld else 1]
    rng = np.random.default_rng(0)
    for _ in range(3):
        q, dq, ddq = rng.normal(0, [[0.1], [1], [3]], (3, n))
        q_all, dq_all, ddq_all, tau = np.split(np.asarray(function(q, dq, ddq)).ravel(), [4, 8, 12])
        data.qpos[at], data.qvel[at], data.qacc[at] = q_all, dq_all, ddq_all
        mujoco.mj_inverse(model, data)
        points = [
            data.xpos[body] + data.xmat[body].reshape(3, 3) @ model.eq_data[0][part]
            for body, part in zip(ends, (slice(3), slice(3, 6)), strict=True)
        ]
        np.testing.assert_allclose(points[0], points[1], atol=1e-12)
        h = 1e-6
        moved = [
            np.asarray(function(q + h * e, dq, ddq) - function(q - h * e, dq, ddq))[:4, 0] / (2 * h)
            for e in np.eye(n)
        ]
        np.testing.assert_allclose(dq_all, dq @ np.array(moved), atol=1e-8)
        np.testing.assert_allclose(tau, np.array(moved) @ data.qfrc_inverse[at], atol=1e-7)


def test_two_mechanisms_and_stray_arguments_are_refused(tmp_path: Path) -> None:
    """Property: an option that would not count is named."""
    path = tmp_path / "hand.xml"
    path.write_text(HAND)
    row = {"joint": "curl", "of": {"bend": 1.0}}
    with pytest.raises(BuildError, match="both describe a mechanism"):
        read_source(Source(path), mechanism_from_table({"coupling": [row]}, "M"))
    with pytest.raises(BuildError, match="the setting arg belongs to xacro files"):
        read_source(Source(path, {"a": "1"}), Mechanism())


def test_an_argument_that_a_xacro_file_lacks_is_refused(tmp_path: Path) -> None:
    """Property: a misspelt arg, which xacro ignores, is named with the arguments that there are;
    an argument of a branch that is not taken is accepted.
    """
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        '<xacro:arg name="gripper" default="false"/><xacro:if value="$(arg gripper)">'
        '<xacro:arg name="width" default="1"/></xacro:if><link name="a"/></robot>'
    )
    with pytest.raises(BuildError, match=r"'griper', which .* their arguments are: gripper, width"):
        read_source(Source(path, {"griper": "true"}), Mechanism())
    assert "<link" in read_source(Source(path, {"width": "2"}), Mechanism())[0]


def test_a_free_body_of_mjcf_is_a_free_base(tmp_path: Path) -> None:
    """Property: --floating --base takes the body of a <freejoint>; else that is the remedy."""
    path = tmp_path / "hand.xml"
    free = '"><freejoint/><inertial pos="0 0 0" mass="3" diaginertia="0.1 0.1 0.1"/>'
    path.write_text(HAND.replace('euler="0.2 0.1 0.3">', f'euler="0.2 0.1 0.3{free}'))
    text, mechanism = read_source(Source(path), Mechanism())
    with pytest.raises(SymgenError, match="give --floating --base stand for a free base"):
        read_chain(text, ChainOptions(mechanism=mechanism))
    chain = read_chain(text, ChainOptions(mechanism=mechanism, floating=True, base="stand"))
    assert chain.floating
    assert chain.base == "stand"
    assert chain.joints[1].name == "lift"
