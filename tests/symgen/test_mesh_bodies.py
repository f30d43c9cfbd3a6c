"""Bodies of links without <inertial> from closed meshes: `build --settings densities=FILE`."""

from pathlib import Path

import numpy as np
import pytest

from symgen.chain import read_chain
from symgen.errors import BuildError, SymgenError
from symgen.make.mesh_bodies import moments_of, read_densities, with_mesh_bodies
from symgen.ros.packages import Packages
from tests.symgen.test_cli import run

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)
"""Two triangles per side, all outward."""
SIZES = np.array([0.1, 0.2, 0.4])
URDF = """<robot name="arm"><link name="base"/>
<joint name="swing" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<link name="rod"><visual><origin xyz="0 0 0.3" rpy="0 0 1.5707963267948966"/><geometry>
<mesh filename="package://parts/box.stl" scale="0.1 0.2 0.4"/></geometry></visual></link></robot>"""


def written(folder: Path, faces: np.ndarray) -> None:
    """The URDF, and a package with the cube as STL."""
    (folder / "parts").mkdir()
    lines = ["solid box"]
    for face in faces:
        corners = "\n".join(f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in CUBE[face])
        lines.append(f"facet normal 0 0 0\nouter loop\n{corners}\nendloop\nendfacet")
    (folder / "parts/box.stl").write_text("\n".join([*lines, "endsolid box"]))
    (folder / "parts/package.xml").write_text("<package><name>parts</name></package>")
    (folder / "arm.urdf").write_text(URDF)


@pytest.mark.parametrize("inward", [False, True])
def test_a_box_has_its_closed_form(inward: bool) -> None:
    """Oracle: volume, centre and second moment of a box; inward triangles give the same."""
    corners = CUBE * SIZES - [0.3, 0.0, 0.1]
    faces = FACES[:, ::-1] if inward else FACES
    moments = moments_of(corners, faces, "box")
    volume, centre = np.prod(SIZES), SIZES / 2 - [0.3, 0.0, 0.1]
    assert moments.volume == pytest.approx(volume, rel=1e-12)
    np.testing.assert_allclose(moments.first, volume * centre, rtol=1e-12)
    second = volume * (np.diag(SIZES**2) / 12 + np.outer(centre, centre))
    np.testing.assert_allclose(moments.second, second, atol=1e-15)


def test_a_link_gets_the_body_of_its_mesh(tmp_path: Path) -> None:
    """Oracle: a box of 1000 kg/m³, turned by a quarter and moved by its <origin>."""
    written(tmp_path, FACES)
    packages = Packages((tmp_path / "parts",))
    text, links = with_mesh_bodies(URDF, tmp_path, {"default": 1000.0}, packages)
    assert links == ("rod",)
    (joint,) = read_chain(text).joints
    assert joint.mass == pytest.approx(8.0)
    np.testing.assert_allclose(joint.com, [-0.1, 0.05, 0.5], atol=1e-9)
    x, y, z = 0.2, 0.1, 0.4
    expected = 8.0 / 12 * np.diag([y**2 + z**2, x**2 + z**2, x**2 + y**2])
    np.testing.assert_allclose(joint.inertia, expected, atol=1e-9)


def test_faults_are_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: an open mesh, a missing one, links and densities that do not fit."""
    written(tmp_path, FACES[1:])
    (tmp_path / "dense.toml").write_text("default = 1000\n")
    words = ("build", "--urdf", tmp_path / "arm.urdf", "--name", "arm", "--out", tmp_path / "out")
    given = (
        "--settings",
        f"densities={tmp_path / 'dense.toml'}",
        "--settings",
        f"package={tmp_path / 'parts'}",
    )
    code, _, sentence = run(capsys, *words, *given)
    assert code == 2
    assert "box.stl' of link 'rod' is not a closed surface (3 of its edges have no" in sentence
    packages = Packages((tmp_path / "parts",))
    missing = URDF.replace("box.stl", "none.stl")
    for text, densities, said in (
        (missing, {"rod": 1.0}, "cannot read the mesh"),
        (URDF, {"roof": 1.0}, "'roof', which the URDF does not define"),
        (URDF, {"base": 1.0}, "'base', which has no mesh"),
    ):
        with pytest.raises(SymgenError, match=said):
            with_mesh_bodies(text, tmp_path, densities, packages)
    (tmp_path / "dense.toml").write_text("rod = -1\n")
    with pytest.raises(BuildError, match=r"rod expects a density above 0 in kg/m.3, got -1"):
        read_densities(tmp_path / "dense.toml")
