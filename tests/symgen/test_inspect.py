"""`symgen.inspect` on published models, crafted faults, random bodies and broken files."""

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
from symgen.inertia import require_realisable
from symgen.inspect import ERROR, Body, Inspection, inspect_file, inspect_text
from symgen.inspect.geometry import Meshes
from symgen.inspect.urdf import read_urdf
from tests.conftest import TINY_URDF
from tests.taylor import Array

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


def judge(text: str, path: Path = Path("robot.urdf")) -> Inspection:
    return inspect_text(text, path, with_base=False)


def kinds(inspection: Inspection, where: str | None = None) -> set[tuple[str, str]]:
    return {(f.severity, f.kind) for f in inspection.findings if where in {None, f.where}}


def block(mass: float, com: Array, tensor: Array) -> str:
    entries = " ".join(
        f'i{"xyz"[i]}{"xyz"[j]}="{float(tensor[i, j])!r}"' for i in range(3) for j in range(i, 3)
    )
    xyz = " ".join(repr(float(x)) for x in com)
    return f'<inertial><origin xyz="{xyz}"/><mass value="{mass!r}"/><inertia {entries}/></inertial>'


def solid(mass: float, box: tuple[float, float, float]) -> Array:
    """Inertia of a solid box."""
    square = np.array(box) ** 2
    return mass / 12 * np.diag(square.sum() - square)


def steiner(mass: float, com: Array) -> Array:
    """m (|c|² 1 − c cᵀ), the shift from the centre of mass to the link origin."""
    return mass * (com @ com * np.eye(3) - np.outer(com, com))


def arm(inertials: list[str], shapes: dict[int, str] | None = None) -> str:
    """A serial arm with links 0.3 m apart, one <inertial> text per moving link."""
    parts = ['<robot name="arm"><link name="base"/>']
    for k, inertial in enumerate(inertials, 1):
        parent = f"link{k - 1}" if k > 1 else "base"
        axis = ("0 0 1", "0 1 0", "1 0 0")[k % 3]
        parts.append(
            f'<joint name="joint{k}" type="revolute"><origin xyz="0.1 0 0.3"/>'
            f'<parent link="{parent}"/><child link="link{k}"/><axis xyz="{axis}"/>'
            '<limit lower="-2" upper="2" velocity="2" effort="50"/></joint>'
            f'<link name="link{k}">{inertial}{(shapes or {}).get(k, "")}</link>'
        )
    return "".join(parts) + "</robot>"


GOOD = block(2.0, np.array([0.05, 0.01, 0.1]), solid(2.0, (0.1, 0.12, 0.3)))


def before_2024(models: Path) -> str:
    """The FR3 with the manufacturer's inertials until June 2024."""
    folder = models / "franka_fr3"
    lines = (folder / "inertials_4bb824f_pre_triangle_fix.yaml").read_text().splitlines()
    text, values, link = (folder / "fr3.urdf").read_text(), {}, ""
    for line in [*lines, "end:"]:
        key, _, value = (word.strip() for word in line.partition(":"))
        if not line.startswith(" "):
            if values:
                keys = ("xx", "xy", "xz", "yy", "yz", "zz")
                entries = " ".join(f'i{k}="{values[k]}"' for k in keys)
                inertial = (
                    f'<inertial><origin rpy="0 0 0" xyz="{values["xyz"]}"/>'
                    f'<mass value="{values["mass"]}"/><inertia {entries}/></inertial>'
                )
                pattern = rf'(<link name="fr3_{link}">.*?)<inertial>.*?</inertial>'
                text, count = re.subn(pattern, rf"\g<1>{inertial}", text, count=1, flags=re.DOTALL)
                assert count == 1
            link, values = key, {}
        else:
            values[key] = value
    return text


def published(models: Path) -> Iterator[tuple[str, Inspection]]:
    for path in sorted(models.glob("*/*.urdf")):
        yield path.relative_to(models).as_posix(), inspect_file(path, with_base=False)
    yield "fr3_before_2024", judge(before_2024(models))


def test_errors_of_published_models(shared_data: Path) -> None:
    """Real data: exactly the known-bad models have errors, and exactly where."""
    found = {
        name: {f.where for f in inspection.errors}
        for name, inspection in published(shared_data / "models")
    }
    assert len(found) > 20
    assert {name: where for name, where in found.items() if where} == BAD


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
        pattern = rf"link 'wrist_{k}_link': the inertia spreads .* times 10\^-[12] \(a decimal"
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
    inspection = judge(arm([block(body.mass, body.com, body.inertia)]))
    assert not inspection.errors, [f.sentence for f in inspection.errors]


