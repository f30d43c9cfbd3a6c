"""Proxies: fitted around geometry, verified by coal; pairs; distances of degenerate segments."""

import sys
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from runtime.library import load
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.cli import main
from symgen.collision.capsules import coverage, fit_link
from symgen.collision.distance import clearance
from symgen.collision.geometry import EDGE, LinkGeometry, cut, read_geometry
from symgen.collision.model import BASE, CollisionModel, Pair, Proxy, tables_from_collision
from symgen.collision.selection import link_distances, select_pairs
from symgen.errors import BuildError, CollisionError
from symgen.make.config import config_from_table, read_config
from symgen.make.request import bundled_request
from tests.oracle import Array

MASS = """<inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"""
SHAPES = {
    "box": '<box size="0.1 0.2 0.5"/>',
    "cylinder": '<cylinder radius="0.05" length="0.4"/>',
    "sphere": '<sphere radius="0.07"/>',
    "mesh": '<mesh filename="package://nowhere/arm.stl"/>',
}


def arm(*shapes: str) -> str:
    """Links 0.6 m apart in a row, turning about y, each with one shape halfway."""
    links, joints = ['<link name="ground"/>'], []
    for k, shape in enumerate(shapes):
        geometry = f'<collision><origin xyz="0 0.01 0.3" rpy="0.1 0 0"/><geometry>{SHAPES[shape]}'
        end = "</geometry></collision>" if shape in SHAPES else ""
        links.append(f'<link name="l{k}">{MASS}{geometry}{end}</link>')
        parent = f"l{k - 1}" if k else "ground"
        joints.append(
            f'<joint name="j{k}" type="revolute"><origin xyz="0 0 {0.6 if k else 0}"/>'
            f'<parent link="{parent}"/><child link="l{k}"/><axis xyz="0 1 0"/>'
            '<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>'
        )
    return f'<robot name="arm">{"".join(links + joints)}</robot>'


