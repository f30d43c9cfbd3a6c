"""model_files: a written file is the identified robot in its own engine, or is not written."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import SubElement, tostring

import mujoco
import numpy as np
import pinocchio
import pytest
import yaml
from defusedxml.ElementTree import fromstring

from runtime.errors import ExportError, RuntimeFault
from runtime.library import Library
from runtime.outputs.model_files import export
from runtime.outputs.model_files.export import export_model
from runtime.outputs.model_files.export_format import EXPORT_FORMATS, usual_formats
from runtime.outputs.model_files.joint_friction import KEYS, Drives
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.urdf_tree import read_tree
from runtime.recording import Friction
from tests.oracle import pinocchio_model, random_states
from tests.runtime.exporting import perturbed

TERMS = Friction(("viscous", "coulomb", "offset", "rotor"))
EVERY = usual_formats()


def friction_of(lib: Library) -> np.ndarray:
    """φ of `TERMS` (n, 4): one damping is negative, one number what YAML 1.1 takes for text."""
    phi = np.random.default_rng(2).uniform(0.1, 1.0, (lib.n_joints, 4))
    phi[0, 0], phi[-1, 1] = -0.1, 1e-05
    return phi


def drives_of_arm(lib: Library) -> Drives:
    """Drives with a delay and undetermined biases; gains are unknown, so that MJCF has motors."""
    n = lib.n_joints
    known, unknown = tuple(0.1 * (k + 1) for k in range(n)), (None,) * n
    values = {key: unknown if key == "encoder_bias" else known for key in KEYS}
    return Drives(lib.joint_names, values, values, known, known, unknown, unknown)


def exported(lib: Library, folder: Path, *kinds: str) -> dict[str, tuple[str, str]]:
    """Kind → text of the file and the sentence; every file must have been verified."""
    done = export_model(
        lib,
        perturbed(lib),
        kinds or EVERY,
        folder,
        terms=TERMS,
        phi=friction_of(lib),
        drives=drives_of_arm(lib),
    )
    assert [(each.kind, each.sentence[:9]) for each in done] == [
        (each.kind, "verified:") for each in done
    ]
    return {
        each.kind: (each.path.read_text() if each.path.is_file() else "", each.sentence)
        for each in done
        if each.path
    }


@pytest.mark.parametrize("name", ["fr3", "arm", "tree", "gantry"])
def test_every_format_reloads_in_its_engine(
    name: str, arm: Library, robot: Callable[[str], Library], tmp_path: Path
) -> None:
    """Oracle: pinocchio, MuJoCo, Drake and a C compiler, on tilted gravity and branches too."""
    lib = arm if name == "arm" else robot(name)
    files = exported(lib, tmp_path)
    assert set(files) == set(EVERY)
    assert len(list(tmp_path.iterdir())) == len(EVERY)


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
    """Property: damping, dry friction and rotor by joint; negative or other columns are listed."""
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
        assert "without a counterpart here, omitted: offset" in head


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
        ("mjcf", 'mass="0.5"', 'mass="0.51"', "torques that differ by"),
        ("mjcf", 'pos="0.1 0.0 0.3"', 'pos="0.1 0.0 0.31"', "run: python -m symgen build"),
        ("mjcf", 'frictionloss="', 'frictionloss="1', "friction of joint 'z_turn' is 1"),
        ("mjcf", '<joint name="a_roll"', '<joint name="b_roll"', "cannot reload"),
        ("sdf", "<mass>0.5</mass>", "<mass>0.501</mass>", "torques that differ by"),
        ("sdf", "<damping>", "<damping>1", "damping of joint 'a_roll' is 1"),
        ("sdf", "</model>", "", "cannot reload the sdf"),
        ("inertials", "mass: 0.5", "mass: 0.55", "is not the one that was written"),
        ("inertials", "camera:", "kamera:", "the entry 'camera' is not the one"),
        ("friction", "damping: 0.0", "damping: 1e-3", "by PyYAML, the entry 'z_turn'"),
        ("header", "_identified_pi[", "_identified_py[", "cannot reload the header"),
        ("header", "0.0", "0.5", "reads other numbers"),
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
    right = EXPORT_FORMATS[kind]

    def wrong(model: IdentifiedModel) -> str:
        text = right.write(model)
        assert old in text
        return text.replace(old, new, 1)

    monkeypatch.setattr(export, "EXPORT_FORMATS", {kind: replace(right, write=wrong)})
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
    done = export_model(arm, perturbed(arm), EVERY, tmp_path, terms=TERMS,
                        phi=friction_of(arm), drives=drives_of_arm(arm))  # fmt: skip
    needs = {
        "pinocchio": {"urdf", "inertials", "friction"},
        "mujoco": {"mjcf"},
        "pydrake": {"sdf"},
        "yaml": {"inertials", "friction", "actuators"},
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
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)  # zig
    (done,) = export_model(arm, perturbed(arm), ["header"], tmp_path / "out")
    assert "not checked" in done.sentence
    assert "C compiler" in done.sentence


def test_files_that_are_there_stay(arm: Library, tmp_path: Path) -> None:
    """Property: nothing is replaced without leave, and one file there stops all."""
    (tmp_path / "arm.xml").write_text("mine")
    with pytest.raises(RuntimeFault, match=r"arm\.xml' exists; .*--overwrite"):
        export_model(arm, perturbed(arm), ["urdf", "mjcf"], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["arm.xml"]
    export_model(arm, perturbed(arm), ["mjcf"], tmp_path, overwrite=True)
    assert "<mujoco" in (tmp_path / "arm.xml").read_text()
    with pytest.raises(ExportError, match=r"no model file format 'vrml'; choose from urdf, "):
        export_model(arm, perturbed(arm), ["vrml"], tmp_path)


def test_impossible_links_stop_all_but_friction(arm: Library, tmp_path: Path) -> None:
    """Property: least squares may find a negative mass; its friction is still friction."""
    pi = perturbed(arm)
    pi[0] = -1.0
    done = export_model(arm, pi, tuple(EXPORT_FORMATS), tmp_path, terms=TERMS, phi=friction_of(arm))
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


def test_links_without_mass_are_lumped(
    arm: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: engines reload a massless base fixed to the world, and a tool of inertia 1e-6.

    Drake does not know a frame of the world, and no engine an inertia without a mass.
    """
    root = fromstring(arm.urdf())
    base = read_tree(arm).base
    assert base == "world"
    for name, parent in (("plate", base), ("probe", "wrist")):
        SubElement(root, "link", {"name": name})
        joint = SubElement(root, "joint", {"name": f"{name}_joint", "type": "fixed"})
        SubElement(joint, "origin", {"xyz": "0.1 0.2 0.3", "rpy": "0.1 0 0"})
        SubElement(joint, "parent", {"link": parent})
        SubElement(joint, "child", {"link": name})
    for joint in root.findall("joint"):  # what stood on the world stands on the plate
        parent = joint.find("parent")
        if parent.get("link") == base and joint.find("child").get("link") != "plate":
            parent.set("link", "plate")
    root.find("joint[@name='plate_joint']/origin").attrib.clear()
    inertial = SubElement(root.find("link[@name='probe']"), "inertial")
    SubElement(inertial, "mass", {"value": "0"})
    SubElement(inertial, "inertia", {f"i{a}": "1e-6" for a in ("xx", "yy", "zz")})
    text = tostring(root, "unicode")
    monkeypatch.setattr(Library, "urdf", lambda self: text)
    files = exported(arm, tmp_path, "urdf", "mjcf", "sdf")
    written = fromstring(files["urdf"][0])
    assert written.find("link[@name='probe']/inertial") is None
    assert "inertial of wrist includes probe" in " ".join(files["urdf"][0].split())