@given(solids(), st.floats(1e-6, 0.3), st.integers(0, 2))
def test_bodies_beyond_the_cone_have_an_error(body: Body, beyond: float, axis: int) -> None:
    """Property: a second moment below zero along any principal axis is an error; so says build."""
    moments, axes = np.linalg.eigh(body.sigma)
    moments[axis] = -beyond * (moments.sum() - moments[axis])
    sigma = axes @ np.diag(moments) @ axes.T
    tensor = np.trace(sigma) * np.eye(3) - sigma
    wrong = Body(body.mass, body.com, (tensor + tensor.T) / 2)
    inspection = judge(arm([block(wrong.mass, wrong.com, wrong.inertia)]))
    assert (ERROR, "triangle") in kinds(inspection, "link 'link1'")
    with pytest.raises(InertiaError):
        require_realisable(Body(wrong.mass, np.zeros(3), wrong.inertia).pi, "link1")


POINT = np.array([0.05, 0.01, 0.1])
BRICK = solid(2.0, (0.1, 0.12, 0.3))
TILTED = np.array([[0.02, 0.004, -0.003], [0.004, 0.025, 0.002], [-0.003, 0.002, 0.018]])
WIDE = np.array([0.05, 0.03, 0.1])
ODD = 0.02 * np.eye(3) + 0.006 * (np.ones((3, 3)) - np.eye(3))
"""Moments 0.032, 0.014, 0.014: impossible; with one product negative 0.026, 0.026, 0.008."""
MIRROR = np.diag([1.0, -1.0, 1.0])
BOX = '<collision><geometry><box size="0.1 0.12 0.3"/></geometry></collision>'

