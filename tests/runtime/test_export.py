"""runtime.export: the written URDF is the identified robot, and nothing else gets written."""

from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio
import pytest
from defusedxml.ElementTree import fromstring

import runtime
import runtime.export as export_module
from runtime.errors import ExportError, RuntimeFault, ShapeError
from runtime.export import identified_urdf, write_urdf
from runtime.library import Library, to_pinocchio_order
from symgen.build import build
from symgen.chain import ChainOptions
from symgen.request import BuildRequest

# Every trap at once: a continuous and a prismatic joint, a moving link without an inertial of its
# own, a rotated inertial, fixed bodies in a row on a moving link, a fixed body on the base, a
# moving joint behind a fixed body, joints in no alphabetic order; gravity is tilted as well.
ARM = """<robot name="arm">
  <link name="base"><inertial><mass value="3"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="pedestal"><inertial><origin xyz="0 0 1" rpy="0 0 0"/><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="stand" type="fixed"><parent link="base"/><child link="pedestal"/></joint>
  <link name="upper"><visual><geometry><box size="1 2 3"/></geometry></visual>
    <inertial><origin xyz=".1 .2 .3" rpy=".3 .2 .1"/><mass value="4"/>
    <inertia ixx=".05" iyy=".06" izz=".07" ixy=".01" ixz="0" iyz="0"/></inertial></link>
  <joint name="z_turn" type="continuous"><parent link="pedestal"/><child link="upper"/>
    <origin xyz="0 0 .2" rpy=".5 0 0"/><axis xyz="0 1 1"/></joint>
  <link name="bracket"><inertial><origin xyz="0 .1 0" rpy="0 0 1"/><mass value=".5"/>
    <inertia ixx=".01" iyy=".02" izz=".015" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="screw" type="fixed"><parent link="upper"/><child link="bracket"/>
    <origin xyz=".3 0 0" rpy="0 .7 0"/></joint>
  <link name="camera"><inertial><mass value=".2"/>
    <inertia ixx=".001" iyy=".001" izz=".001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="glue" type="fixed"><parent link="bracket"/><child link="camera"/>
    <origin xyz="0 .2 0" rpy="1 0 0"/></joint>
  <link name="slider"/>
  <joint name="m_slide" type="prismatic"><parent link="bracket"/><child link="slider"/>
    <origin xyz=".1 0 .3"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
  <link name="tool"><inertial><mass value="1"/>
    <inertia ixx=".02" iyy=".02" izz=".03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="flange" type="fixed"><parent link="slider"/><child link="tool"/>
    <origin xyz="0 0 .2"/></joint>
  <link name="wrist"><inertial><mass value="1"/>
    <inertia ixx=".02" iyy=".02" izz=".03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="a_roll" type="revolute"><parent link="upper"/><child link="wrist"/>
    <origin xyz="0 0 .5"/><axis xyz="1 0 0"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def arm(root: Path) -> Library:
    return runtime.load(
        build(BuildRequest("arm", ARM, ChainOptions(gravity=(1.5, -3.0, 9.0))), root).folder
    )


def perturbed(lib: Library, seed: int = 1, size: float = 0.1) -> np.ndarray:
    """A consistent π that is not the URDF's: λ moved at random."""
    lam = lib.lam_from_pi(lib.nearest_realisable(lib.pi0))
    noise = np.random.default_rng(seed).normal(size=lam.size)
    return lib.pi_from_lam(lam + size * noise)


def parameters(model: pinocchio.Model, lib: Library) -> np.ndarray:
    """π that pinocchio read, in pinocchio's order and the library's joint order."""
    ids = [model.getJointId(name) for name in lib.joint_names]
    return np.concatenate([model.inertias[i].toDynamicParameters() for i in ids])


def link(text: str, name: str) -> Element:
    return next(x for x in fromstring(text).findall("link") if x.get("name") == name)


def check_round_trip(lib: Library, folder: Path) -> None:
    pi = perturbed(lib)
    path = folder / "new" / "identified.urdf"
    assert "verified" in write_urdf(lib, pi, path)
    model = pinocchio.buildModelFromXML(export_module._with_limits(path.read_text()))
    np.testing.assert_allclose(
        parameters(model, lib), to_pinocchio_order(pi), rtol=1e-9, atol=1e-12 * np.abs(pi).max()
    )
    assert [p.name for p in path.parent.iterdir()] == ["identified.urdf"]


def test_fr3_reloads_with_the_identified_parameters(fr3: Library, tmp_path: Path) -> None:
    """Oracle: pinocchio parses the file and finds π and the same torques."""
    check_round_trip(fr3, tmp_path)


def test_every_trap_reloads_with_the_identified_parameters(arm: Library, tmp_path: Path) -> None:
    """Oracle: continuous, prismatic, lumped and shuffled joints, pinocchio reads π back."""
    check_round_trip(arm, tmp_path)


@pytest.mark.parametrize("name", ["ur5", "kinova_gen3", "xarm7", "tx40", "tree", "gantry"])
def test_other_robots_reload(name: str, robot: Callable[[str], Library], tmp_path: Path) -> None:
    """Oracle: pinocchio, on robots with lumped tools, continuous and prismatic joints."""
    check_round_trip(robot(name), tmp_path)


