"""viewer: what stands in the scene is where Pinocchio has it; the server comes and goes."""

import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

from runtime.errors import LibraryError, RecordingError
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import write_motion
from runtime.library import Library
from runtime.outputs.viewer.player import PlayedMotion, Player, Scene, bars, read_motion
from runtime.outputs.viewer.shapes import BASE, WIDER, look_of
from tests.browser import chromium
from tests.oracle import pinocchio_model
from tests.runtime.conftest import Command

pytest.importorskip("viser", reason="the viewer is missing: pip install 'symgen[view]'")

# Sums of seven products of numbers of order one, and a turn into a quaternion and back.
ROUNDING = 1e-12

TRIANGLE = "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid x\n"  # noqa: E501
VISUALS = """<robot name="r"><link name="fr3_link0"/>
<link name="fr3_link7"><visual><origin xyz="0 0 1"/><geometry>
<mesh filename="package://pack/a.stl" scale="2 2 2"/></geometry></visual></link>
<joint name="j" type="fixed"><parent link="fr3_link7"/><child link="hand"/>
<origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/></joint>
<link name="hand"/><joint name="k" type="fixed"><parent link="hand"/><child link="tool"/>
<origin xyz="0.5 0 0"/></joint>
<link name="tool"><visual><geometry><box size="1 1 1"/></geometry></visual></link></robot>"""


@pytest.fixture
def scene(fr3: Library) -> Iterator[Scene]:
    opened = Scene(fr3, look_of(fr3), port=18_080)
    yield opened
    opened.close()