FLAGS = {
    "mass": (arm([block(-1.0, POINT, BRICK)]), ERROR, "mass", "the mass is -1 kg"),
    "no mass": (arm([block(0.0, POINT, BRICK)]), ERROR, "mass", "inertia but no mass"),
    "zero": (arm([block(2.0, POINT, 0 * BRICK)]), ERROR, "zero-inertia", "2 kg without inertia"),
    "missing": (arm([GOOD, ""]), ERROR, "massless", "neither it nor anything on it has mass"),
    "hollow": (arm(["", GOOD]), "warning", "massless", "no mass of its own"),
    "negative": (arm([block(2.0, POINT, -BRICK)]), ERROR, "triangle", "is negative"),
    "no tensor": (
        arm(['<inertial><mass value="1"/></inertial>']),
        ERROR,
        "incomplete",
        "without <inertia>",
    ),
    "no number": (arm([GOOD.replace("2.0", "two")]), ERROR, "unreadable", "got 'two'"),
    "not finite": (arm([GOOD.replace("2.0", "nan")]), ERROR, "unreadable", "got 'nan'"),
    "huge": (arm([GOOD.replace("2.0", "1e200")]), ERROR, "unreadable", "the mass is 1e200"),
    "speck": (arm([GOOD.replace("2.0", "1e-200")]), ERROR, "mass", "more than 1e-09 kg"),
    "two inertials": (arm([GOOD + GOOD]), ERROR, "structure", "2 <inertial>"),
    "sign alone": (
        arm([block(1.0, POINT, ODD)]),
        "warning",
        "sign",
        "with the opposite sign of one product",
    ),
    "sign of a sister": (
        arm([block(2.0, WIDE, TILTED), block(2.0, MIRROR @ WIDE, TILTED)]),
        "warning",
        "sign",
        "no mirror explains the signs",
    ),
    "decimal of the tensor": (
        arm([block(2.0, POINT, 100 * BRICK)], {1: BOX}),
        "warning",
        "size",
        r"times 10\^-[12] \(a decimal point",
    ),
    "decimal without shapes": (
        arm([block(2.0, POINT, 1000 * BRICK), GOOD]),
        "warning",
        "size",
        r"times 10\^-[123] \(a decimal point",
    ),
    "decimal of the mass": (
        arm([block(2000.0, POINT, 1000 * BRICK)], {1: BOX}),
        "warning",
        "density",
        r"the mass times 10\^-[23]",
    ),
    "decimal of one entry": (
        arm([block(2.0, POINT, BRICK * [[1, 1, 1], [1, 1, 1], [1, 1, 0.01]])]),
        "warning",
        "decimal",
        "izz = .* is the one entry",
    ),
    "dense": (arm([block(2.0, POINT, BRICK / 1000)]), "warning", "dense", "denser|matter of at"),
    "airy": (
        arm([block(0.01, POINT, BRICK / 20)]),
        "warning",
        "airy",
        "more than packing foam",
    ),
    "outside": (arm([block(2.0, POINT + 1, BRICK)], {1: BOX}), "warning", "outside", "mm outside"),
    "placeholder": (
        arm([block(2.0, POINT, 0.01 * np.eye(3))]),
        "warning",
        "placeholder",
        "0.01 times the identity",
    ),
    "copied": (
        arm([GOOD, block(1.0, POINT, BRICK)]),
        "warning",
        "copied",
        "that of 'link2', with different masses",
    ),
    "about the origin": (
        arm(
            [
                block(
                    2.0,
                    c,
                    solid(2.0, (0.1, 0.12, 0.2)) + steiner(2.0, c),
                )
                for c in (POINT, POINT * [1, -1, 1], POINT * [-1, 1, 1.5])
            ]
        ),
        "warning",
        "wrong-point",
        "taken about the link origin.*as for all links",
    ),
    "shifted twice": (
        arm([block(2.0, POINT, BRICK - steiner(1.5, POINT))]),
        "warning",
        "wrong-point",
        "shift to the centre of mass had been made twice",
    ),
    "crossed limits": (
        arm([GOOD]).replace('lower="-2"', 'lower="3"'),
        ERROR,
        "limits",
        "lower limit 3 lies above the upper limit 2",
    ),
    "locked": (arm([GOOD]).replace('"-2" upper="2"', '"0" upper="0"'), "warning", "limits", "both"),
    "no limits": (
        re.sub("<limit[^>]*/>", "", arm([GOOD])),
        "warning",
        "limits",
        "no position limits",
    ),
    "degrees": (
        arm([GOOD]).replace('"-2" upper="2"', '"-170" upper="170"'),
        "warning",
        "limits",
        "degrees",
    ),
    "no effort": (arm([GOOD]).replace('effort="50"', 'effort="0"'), "warning", "limits", "is 0"),
    "weak": (
        arm([GOOD]).replace('effort="50"', 'effort="-5"'),
        ERROR,
        "limits",
        "limit is -5",
    ),
    "drives": (
        arm([GOOD]).replace("</joint>", '<dynamics damping="-1" friction="0.1"/></joint>'),
        ERROR,
        "dissipation",
        "the damping is -1",
    ),
    "axis": (arm([GOOD]).replace('xyz="0 1 0"', 'xyz="0 0 0"'), ERROR, "axis", "axis is 0 0 0"),
    "stray link": (
        arm([GOOD]).replace("</robot>", '<link name="stray"/></robot>'),
        ERROR,
        "structure",
        "exactly one root link",
    ),
    "loop": (
        arm([GOOD]).replace('parent link="base"', 'parent link="link1"'),
        ERROR,
        "structure",
        "loop",
    ),
}


@pytest.mark.parametrize("name", FLAGS)
def test_flags(name: str) -> None:
    """Property: a crafted fault is named, once where it is, in one sentence."""
    text, severity, kind, pattern = FLAGS[name]
    found = [f for f in judge(text).findings if (f.severity, f.kind) == (severity, kind)]
    assert any(re.search(pattern, f.sentence) for f in found), [
        f.sentence for f in judge(text).findings
    ]
    assert all("\n" not in f.sentence for f in found)


def test_good_arm_has_no_finding() -> None:
    """Property: none of the checks fires on ordinary bodies, mirrored sisters among them."""
    bricks = [
        block(2.0, POINT, BRICK),
        block(1.5, POINT * [1, -1, 1], 1.1 * TILTED),
        block(1.5, POINT, MIRROR @ (1.1 * TILTED) @ MIRROR),
    ]
    placed = BOX.replace("<geometry>", '<origin xyz="0.05 0.01 0.1"/><geometry>')
    found = judge(arm(bricks, {1: placed}))
    assert found.findings == ()
    assert found.rows[0].density == pytest.approx(2.0 / 0.0036)


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


SIZES = ("1e400", "1e200", "1e-310")


@settings(max_examples=150)
@given(st.integers(0, 2**32))
def test_broken_files_never_crash(seed: int) -> None:
    """Property: whatever is cut, doubled or swapped in a URDF, it is judged or refused by name."""
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