def test_fixed_bodies_lose_their_inertial_and_all_else_stays(arm: Library) -> None:
    """Property: only inertials of moving links and of bodies fixed to them change."""
    old, new = arm.urdf(), identified_urdf(arm, perturbed(arm))
    for name in ("bracket", "camera", "tool"):
        assert link(old, name).find("inertial") is not None
        assert link(new, name).find("inertial") is None
    for name in ("base", "pedestal"):
        assert values(link(new, name)) == values(link(old, name))
    roots = [fromstring(text) for text in (old, new)]
    for element in (node for r in roots for node in r.findall("link")):
        for inertial in element.findall("inertial"):
            element.remove(inertial)
    assert values(roots[0]) == values(roots[1])


def values(element: Element) -> list[tuple[str, dict[str, str]]]:
    return [(node.tag, node.attrib) for node in element.iter()]


def test_the_comment_names_tool_model_and_lumping(fr3: Library) -> None:
    text = identified_urdf(fr3, fr3.pi0)
    head = text[: text.index("<robot")]
    assert "identified by symgen" in head
    assert fr3.manifest.model_hash in head
    assert "counted in that link" in head


def test_no_digits_are_lost(fr3: Library) -> None:
    """Property: the mass in the file is the mass of π, bit for bit."""
    pi = perturbed(fr3)
    text = identified_urdf(fr3, pi)
    for name, mass in zip(fr3.link_names, pi[::10], strict=True):
        node = link(text, name).find("inertial/mass")
        assert node is not None
        assert float(node.get("value", "")) == mass


def test_an_impossible_link_is_refused_and_the_old_file_survives(
    fr3: Library, tmp_path: Path
) -> None:
    pi = fr3.pi0.copy()
    pi[10 * 3 + 4] = -1.0
    path = tmp_path / "robot.urdf"
    path.write_text("old")
    with pytest.raises(ExportError, match=r"fr3_link4 cannot exist .*nearest_realisable"):
        write_urdf(fr3, pi, path)
    assert path.read_text() == "old"
    with pytest.raises(ExportError, match="cannot exist"):
        write_urdf(fr3, pi, tmp_path / "new" / "robot.urdf")
    assert [p.name for p in tmp_path.iterdir()] == ["robot.urdf"]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(
    fr3: Library, tmp_path: Path, value: float
) -> None:
    pi = fr3.pi0.copy()
    pi[21] = value
    with pytest.raises(ExportError, match="fr3_link3 are not finite"):
        write_urdf(fr3, pi, tmp_path / "robot.urdf")
    with pytest.raises(ExportError, match="fr3_link3 are not finite"):
        identified_urdf(fr3, pi)
    assert not list(tmp_path.iterdir())


def test_a_massless_link_has_no_centre_of_mass(fr3: Library) -> None:
    pi = fr3.pi0.copy()
    pi[0] = 0.0
    with pytest.raises(ExportError, match="'fr3_link1' has the mass 0 kg"):
        identified_urdf(fr3, pi)


def test_a_wrong_shape_is_named(fr3: Library, tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match=r"pi needs the shape \(70,\), got \(7, 10\)"):
        write_urdf(fr3, fr3.pi0.reshape(7, 10), tmp_path / "robot.urdf")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('xyz="0.3 0 0"', 'xyz="0.3 0 1e-6"', "differ by"),
        ('name="a_roll"', 'name="b_roll"', "has the joints"),
        ("</robot>", "", "is damaged"),
        ('type="continuous"', 'type="nonsense"', "cannot reload"),
        ('"slider"', '"other"', "lacks the link 'slider'"),
    ],
)
def test_the_reload_check_catches_a_urdf_that_is_not_the_robot(
    arm: Library,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    old: str,
    new: str,
    message: str,
) -> None:
    """Oracle: a micrometre, a name or a bracket out of place is found before writing."""
    text = arm.urdf().replace('xyz=".3 0 0"', 'xyz="0.3 0 0"')
    assert old in text
    monkeypatch.setattr(arm, "urdf", lambda: text.replace(old, new))
    with pytest.raises(ExportError, match=message):
        write_urdf(arm, arm.pi0, tmp_path / "robot.urdf")
    assert not list(tmp_path.iterdir())


def test_without_pinocchio_the_sentence_says_so(
    fr3: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pinocchio", None)
    path = tmp_path / "robot.urdf"
    assert "not verified" in write_urdf(fr3, fr3.pi0, path)
    assert path.exists()


def test_a_path_that_cannot_be_written_is_one_sentence(fr3: Library, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "robot.urdf", tmp_path, Path()):
        with pytest.raises(RuntimeFault, match="cannot write"):
            write_urdf(fr3, fr3.pi0, path)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
    assert not list(tmp_path.parent.glob(".*.part"))


def test_the_file_has_the_usual_permissions(fr3: Library, tmp_path: Path) -> None:
    """A temporary file of mkstemp would be readable by its owner only."""
    write_urdf(fr3, fr3.pi0, tmp_path / "robot.urdf")
    (tmp_path / "other").write_text("")
    modes = {path.stat().st_mode for path in tmp_path.iterdir()}
    assert len(modes) == 1