def run(*arguments: str, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(sys, "argv", ["symgen", *arguments])
    with pytest.raises(SystemExit) as stopped:
        main()
    return int(stopped.value.code or 0)


@pytest.fixture(scope="module")
def panda() -> tuple[LinkGeometry, ...]:
    """Collision meshes of the Panda, whose outer shell the FR3 has, on the links of the FR3."""
    try:
        result = files("example-robot-data") or []
    except PackageNotFoundError:
        pytest.skip("the meshes come with the package example-robot-data: pip install .[meshes]")
    (urdf,) = [f for f in result if str(f).endswith("panda_description/urdf/panda.urdf")]
    path = Path(str(urdf.locate())).resolve()
    chain = read_chain(path.read_text(), ChainOptions(tip="panda_link8"))
    geometry = read_geometry(chain, [path.parents[4]])
    return tuple(replace(part, link=part.link.replace("panda", "fr3")) for part in geometry)


@pytest.fixture(scope="module")
def fr3_chain() -> Chain:
    request = bundled_request("fr3")
    return read_chain(request.urdf, request.options)


@pytest.fixture(scope="module")
def fr3_model() -> CollisionModel:
    return bundled_request("fr3").config.collision


def test_fr3_lies_inside_its_proxies(
    panda: tuple[LinkGeometry, ...], fr3_model: CollisionModel
) -> None:
    """Oracle: coal finds no triangle of any link outside, and every link has a proxy."""
    assert [part.link for part in panda] == [BASE, *(f"fr3_link{k}" for k in range(1, 8))]
    for part in panda:
        result = coverage(part, fr3_model.proxies)
        assert result.outside == 0
        assert result.corners > 500
        assert 1 < result.ratio < 2.5  # what robots/fr3.toml says
        thinner = tuple(p.replace(radius=p.radius - 5e-4) for p in fr3_model.proxies)
        assert coverage(part, thinner).outside > 1e-4


def test_fr3_margins_keep_the_links_apart(
    panda: tuple[LinkGeometry, ...], fr3_chain: Chain, fr3_model: CollisionModel
) -> None:
    """Oracle: where all pairs keep their margins, coal keeps 1 cm between meshes of 5 and 7."""
    links = {part.link: part for part in panda}
    q = ca.SX.sym("q", 7)
    distance = ca.Function("d", [q], [clearance(fr3_chain, fr3_model, q)[0]])
    lower, upper = (
        np.array([getattr(j, key) for j in fr3_chain.joints]) for key in ("lower", "upper")
    )
    postures = np.random.default_rng(11).uniform(lower, upper, (3000, 7))
    margins = np.array([p.margin for p in fr3_model.pairs])
    clear = np.asarray(distance.map(3000)(postures.T)).T - margins >= 0
    (close,) = [
        k for k, p in enumerate(fr3_model.pairs) if {p.first, p.second} == {"link5", "link7"}
    ]
    between = link_distances(fr3_chain, links["fr3_link5"], links["fr3_link7"], postures)
    assert between[clear[:, close]].min() > 0.01
    assert between.min() < 0.01  # the limit is needed
    assert clear.all(axis=1).mean() > 0.3  # and leaves most of the range


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere"])
def test_capsules_hold_primitives(shape: str) -> None:
    """Oracle: coal finds nothing outside; the volume is near the best one by hand."""
    (part,) = read_geometry(read_chain(arm(shape)), [])
    proxies = fit_link(part, 3)
    assert part.link == "l0"
    assert coverage(part, proxies).outside == 0
    if shape == "sphere":
        (ball,) = proxies
        assert ball.start == ball.end
        assert ball.radius == pytest.approx(0.07)
        np.testing.assert_allclose(ball.start, [0, 0.01, 0.3], atol=1e-9)
    if shape == "cylinder":
        # r, L of the capsule around a cylinder R = 5 cm, h = 40 cm: the rim touches the caps.
        radius = np.linspace(0.05, 0.2, 20000)
        length = 2 * np.maximum(0.2 - np.sqrt(radius**2 - 0.05**2), 0)
        best = (np.pi * radius**2 * (length + 4 / 3 * radius)).min()
        ours = sum(np.pi * p.radius**2 * (p.length + 4 / 3 * p.radius) for p in proxies)
        # The polygon around the circle takes 1 % of area, the grain half a percent.
        assert best < ours < 1.03 * best


def test_two_capsules_where_one_takes_too_much_air() -> None:
    """Property: an L of two bars gets two capsules, each triangle wholly inside one of them."""
    (bar,) = read_geometry(read_chain(arm("cylinder")), [])
    turned = bar.triangles[..., [2, 0, 1]]
    corner = np.concatenate([bar.triangles - [0, 0, 0.1], turned - [0.1, 0, 0]])
    bent = replace(bar, triangles=corner, volume=2 * bar.volume)
    proxies = fit_link(bent, 3)
    assert len(proxies) == 2
    assert coverage(bent, proxies).outside == 0


def test_triangles_are_cut_without_loss() -> None:
    """Property: edges end below the limit, area and plane stay."""
    whole = np.array([[[0.0, 0, 0], [0.31, 0.02, 0.1], [0.05, 0.2, -0.1]]])
    parts = cut(whole)

    def areas(t: Array) -> Array:
        return np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1) / 2

    sides = np.linalg.norm(parts - np.roll(parts, -1, axis=1), axis=2)
    assert sides.max() <= EDGE
    assert areas(parts).sum() == pytest.approx(areas(whole).sum(), rel=1e-12)


unit = st.floats(-1, 1)
vector = st.tuples(unit, unit, unit)


@given(start=vector, along=vector, other=vector, across=vector, kind=st.integers(0, 5))
def test_distances_of_any_two_segments(
    start: tuple, along: tuple, other: tuple, across: tuple, kind: int
) -> None:
    """Oracle: bounded least squares over both parameters; spheres, parallels, crossings too."""
    a0, d, e, b0 = map(np.array, (start, along, other, across))
    e = {1: 0.7 * d, 2: -1.3 * d, 3: 0 * e, 4: d + 1e-9 * e}.get(kind, e)
    if kind == 5:
        b0 = a0 + 0.3 * d - 0.6 * e  # the axes cross
    proxies = (
        Proxy("a", BASE, tuple(a0), tuple(a0 + d), 0.1),
        Proxy("b", "l0", tuple(b0), tuple(b0 + e), 0.2),
    )
    q = ca.SX.sym("q", 1)
    model = CollisionModel(proxies, (Pair("a", "b", 0.0),))
    result = ca.Function("d", [q], clearance(read_chain(arm("box")), model, q))(0.0)
    answer = lsq_linear(np.column_stack([d, -e]), b0 - a0, (0, 1), tol=1e-15, max_iter=500)
    residual = a0 - b0 + np.column_stack([d, -e]) @ answer.x
    # The solver's own error is about the root of its tolerance where the axes nearly meet.
    assert float(result[0]) + 0.3 == pytest.approx(np.linalg.norm(residual), abs=1e-6)
    assert np.isfinite(np.asarray(result[1])).all()


