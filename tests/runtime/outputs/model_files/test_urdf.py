"""runtime.outputs.model_files: the URDF reloads as the identified robot; all else in it stays."""

from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio
import pytest
from defusedxml.ElementTree import fromstring

from runtime.errors import ExportError, RuntimeFault, ShapeError
from runtime.library import Library, to_pinocchio_order
from runtime.outputs.model_files.export import write_urdf
from runtime.outputs.model_files.formats.urdf import urdf_text
from runtime.outputs.model_files.model import make_model
from tests.oracle import pinocchio_model
from tests.runtime.exporting import link, perturbed


def identified_urdf(lib: Library, pi: np.ndarray) -> str:
    return urdf_text(make_model(lib, pi))


def parameters(model: pinocchio.Model, lib: Library) -> np.ndarray:
    """π that pinocchio read, in pinocchio's order and the library's joint order."""
    ids = [model.getJointId(name) for name in lib.joint_names]
    return np.concatenate([model.inertias[i].toDynamicParameters() for i in ids])


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
    # The slider has no body of its own, so its inertia cannot be separated from the tool's.
    assert link(old, "tool").find("inertial") is not None
    assert link(new, "tool").find("inertial") is None
    assert link(new, "slider").find("inertial") is not None
    roots = [fromstring(text) for text in (old, new)]
    for element in (node for r in roots for node in r.findall("link")):
        for inertial in element.findall("inertial"):
            element.remove(inertial)
    assert values(roots[0]) == values(roots[1])


def test_a_link_without_mass_carries_its_tool(arm: Library) -> None:
    """Property: with the URDF's own π nothing but rounding is left of the slider less its tool."""
    bodies = make_model(arm, arm.pi0).bodies
    assert bodies.emptied == ("tool",)
    assert bodies.by_link["slider"].mass == 1.0
    assert bodies.by_link["upper"].mass == pytest.approx(4.0, rel=1e-14)


def test_what_cannot_be_split_goes_to_the_moving_link(arm: Library, tmp_path: Path) -> None:
    """Property: an arm lighter than its published camera and bracket; same torques."""
    pi = perturbed(arm)
    upper = 10 * arm.link_names.index("upper")
    pi[upper : upper + 10] *= 0.05  # 0.2 kg, of which 0.7 kg cannot be taken
    path = tmp_path / "arm.urdf"
    assert "verified" in write_urdf(arm, pi, path)
    text = path.read_text()
    assert (
        "The inertial of upper includes bracket, camera, whose inertials were removed"
        in " ".join(text.split())
    )
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
    with pytest.raises(
        ExportError,
        match=r"expected physically consistent links, got fr3_link4 .*nearest_realisable",
    ):
        write_urdf(fr3, pi, path)
    assert path.read_text() == "old"
    with pytest.raises(ExportError, match="expected physically consistent"):
        write_urdf(fr3, pi, tmp_path / "new" / "robot.urdf")
    assert [p.name for p in tmp_path.iterdir()] == ["robot.urdf"]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(
    fr3: Library, tmp_path: Path, value: float
) -> None:
    pi = fr3.pi0.copy()
    pi[21] = value
    with pytest.raises(ExportError, match="expected finite parameters, got others for fr3_link3"):
        write_urdf(fr3, pi, tmp_path / "robot.urdf")
    with pytest.raises(ExportError, match="expected finite parameters, got others for fr3_link3"):
        identified_urdf(fr3, pi)
    assert not list(tmp_path.iterdir())


def test_a_massless_link_has_no_centre_of_mass(fr3: Library) -> None:
    pi = fr3.pi0.copy()
    pi[0] = 0.0
    with pytest.raises(
        ExportError, match="expected a positive mass of the link 'fr3_link1', got 0 kg"
    ):
        identified_urdf(fr3, pi)


def test_a_wrong_shape_is_named(fr3: Library, tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match=r"expected pi of the shape \(70,\), got \(7, 10\)"):
        write_urdf(fr3, fr3.pi0.reshape(7, 10), tmp_path / "robot.urdf")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('xyz="0.3 0 0"', 'xyz="0.3 0 1e-6"', "differ by"),
        ('name="a_roll"', 'name="b_roll"', "has the joints"),
        ('xyz=".1 0 .3"', 'xyz=".1 0 .31"', "run: python -m symgen build"),
        ("</robot>", "", "is damaged"),
        ('type="continuous"', 'type="nonsense"', "cannot reload"),
        ('"slider"', '"other"', "lacks the link 'slider'"),
        ('<parent link="base" />', '<parent link="tool" />', "is not a tree of links"),
    ],
)
def test_the_reload_check_catches_a_urdf_that_is_not_the_robot(
    arm: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, old: str, new: str, message: str
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