def matrix(position: np.ndarray, wxyz: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(wxyz, scalar_first=True).as_matrix()
    pose[:3, 3] = position
    return pose


def motion(fr3: Library) -> PlayedMotion:
    """Two seconds from home, one radian per second in every joint."""
    t = np.linspace(0, 2, 21)
    q = fr3.home + t[:, None] * np.ones(7)
    return PlayedMotion("m", t, q, np.ones_like(q), None)


def test_links_and_capsules_are_where_pinocchio_has_them(fr3: Library, scene: Scene) -> None:
    """Oracle: the placements of joints, and the ends of the capsules carried along."""
    model = pinocchio_model(fr3.urdf())
    data = model.createData()
    look = look_of(fr3)
    assert {shape.link for shape in look.shapes} == {BASE, *fr3.link_names}
    for q in fr3.home + np.random.default_rng(0).normal(size=(5, 7)):
        scene.pose(q)
        pinocchio.forwardKinematics(model, data, q)
        known = {BASE: np.eye(4)}
        for joint, link in zip(fr3.joint_names, fr3.link_names, strict=True):
            known[link] = data.oMi[model.getJointId(joint)].homogeneous
        for link, frame in scene.frames.items():
            pose = matrix(frame.position, frame.wxyz)
            np.testing.assert_allclose(pose, known[link], rtol=0, atol=ROUNDING)
        for shape, proxy in zip(look.shapes, fr3.manifest.proxies, strict=True):
            start, end = (known[proxy.link] @ [*point, 1] for point in (proxy.start, proxy.end))
            drawn = known[shape.link] @ shape.pose
            # The mesh is a capsule along its own z axis about its centre.
            half = np.linalg.norm(end - start) / 2
            ends = drawn @ [0, 0, -half, 1], drawn @ [0, 0, half, 1]
            np.testing.assert_allclose(ends, [start, end], rtol=0, atol=ROUNDING)
            corner = [proxy.radius, proxy.radius, half + proxy.radius]
            # Its sphere is a polyhedron of 32 segments.
            np.testing.assert_allclose(np.abs(shape.mesh.bounds), [corner] * 2, rtol=0, atol=2e-3)


def test_the_server_serves_until_it_is_closed(fr3: Library) -> None:
    scene = Scene(fr3, look_of(fr3), port=18_080)
    with urllib.request.urlopen(scene.url, timeout=20) as answer:  # noqa: S310  our own server
        assert b"<html" in answer.read()
    scene.close()
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(scene.url, timeout=5)  # noqa: S310


def test_meshes_are_searched_in_packages(
    fr3: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A package beside, levels below, or in ROS's and ament's paths; a hand rides on its link."""
    urdf = tmp_path / "r.urdf"
    urdf.write_text(VISUALS)
    share = tmp_path / "prefix" / "share"
    (share / "pack").mkdir(parents=True)
    (share / "pack" / "a.stl").write_text(TRIANGLE)
    missing = look_of(fr3, urdf)
    assert [shape.link for shape in missing.shapes] == ["fr3_link7"]
    assert "not drawn: package://pack/a.stl (not found; name the folder" in missing.sentence
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "prefix"))
    (share / "pack" / "package.xml").write_text("<package/>")
    for packages in ((), (share,), (share / "pack",), (tmp_path,)):
        look = look_of(fr3, urdf, packages)
        assert look.sentence == "2 visual shapes"
        monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{share}")
    mesh, box = look_of(fr3, urdf).shapes
    np.testing.assert_allclose(mesh.pose, [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 1], [0, 0, 0, 1]])
    # Half a metre along the hand's x, which is the link's y.
    expected = [[0, -1, 0, 0], [1, 0, 0, 0.5], [0, 0, 1, 0.1], [0, 0, 0, 1]]
    np.testing.assert_allclose(box.pose, expected, rtol=0, atol=ROUNDING)
    assert box.link == "fr3_link7"


def test_without_shapes_there_are_solids(fr3: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: each capsule ends at the next frame, the last one at the tip; a cylinder stands in
    every joint, about its axis.
    """
    monkeypatch.setattr(fr3, "manifest", replace(fr3.manifest, proxies=()))
    look = look_of(fr3)
    assert look.sentence == "solids between the joints, because the URDF has no visual shapes"
    frames = dict(zip(fr3.link_names, fr3.link_poses(fr3.home), strict=True)) | {BASE: np.eye(4)}
    ends = [*fr3.link_poses(fr3.home)[:, :3, 3], fr3.end_effector(fr3.home)[:3, 3]]
    radius = look.shapes[len(ends)].mesh.extents[2] / (2 * WIDER)
    for shape, end in zip(look.shapes, ends, strict=False):
        half = shape.mesh.bounds[1, 2] - radius
        assert shape.mesh.is_watertight
        reached = frames[shape.link] @ shape.pose @ [0, 0, half, 1]
        np.testing.assert_allclose(reached[:3], end, rtol=0, atol=ROUNDING)
    for shape, joint in zip(look.shapes[len(ends) :], fr3.manifest.all_joints, strict=True):
        np.testing.assert_allclose(shape.pose[:3, 2], joint.axis, rtol=0, atol=ROUNDING)
        np.testing.assert_array_equal(shape.pose[:3, 3], 0.0)


def test_bad_models_are_one_sentence(fr3: Library, tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match=r"cannot read '.*none.urdf'"):
        look_of(fr3, tmp_path / "none.urdf")
    (tmp_path / "text.urdf").write_text("hello")
    with pytest.raises(LibraryError, match="is not a URDF"):
        look_of(fr3, tmp_path / "text.urdf")


def test_a_motion_is_straight_between_samples(fr3: Library) -> None:
    m = motion(fr3)
    for t, expected in ((-1.0, 0.0), (0.0, 0.0), (0.25, 0.25), (2.0, 2.0), (9.0, 2.0)):
        q, dq, tau = m.at(t)
        np.testing.assert_allclose(q - fr3.home, expected, rtol=0, atol=ROUNDING)
        assert dq is not None
        assert tau is None
    one = PlayedMotion("one", m.t[:1], m.q[:1], None, None)
    np.testing.assert_array_equal(one.at(3.0)[0], m.q[0])


def test_trajectories_and_logs_are_read(fr3: Library, tmp_path: Path) -> None:
    """Oracle: the kernels at the trajectory's own times; a log as it is."""
    trajectory = Trajectory(fr3.home, 0.1 * np.ones((7, 2)), 2.0)
    write_motion(trajectory, fr3, tmp_path / "m.json")
    m = read_motion(str(tmp_path / "m.json"), fr3)
    q, dq, ddq, _ = trajectory.at(fr3, m.t)
    assert (m.duration, len(m.t)) == (2.0, 201)
    np.testing.assert_array_equal(m.q, q)
    np.testing.assert_array_equal(m.tau, fr3.inverse_dynamics(q, dq, ddq, fr3.pi0))
    names = ",".join(f"q{j}" for j in range(1, 8))
    values = "\n".join(f"{5 + t},{','.join('0.5' for _ in range(7))}" for t in (0, 1, 3))
    (tmp_path / "log.csv").write_text(f"t,{names}\n{values}\n")
    log = read_motion(str(tmp_path / "log.csv"), fr3)
    np.testing.assert_array_equal(log.t, [0, 1, 3])
    assert log.tau is None
    (tmp_path / "two.csv").write_text("t,q1,q2\n0,1,2\n1,1,2\n")
    with pytest.raises(RecordingError, match="expected 7 joints of 'fr3', got 2"):
        read_motion(str(tmp_path / "two.csv"), fr3)


def test_play_pause_speed_and_scrubbing(fr3: Library, scene: Scene) -> None:
    player = Player(fr3, scene, motion(fr3))

    def turned() -> float:
        pose = fr3.link_poses(fr3.home + player.time.value)[-1]
        np.testing.assert_allclose(scene.frames["fr3_link7"].position, pose[:3, 3], atol=0.01)
        return float(player.time.value)

    player.tick(0.5)
    assert turned() == 0.5
    player.speed.value = "2"
    player.tick(0.5)
    assert turned() == 1.5
    player.tick(0.5)
    assert turned() == 0.5  # from the end to the start
    player.play.value = False
    player.tick(0.5)
    assert turned() == 0.5
    player.time.value = 1.25
    player.tick(0.1)
    assert turned() == 1.25
    assert "–" in player.bars.content  # the torque is unknown


def test_bars_are_shares_of_the_limits(fr3: Library) -> None:
    joint = fr3.manifest.joints[0]
    q, dq, tau = np.zeros(7), np.zeros(7), np.zeros(7)
    q[0], dq[0], tau[0] = joint.upper, -joint.velocity / 2, 0.25 * joint.effort
    first = bars(fr3, q, dq, tau).split("<tr")[2]
    assert [part.split("%")[0].split(">")[-1] for part in first.split("opacity:.6")[1:]] == [
        "100 ",
        "50 ",
        "25 ",
    ]
    assert "#D55E00" in first  # at its limit
    assert first.count("#0072B2") == 2


def test_the_browser_shows_controls_and_a_canvas(fr3: Library, scene: Scene) -> None:
    """Oracle: Chromium, drawing without a graphics card."""
    player = Player(fr3, scene, motion(fr3))
    player.play.value = False
    with chromium("--use-angle=swiftshader", "--enable-unsafe-swiftshader") as browser:
        page = browser.new_page(viewport={"width": 320, "height": 240})  # drawn by the processor
        page.goto(scene.url)
        page.get_by_text("dq rad/s").wait_for()
        assert page.locator("canvas").count() >= 1
        assert page.get_by_text("time [s]").count() == 1


def test_the_film_is_one_file(fr3: Library, tmp_path: Path, command: Command) -> None:
    write_motion(Trajectory(fr3.home, 0.1 * np.ones((7, 2)), 0.2), fr3, tmp_path / "m.json")
    ran = command("view", "m.json", "--robot", fr3.folder, "--html", "film.html")
    assert ran.code == 0, ran.err
    assert "drawn:  collision capsules" in ran.out
    assert "__VISER_EMBED_DATA__" in (tmp_path / "film.html").read_text(encoding="utf-8")


def test_without_viser_there_is_a_sentence(
    fr3: Library, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_motion(Trajectory(fr3.home, 0.1 * np.ones((7, 2)), 0.2), fr3, tmp_path / "m.json")
    monkeypatch.setitem(sys.modules, "viser", None)
    ran = command("view", "m.json", "--robot", fr3.folder, "--settings", "no_open=true")
    assert ran.code == 2
    assert "viser, which is not installed; run: pip install 'symgen[view]'" in ran.err