def test_crossing_axes_have_a_zero_gradient() -> None:
    """Property: depth to the last bit, no NaN, where no direction leads apart."""
    proxies = (
        Proxy("a", BASE, (-1, 0, 0.3), (1, 0, 0.3), 0.1),
        Proxy("b", "l0", (0, -1, 0.3), (0, 1, 0.3), 0.1),
    )
    q = ca.SX.sym("q", 1)
    model = CollisionModel(proxies, (Pair("a", "b", 0.0),))
    distance, jacobian = ca.Function("d", [q], clearance(read_chain(arm("box")), model, q))(0.0)
    assert float(distance) == -0.2
    assert float(jacobian) == 0.0


def test_pairs_that_never_meet_are_left_out() -> None:
    """Property: neighbours and far ones are out, those that can meet are in."""
    chain = read_chain(arm("sphere", "sphere", "sphere", "sphere"))
    geometry = read_geometry(chain, [])
    proxies = tuple(proxy for part in geometry for proxy in fit_link(part, 1))
    far = Proxy("far", BASE, (0, 9, 0), (0, 9, 0), 0.1)
    chosen = select_pairs(chain, (*proxies, far), np.zeros(4), geometry)
    met = {(p.first, p.second) for p in chosen.pairs}
    assert met == {("l0", "l2"), ("l0", "l3"), ("l1", "l3")}
    assert all(p.margin == 0.02 for p in chosen.pairs)
    assert ("l3", "far") in chosen.apart
    assert not chosen.touching
    fat = tuple(proxy.replace(radius=2.0) for proxy in proxies)
    assert ("l0", "l2") in select_pairs(chain, fat, np.zeros(4)).touching


def test_the_command_writes_what_build_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: a URDF with primitives becomes a TOML with the same model; nothing overwritten."""
    urdf, out = tmp_path / "arm.urdf", tmp_path / "arm.toml"
    urdf.write_text(arm("box", "cylinder", "sphere"))
    assert run("proxies", str(urdf), "--out", str(out), monkeypatch=monkeypatch) == 0
    printed = capsys.readouterr().out
    assert "0 mm" in printed
    assert "3 proxies, 1 pairs" in printed
    model = read_config(out).collision
    assert [proxy.link for proxy in model.proxies] == ["l0", "l1", "l2"]
    built = ("build", "--urdf", str(urdf), "--name", "arm", "--config", str(out))
    assert run(*built, "--out", str(tmp_path), monkeypatch=monkeypatch) == 0
    library = load(tmp_path / "arm")
    assert [proxy.joint for proxy in library.proxies] == [0, 1, 2]
    assert library.clearance(np.zeros((5, 3)))[0].shape == (5, 1)
    assert library.plane_clearance(np.zeros(3), [0, 0, 1, 0])[1].shape == (3, 3)
    assert config_from_table(tables_from_collision(model), "here").collision == model
    home = tmp_path / "home.toml"
    home.write_text("home = [0, 0, 0]\n")
    assert read_config(home, out).home == (0, 0, 0)
    with pytest.raises(BuildError, match=r"proxy.* once more"):
        read_config(out, out)
    before = out.read_bytes()
    assert run("proxies", str(urdf), "--out", str(out), monkeypatch=monkeypatch) == 2
    assert "exists; choose another file, or give --overwrite" in capsys.readouterr().err
    assert out.read_bytes() == before


@pytest.mark.parametrize(
    ("shape", "sentence"),
    [
        ("mesh", "could not be found.*--package-dir DIR"),
        ("none", "no link of 'arm' has a <collision>"),
    ],
)
def test_geometry_that_is_not_there(shape: str, sentence: str) -> None:
    """Property: one sentence that says what to do."""
    text = arm("mesh") if shape == "mesh" else arm("box").replace("collision>", "visual>")
    with pytest.raises(CollisionError, match=sentence):
        read_geometry(read_chain(text), [])
