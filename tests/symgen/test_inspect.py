"""`symgen.inspect` on published models, random bodies, shapes and broken files."""

import random
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from symgen.errors import InertiaError, SymgenError
from symgen.inspect.geometry import Meshes
from symgen.inspect.inspection import Inspection, inspect_file, inspect_text
from symgen.inspect.model import ERROR, Body
from symgen.inspect.reading import read_urdf
from symgen.mechanics.inertia import require_realisable
from tests.conftest import TINY_URDF
from tests.symgen.bodies import BOX, GOOD, POINT, TILTED, arm, before_2024, block, inspect, steiner

BAD = {
    "franka_fer/fer.urdf": {"link 'fer_link4'"},
    "franka_fer/fer_hand.urdf": {"link 'fer_link4'"},
    "kuka_lwr4/kuka_lwr4_gaz.urdf": {f"link 'lwr_{k}_link'" for k in (1, 2, 3, 5, 6, 7)},
    "kuka_lwr4/kuka_lwr4_identified.urdf": {f"link 'lwr_{k}_link'" for k in range(1, 8)}
    | {f"joint 'lwr_{k}_joint'" for k in (3, 4, 5, 6)},
    "staubli_tx40/tx40_mdh_modified.urdf": {"link 'link_6'"},
    "fr3_before_2024": {f"link 'fr3_link{k}'" for k in range(2, 8)},
}
"""Models that cannot exist, as published, and where; checked by hand with eigenvalues."""


def kinds(inspection: Inspection, where: str | None = None) -> set[tuple[str, str]]:
    return {(f.severity, f.kind) for f in inspection.findings if where in {None, f.where}}


def published(models: Path) -> Iterator[tuple[str, Inspection]]:
    for path in sorted(models.glob("*/*.urdf")):
        yield path.relative_to(models).as_posix(), inspect_file(path, with_base=False)
    yield "fr3_before_2024", inspect(before_2024(models))


def test_errors_of_published_models(shared_data: Path) -> None:
    """Real data: exactly the known-bad models have errors, and exactly where."""
    inspected = {
        name: {f.where for f in inspection.errors}
        for name, inspection in published(shared_data / "models")
    }
    assert len(inspected) > 20
    assert {name: where for name, where in inspected.items() if where} == BAD


def test_wrong_point_of_the_fr3(shared_data: Path) -> None:
    """Real data: since 2024 the FR3's inertias are those before plus m|c|², to the last digit.

    Link 1, which had been possible, shows it; the others were also made possible first.
    """
    models = shared_data / "models"
    new = read_urdf((models / "franka_fr3/fr3.urdf").read_text()).links["fr3_link1"].body
    old = read_urdf(before_2024(models)).links["fr3_link1"].body
    assert new is not None
    assert old is not None
    shift = steiner(new.mass, new.com)
    np.testing.assert_allclose(new.inertia - shift, old.inertia, rtol=0, atol=1e-16)
    inspection = inspect_file(models / "franka_fr3/fr3.urdf", with_base=False)
    assert not inspection.errors
    for k in range(1, 8):
        assert ("warning", "wrong-point") in kinds(inspection, f"link 'fr3_link{k}'")


def test_slipped_decimals_of_the_ur5(shared_data: Path) -> None:
    """Real data: wrist inertias 0.111, 0.111, 0.219 kg m² where the successor has 0.0026 … ."""
    path = shared_data / "models/universal_robots/ur5_robot.urdf"
    sentences = [f.sentence for f in inspect_file(path, with_base=False).findings]
    for k in (2, 3):
        pattern = (
            rf"link 'wrist_{k}_link': by its inertia the mass lies .* times 10\^-[12] \(a decimal"
        )
        assert any(re.match(pattern, sentence) for sentence in sentences)


@st.composite
def solids(draw: st.DrawFn) -> Body:
    """Any mass, place, attitude and widths; a blade may be a thousand times thinner than long."""
    small = st.floats(-1, 1)
    widths = np.array(draw(st.tuples(*[st.floats(3e-4, 0.5)] * 3)))
    turn = Rotation.from_rotvec(draw(st.tuples(small, small, small))).as_matrix()
    mass = draw(st.floats(1e-3, 50))
    sigma = turn @ np.diag(mass * widths**2) @ turn.T
    tensor = np.trace(sigma) * np.eye(3) - sigma
    return Body(mass, np.array(draw(st.tuples(small, small, small))), (tensor + tensor.T) / 2)


