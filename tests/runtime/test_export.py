"""runtime.export: a written file is the identified robot in its own engine, or is not written."""

import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element

import mujoco
import numpy as np
import pinocchio
import pytest
import yaml
from defusedxml.ElementTree import fromstring

import runtime
from runtime.errors import ExportError, RuntimeFault, ShapeError
from runtime.export import (
    FORMATS,
    Format,
    Model,
    export_model,
    make_model,
    urdf_text,
    write_urdf,
)
from runtime.library import Library, to_pinocchio_order
from runtime.recording import Friction
from symgen.build import build
from symgen.chain import ChainOptions
from symgen.request import BuildRequest
from tests.oracle import pinocchio_model, random_states

# Every trap at once: a continuous and a prismatic joint, a moving link without an inertial of its
# own, a rotated inertial, fixed bodies in a row on a moving link, a fixed body on the base, a
# moving joint behind a fixed body, joints in no alphabetic order; gravity is tilted as well. For
# SDF and MJCF a root called world, fixed joints named as their links, a flange without mass.
ARM = """<robot name="arm"><link name="world"/>
  <joint name="base" type="fixed"><parent link="world"/><child link="base"/>
    <origin xyz="0 0 .4" rpy="0 .3 0"/></joint>
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
  <link name="flange"/>
  <joint name="flange" type="fixed"><parent link="slider"/><child link="flange"/>
    <origin xyz="0 0 .2" rpy="0 0 1"/></joint>
  <joint name="tool_mount" type="fixed"><parent link="flange"/><child link="tool"/>
    <origin xyz="0 .1 0" rpy="1 0 0"/></joint>
  <link name="wrist"><inertial><mass value="1"/>
    <inertia ixx=".02" iyy=".02" izz=".03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="a_roll" type="revolute"><parent link="upper"/><child link="wrist"/>
    <origin xyz="0 0 .5"/><axis xyz="1 0 0"/><limit effort="5" velocity="2"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def arm(root: Path) -> Library:
    return runtime.load(
        build(
            BuildRequest("arm", ARM, ChainOptions(gravity=(1.5, -3.0, 9.0))),
            root,
            levels=["portable"],
        ).folder
    )


def perturbed(lib: Library, seed: int = 1, size: float = 0.1) -> np.ndarray:
    """A consistent π that is not the URDF's: λ moved at random."""
    lam = lib.lam_from_pi(lib.nearest_realisable(lib.pi0))
    noise = np.random.default_rng(seed).normal(size=lam.size)
    return lib.pi_from_lam(lam + size * noise)


def identified_urdf(lib: Library, pi: np.ndarray) -> str:
    return urdf_text(make_model(lib, pi))


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
    model = pinocchio_model(path.read_text())
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


def test_fixed_bodies_keep_their_inertial_and_all_else_stays(arm: Library) -> None:
    """Property: only inertials of moving links change, and of what an empty link carries."""
    old, new = arm.urdf(), identified_urdf(arm, perturbed(arm))
    for name in ("bracket", "camera", "base", "pedestal"):
        assert link(old, name).find("inertial") is not None
        assert values(link(new, name)) == values(link(old, name))
    # The slider has no body of its own, so there is nothing to tell it from the tool.
    assert link(old, "tool").find("inertial") is not None
    assert link(new, "tool").find("inertial") is None
    assert link(new, "slider").find("inertial") is not None
    roots = [fromstring(text) for text in (old, new)]
    for element in (node for r in roots for node in r.findall("link")):
        for inertial in element.findall("inertial"):
            element.remove(inertial)
    assert values(roots[0]) == values(roots[1])


def test_a_link_without_matter_of_its_own_carries_its_tool(arm: Library) -> None:
    """Property: with the URDF's own π nothing but rounding is left of the slider less its tool."""
    split = make_model(arm, arm.pi0).split
    assert split.emptied == ("tool",)
    assert split.bodies["slider"].mass == 1.0
    assert split.bodies["upper"].mass == pytest.approx(4.0, rel=1e-14)


