"""Model files that a fuzzer found a way through: each is one sentence now."""

import os
from pathlib import Path

import pytest

from runtime.common.files import json_of
from symgen.chain import read_chain
from symgen.chain.mechanism import Mechanism
from symgen.collision.geometry import read_geometry
from symgen.errors import BuildError, CollisionError, SymgenError
from symgen.inspect.inspection import inspect_file
from symgen.make.config import read_config
from symgen.make.request import request_from_folder
from symgen.sources import Source, read_source, urdf_text
from tests.conftest import TINY_URDF

DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 1 2 0 3 1 0 2 3 1 3 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>
"""


def with_mesh(folder: Path, dae: str) -> Path:
    (folder / "mesh.dae").write_bytes(dae.encode("latin1"))
    shape = '<collision><geometry><mesh filename="mesh.dae"/></geometry></collision>'
    path = folder / "robot.urdf"
    path.write_text(TINY_URDF.replace("</inertial>", f"</inertial>{shape}"))
    return path


def test_a_good_mesh_is_measured(tmp_path: Path) -> None:
    """Oracle: 1.5 kg in a corner of a unit cube, 1/6 m³."""
    inspection = inspect_file(with_mesh(tmp_path, DAE), with_base=False)
    assert inspection.rows[0].density == pytest.approx(9.0)


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ("3 1 0 2", "3\xff\xff 1 0 2"),
        ("3 1 0 2", "3 x1 0 2"),
        ("1 0 0 0", "1 0 0 ?"),
        ("<asset>", "<!DOCTYPE x []><asset>"),
        ("<node>", "<node>" * 300),
    ],
    ids=["no XML", "no index", "no number", "DTD", "depth"],
)
def test_a_mesh_of_no_numbers_is_not_loaded(tmp_path: Path, good: str, bad: str) -> None:
    """Property: what sends the loader into an endless loop is passed over, and reported."""
    dae = DAE.replace(good, bad)
    assert dae != DAE
    inspection = inspect_file(with_mesh(tmp_path, dae), with_base=False)
    assert inspection.rows[0].density is None
    assert any("mesh.dae" in note for note in inspection.notes)


@pytest.mark.parametrize("number", ["nan", "1e300", "1e-12"])
def test_a_body_of_mjcf_has_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: str
) -> None:
    """Property: files that MuJoCo rejects or accepts are checked like URDFs, and leave no log."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><worldbody><body name="rod"><joint/><inertial pos="0 0 0.1" '
        f'mass="{number}" diaginertia="0.02 0.02 0.01"/></body></worldbody></mujoco>'
    )
    inspection = inspect_file(path)
    assert inspection.rows == ()
    assert [each.name for each in tmp_path.iterdir()] == ["robot.xml"]
    assert any(f.kind in {"unreadable", "structure"} for f in inspection.errors)


def test_shapes_are_in_metres(tmp_path: Path) -> None:
    """Property: a box of kilometres would be cut into triangles of two centimetres."""
    shape = '<collision><geometry><box size="1e4 1 1"/></geometry></collision>'
    chain = read_chain(TINY_URDF.replace("</inertial>", f"</inertial>{shape}"))
    with pytest.raises(CollisionError, match="reaches 5000 m"):
        read_geometry(chain, [])


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir, lambda p: p.symlink_to("/dev/zero")])
def test_only_files_are_read(tmp_path: Path, make) -> None:
    """Property: a pipe is not waited for, and a device is not read to its end."""
    folder = tmp_path / "robot"
    folder.mkdir()
    for name in ("robot.urdf", "robot.toml", "manifest.json"):
        make(folder / name)
    for read in (
        lambda: urdf_text(folder / "robot.urdf"),
        lambda: inspect_file(folder / "robot.urdf"),
        lambda: read_config(folder / "robot.toml"),
        lambda: request_from_folder(folder),
    ):
        with pytest.raises(SymgenError, match=r"regular file|not a complete generated folder"):
            read()


def test_integers_that_no_double_holds_are_refused(tmp_path: Path) -> None:
    """Property: 400 digits raise no OverflowError where a length is read."""
    (tmp_path / "robot.toml").write_text(f'[[link]]\nname = "a"\na = {"9" * 400}\n')
    with pytest.raises(BuildError, match="more than 19 digits"):
        read_source(Source(tmp_path / "robot.toml"), Mechanism())
    (tmp_path / "x.json").write_text("9" * 400)
    with pytest.raises(ValueError, match="more than 19 digits"):
        json_of(tmp_path / "x.json")


def test_a_link_far_beyond_any_room_is_measured(tmp_path: Path) -> None:
    """Property: the square of a distance of 1e308 m overflows, the distance does not."""
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><worldbody><body name="rod"><joint/><inertial pos="0 0 0.1" mass="1" '
        'diaginertia="0.02 0.02 0.01"/><body name="tip" pos="1e308 1e308 0"><joint/><inertial '
        'pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.01"/></body></body></worldbody></mujoco>'
    )
    assert len(inspect_file(path).rows) == 2