@given(solids())
def test_bodies_that_exist_have_no_error(body: Body) -> None:
    """Property: second moments above zero, whatever their size, are never called impossible."""
    inspection = inspect(arm([block(body.mass, body.com, body.inertia)]))
    assert not inspection.errors, [f.sentence for f in inspection.errors]


@given(solids(), st.floats(1e-6, 0.3), st.integers(0, 2))
def test_bodies_beyond_the_cone_have_an_error(body: Body, beyond: float, axis: int) -> None:
    """Property: a second moment below zero along any principal axis is an error; so says build."""
    moments, axes = np.linalg.eigh(body.sigma)
    moments[axis] = -beyond * (moments.sum() - moments[axis])
    sigma = axes @ np.diag(moments) @ axes.T
    tensor = np.trace(sigma) * np.eye(3) - sigma
    wrong = Body(body.mass, body.com, (tensor + tensor.T) / 2)
    inspection = inspect(arm([block(wrong.mass, wrong.com, wrong.inertia)]))
    assert (ERROR, "triangle") in kinds(inspection, "link 'link1'")
    with pytest.raises(InertiaError):
        require_realisable(Body(wrong.mass, np.zeros(3), wrong.inertia).pi, "link1")


def test_volumes_of_shapes(tmp_path: Path) -> None:
    """Oracle: closed forms; a mesh is a tetrahedron of volume 1/6, scaled by 0.1 × 0.2 × 0.3."""
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    stl = ["solid t"]
    for face in faces:
        rows = "".join(f"vertex {x} {y} {z}\n" for x, y, z in (corners[i] for i in face))
        stl.append(f"facet normal 0 0 0\nouter loop\n{rows}endloop\nendfacet")
    (tmp_path / "pkg").mkdir()
    (tmp_path / "pkg/t.stl").write_text("\n".join([*stl, "endsolid t"]))
    shapes = {
        '<box size="0.1 0.2 0.3"/>': 0.006,
        '<sphere radius="0.1"/>': 4e-3 / 3 * np.pi,
        '<cylinder radius="0.1" length="0.5"/>': 5e-3 * np.pi,
        '<capsule radius="0.1" length="0.5"/>': 5e-3 * np.pi + 4e-3 / 3 * np.pi,
        '<mesh filename="package://pkg/t.stl" scale="0.1 0.2 0.3"/>': 1e-3,
        '<mesh filename="pkg/t.stl"/>': 1 / 6,
    }
    meshes = Meshes(tmp_path / "robot.urdf")
    for shape, volume in shapes.items():
        text = arm([GOOD], {1: f"<collision><geometry>{shape}</geometry></collision>"})
        extent = meshes.extent(read_urdf(text).links["link1"])
        assert extent is not None
        # 1e-6: STL holds single precision
        assert extent.volume == pytest.approx(volume, rel=1e-6)
    text = arm([GOOD], {1: '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'})
    assert meshes.extent(read_urdf(text).links["link1"]) is None
    assert meshes.missing == ["gone.stl"]
    (tmp_path / "other").mkdir()
    (tmp_path / "pkg/package.xml").write_text("<package/>")
    for folder in (tmp_path, tmp_path.parent, tmp_path / "pkg"):
        away = Meshes(tmp_path / "other/robot.urdf", (folder,))
        text = arm([GOOD], {1: f"<collision><geometry>{[*shapes][4]}</geometry></collision>"})
        assert away.extent(read_urdf(text).links["link1"]) is not None


SIZES = ("1e400", "1e200", "1e-310")


@settings(max_examples=150)
@given(st.integers(0, 2**32))
def test_broken_files_never_crash(seed: int) -> None:
    """Property: a URDF with parts cut, doubled or swapped is checked or rejected by name."""
    rng = random.Random(seed)  # noqa: S311  reproducible, not secret
    text = arm([GOOD, block(1.0, POINT, TILTED), ""], {1: BOX}) if seed % 2 else TINY_URDF
    words = re.split(r"(\W)", text)
    for _ in range(rng.randint(1, 6)):
        k = rng.randrange(len(words))
        words[k] = rng.choice(
            ["", words[k] * 2, rng.choice(words), "-1", "nan", "<link/>", "&x;", "\0", "é", *SIZES]
        )
    broken = "".join(words)
    try:
        inspection = inspect_text(broken, Path("robot.urdf"), with_base=seed % 8 == 0)
    except SymgenError:
        return
    assert all(f.sentence and "\n" not in f.sentence for f in inspection.findings)