def test_what_cannot_be_split_goes_to_the_moving_link(arm: Library, tmp_path: Path) -> None:
    """Property: an arm lighter than its published camera and bracket; same torques."""
    pi = perturbed(arm)
    upper = 10 * arm.link_names.index("upper")
    pi[upper : upper + 10] *= 0.05  # 0.2 kg, of which 0.7 kg cannot be taken
    path = tmp_path / "arm.urdf"
    assert "verified" in write_urdf(arm, pi, path)
    text = path.read_text()
    assert "upper carries the inertia of bracket, camera too" in " ".join(text.split())
    for name in ("bracket", "camera"):
        assert link(text, name).find("inertial") is None


def values(element: Element) -> list[tuple[str, dict[str, str]]]:
    return [(node.tag, node.attrib) for node in element.iter()]


def test_the_comment_names_tool_model_and_gravity(fr3: Library) -> None:
    text = identified_urdf(fr3, fr3.pi0)
    head = text[: text.index("<robot")]
    assert "identified by symgen" in head
    assert fr3.manifest.model_hash in head
    assert "0.0 0.0 -9.81 m/s^2" in head


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
        ('xyz=".1 0 .3"', 'xyz=".1 0 .31"', "placement or the axis of a joint"),
        ("</robot>", "", "is damaged"),
        ('type="continuous"', 'type="nonsense"', "cannot reload"),
        ('"slider"', '"other"', "lacks the link 'slider'"),
        ('<parent link="base" />', '<parent link="tool" />', "is no tree of links"),
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


TERMS = Friction(("viscous", "coulomb", "offset", "rotor"))


def friction_of(lib: Library) -> np.ndarray:
    """φ of `TERMS` (n, 4): one damping is negative, one number what YAML 1.1 takes for text."""
    phi = np.random.default_rng(2).uniform(0.1, 1.0, (lib.n_joints, 4))
    phi[0, 0], phi[-1, 1] = -0.1, 1e-05
    return phi


def exported(lib: Library, folder: Path, *kinds: str) -> dict[str, tuple[str, str]]:
    """Kind → text of the file and the sentence; every file must have been verified."""
    done = export_model(
        lib, perturbed(lib), kinds or tuple(FORMATS), folder, terms=TERMS, phi=friction_of(lib)
    )
    assert [(each.kind, each.sentence[:9]) for each in done] == [
        (each.kind, "verified:") for each in done
    ]
    return {each.kind: (each.path.read_text(), each.sentence) for each in done if each.path}


@pytest.mark.parametrize("name", ["fr3", "arm", "tree", "gantry"])
def test_every_format_reloads_in_its_own_engine(
    name: str,
    arm: Library,
    robot: Callable[[str], Library],
    tmp_path: Path,
) -> None:
    """Oracle: pinocchio, MuJoCo, Drake and a C compiler, on tilted gravity and branches too."""
    lib = arm if name == "arm" else robot(name)
    files = exported(lib, tmp_path)
    assert set(files) == set(FORMATS)
    assert len(list(tmp_path.iterdir())) == len(FORMATS)


def test_mujoco_and_pinocchio_move_alike(arm: Library, tmp_path: Path) -> None:
    """Oracle: the two engines on their own files, with damping and armature, by joint name."""
    files = exported(arm, tmp_path, "urdf", "mjcf")
    ours = mujoco.MjModel.from_xml_string(files["mjcf"][0])
    theirs = pinocchio_model(files["urdf"][0], arm.gravity)
    np.testing.assert_array_equal(ours.opt.gravity, arm.gravity)
    ours.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, other, phi = mujoco.MjData(ours), theirs.createData(), friction_of(arm)
    # MuJoCo's own order is that of the library.
    assert [ours.joint(k).name for k in range(ours.njnt)] == list(arm.joint_names)
    columns = [theirs.joints[theirs.getJointId(name)].idx_v for name in arm.joint_names]
    for q, dq, ddq in zip(*random_states(arm.n_joints, 20, 5), strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(ours, data)
        x, v, a = (np.empty(theirs.nv) for _ in range(3))
        x[columns], v[columns], a[columns] = q, dq, ddq
        tau = pinocchio.rnea(theirs, other, x, v, a)[columns]
        tau += np.maximum(phi[:, 0], 0) * dq + phi[:, 3] * ddq
        # 10³ operations of 1e-16 on torques of some 100 N m.
        np.testing.assert_allclose(data.qfrc_inverse, tau, rtol=0, atol=1e-10)


def test_friction_is_what_it_is_called(arm: Library, tmp_path: Path) -> None:
    """Property: damping, dry friction and rotor by joint; what drives or has no name is told."""
    files = exported(arm, tmp_path)
    phi = friction_of(arm)
    model = mujoco.MjModel.from_xml_string(files["mjcf"][0])
    np.testing.assert_array_equal(model.dof_damping, [0.0, *phi[1:, 0]])
    np.testing.assert_array_equal(model.dof_frictionloss, phi[:, 1])
    np.testing.assert_array_equal(model.dof_armature, phi[:, 3])
    table = yaml.safe_load(files["friction"][0])
    for name, row in zip(arm.joint_names, phi, strict=True):
        assert table[name]["dynamic"] == {"damping": max(row[0], 0.0), "friction": row[1]}
    for kind in ("urdf", "mjcf", "sdf", "friction"):
        head = " ".join(files[kind][0].split())
        assert f"damping of {arm.joint_names[0]} was identified as -0.1" in head
        assert "without a counterpart here, left out: offset" in head


def test_yaml_is_that_of_franka_description(
    fr3: Library, shared_data: Path, tmp_path: Path
) -> None:
    """Oracle: the maker's own files: the same keys, and for the same π the same numbers."""
    export_model(fr3, fr3.pi0, ["inertials", "friction"], tmp_path, terms=TERMS,
                 phi=friction_of(fr3))  # fmt: skip
    folder = shared_data / "models" / "franka_fr3"
    text = (folder / "inertials.yaml").read_text().replace("  inertia:\n  inertia:", "  inertia:")
    theirs, ours = yaml.safe_load(text), yaml.safe_load((tmp_path / "inertials.yaml").read_text())
    assert list(ours) == list(theirs)
    for link, entry in theirs.items():
        assert set(ours[link]) == set(entry)
        assert ours[link]["mass"] == pytest.approx(entry["mass"], rel=1e-15)
        # π0 is inertia about the link's origin: one parallel-axis shift there and back.
        assert ours[link]["inertia"] == pytest.approx(entry["inertia"], rel=0, abs=1e-15)
    friction = yaml.safe_load((tmp_path / "dynamics.yaml").read_text())
    published = yaml.safe_load((folder / "dynamics.yaml").read_text())
    assert list(friction) == list(published)
    assert set(friction["joint1"]["dynamic"]) <= set(published["joint1"]["dynamic"])


@pytest.mark.parametrize(
    ("kind", "old", "new", "message"),
    [
        ("mjcf", 'mass="0.5"', 'mass="0.51"', "link 'upper' is another"),
        ("mjcf", 'pos="0.1 0.0 0.3"', 'pos="0.1 0.0 0.31"', "placement or the axis of a joint"),
        ("mjcf", 'frictionloss="', 'frictionloss="1', "friction of joint 'z_turn' is 1"),
        ("mjcf", '<joint name="a_roll"', '<joint name="b_roll"', "cannot reload"),
        ("sdf", "<mass>0.5</mass>", "<mass>0.501</mass>", "link 'upper' is another"),
        ("sdf", "<damping>", "<damping>1", "damping of joint 'a_roll' is 1"),
        ("sdf", "</model>", "", "cannot reload the sdf"),
        ("inertials", "mass: 0.5", "mass: 0.55", "link 'upper' is another"),
        ("inertials", "camera:", "kamera:", "unknown keys kamera"),
        ("friction", "damping: 0.0", "damping: 1e-3", "decimal point, got '1e-3'"),
        ("header", "_identified_pi[", "_identified_py[", "cannot reload the header"),
        ("header", "0.0", "0.5", "reads another"),
    ],
)
def test_a_file_that_is_not_the_robot_is_not_written(
    kind: str,
    old: str,
    new: str,
    message: str,
    arm: Library,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Oracle: each engine finds the fault in its file; the sentence says where it lies."""
    right = FORMATS[kind]

    def wrong(model: Model) -> str:
        text = right.write(model)
        assert old in text
        return text.replace(old, new, 1)

    monkeypatch.setitem(FORMATS, kind, Format(right.name, wrong, right.check))
    (done,) = export_model(arm, perturbed(arm), [kind], tmp_path, terms=TERMS, phi=friction_of(arm))
    assert done.path is None
    assert done.sentence.startswith("not written: ")
    assert message in done.sentence
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("module", ["pinocchio", "mujoco", "pydrake", "yaml"])
def test_without_an_engine_the_file_is_left_unchecked(
    module: str, arm: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: what cannot be read again says so and what to install."""
    for name in [name for name in sys.modules if name.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    done = export_model(arm, perturbed(arm), tuple(FORMATS), tmp_path, terms=TERMS,
                        phi=friction_of(arm))  # fmt: skip
    needs = {
        "pinocchio": {"urdf", "inertials", "friction"},
        "mujoco": {"mjcf"},
        "pydrake": {"sdf"},
        "yaml": {"inertials", "friction"},
    }
    unchecked = {each.kind for each in done if "not checked" in each.sentence}
    assert unchecked == needs[module]
    assert all("pip install" in each.sentence for each in done if each.kind in unchecked)
    assert all(each.path and each.path.exists() for each in done)


def test_without_a_compiler_the_header_is_left_unchecked(
    arm: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    (done,) = export_model(arm, perturbed(arm), ["header"], tmp_path / "out")
    assert "not checked" in done.sentence
    assert "C compiler" in done.sentence


def test_files_that_are_there_stay(arm: Library, tmp_path: Path) -> None:
    """Property: nothing is replaced without leave, and one file there stops all."""
    (tmp_path / "arm.xml").write_text("mine")
    with pytest.raises(ExportError, match=r"arm\.xml' exists; .*--overwrite"):
        export_model(arm, perturbed(arm), ["urdf", "mjcf"], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["arm.xml"]
    export_model(arm, perturbed(arm), ["mjcf"], tmp_path, overwrite=True)
    assert "<mujoco" in (tmp_path / "arm.xml").read_text()
    with pytest.raises(ExportError, match=r"expected some of urdf, .*got 'usd'"):
        export_model(arm, perturbed(arm), ["usd"], tmp_path)


def test_impossible_links_stop_all_but_friction(arm: Library, tmp_path: Path) -> None:
    """Property: least squares may find a negative mass; its friction is still friction."""
    pi = perturbed(arm)
    pi[0] = -1.0
    done = export_model(arm, pi, tuple(FORMATS), tmp_path, terms=TERMS, phi=friction_of(arm))
    assert [each.kind for each in done if each.path] == ["friction"]
    (none,) = export_model(arm, pi, ["friction"], tmp_path / "new")
    assert "no viscous or dry friction" in none.sentence


def test_links_on_the_boundary_are_exported(arm: Library, tmp_path: Path) -> None:
    """Property: a flat wrist, as convex estimators like them: I_zz = I_xx + I_yy exactly."""
    pi = perturbed(arm)
    wrist = 10 * arm.link_names.index("wrist")
    pi[wrist : wrist + 10] = [1.0, 0, 0, 0, 0.02, 0.03, 0.05, 0, 0, 0]
    done = export_model(arm, pi, ("urdf", "mjcf", "sdf", "inertials", "header"), tmp_path)
    assert [each.sentence[:9] for each in done] == ["verified:"] * 5


def test_names_that_other_formats_have_taken(arm: Library, tmp_path: Path) -> None:
    """Property: both have a world already; SDF has one set of names, and no massless links."""
    files = exported(arm, tmp_path, "mjcf", "sdf")
    sdf = fromstring(files["sdf"][0])
    assert {frame.get("name") for frame in sdf.iter("frame")} == {"flange", "tool"}
    links = ["base", "bracket", "camera", "pedestal", "slider", "upper", "wrist"]
    assert sorted(x.get("name", "") for x in sdf.iter("link")) == links
    assert "base_fixed" in {x.get("name") for x in sdf.iter("joint")}
    bodies = {x.get("name") for x in fromstring(files["mjcf"][0]).iter("body")}
    assert bodies == {*links, "flange", "tool"}


def test_without_pinocchio_the_sentence_says_so(
    fr3: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pinocchio", None)
    path = tmp_path / "robot.urdf"
    assert "not checked" in write_urdf(fr3, fr3.pi0, path)
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
