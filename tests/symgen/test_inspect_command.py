"""`python -m symgen inspect`: exit codes, unreadable files, repair, MJCF."""

import json
import sys
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from symgen.inspect.inspection import inspect_file, inspect_text
from tests.conftest import TINY_URDF
from tests.symgen.bodies import FLAT, GOOD, arm, block
from tests.symgen.test_cli import run


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "arm.urdf"
    path.write_text(arm([GOOD, FLAT]))
    return path


def test_exit_codes(tmp_path: Path, file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: 0 fine, 1 findings, 2 unreadable; --strict counts warnings."""
    fine = tmp_path / "fine.urdf"
    fine.write_text(arm([GOOD]))
    assert run(capsys, "inspect", fine, "--strict")[0] == 0
    fine.write_text(arm([GOOD]).replace('effort="50"', 'effort="0"'))
    code, out, _ = run(capsys, "inspect", fine)
    assert code == 0
    assert "warning: joint 'joint1': the effort limit is 0; expected a positive one" in out
    assert run(capsys, "inspect", fine, "--strict")[0] == 1
    code, out, _ = run(capsys, "inspect", file)
    assert code == 1
    assert "error: link 'link2': the largest principal moment exceeds" in out
    assert "1 error(s)" in out


XACRO = b"<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:arm/></robot>"


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "cannot read"),
        (b"", "not well-formed XML"),
        (b"\xff\xfe", "not UTF-8 text"),
        (b"<robot name='x'", "not well-formed XML"),
        (b"<robot/>", "defines no link"),
        (b"<html/>", "expected a URDF whose first element is <robot>, got <html>"),
        (b"<sdf/>", "expected an <sdf> with a <model>, got <sdf>"),
        (b"<!DOCTYPE a [<!ENTITY b 'c'>]><robot/>", "declares a DTD"),
        (
            b"<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:arm/></robot>",
            "xacro instruction",
        ),
        (b"<mujoco><nonsense/></mujoco>", "MuJoCo cannot parse"),
    ],
)
def test_unreadable_files(
    content: bytes | None, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: exit 2 and one sentence, no traceback, nothing written."""
    path = tmp_path / "bad.urdf"
    if content is not None:
        path.write_bytes(content)
    code, out, err = run(capsys, "inspect", path, "--repair", tmp_path / "out.urdf")
    assert (code, out) == (2, "")
    assert err.startswith("symgen: ")
    assert sentence in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out.urdf").exists()


def test_repair_by_command(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: JSON lists what moved; a file that exists survives without --overwrite."""
    out = file.with_name("better.urdf")
    code, said, _ = run(capsys, "inspect", file, "--repair", out, "--json")
    facts = json.loads(said)
    assert code == 1  # of the file that was inspected
    assert facts["repair"]["keeps_base_parameters"]
    assert "link2" in facts["repair"]["moved"]
    assert facts["base_parameters"]["rank"] == len(facts["base_parameters"]["names"])
    assert [f["kind"] for f in facts["findings"] if f["severity"] == "error"] == ["triangle"]
    assert run(capsys, "inspect", out)[0] == 0
    before = out.read_bytes(), file.read_bytes()
    for target in (out, file):
        code, _, err = run(capsys, "inspect", file, "--repair", target)
        assert code == 2
        assert "exists; choose another file, or give --overwrite" in err
    assert (out.read_bytes(), file.read_bytes()) == before
    assert run(capsys, "inspect", file, "--repair", file, "--overwrite")[0] == 1
    assert run(capsys, "inspect", file)[0] == 0
    code, said, _ = run(capsys, "inspect", file, "--repair", file.with_name("none.urdf"))
    assert "nothing was written" in said
    assert not file.with_name("none.urdf").exists()
    file.write_text(arm([block(0.0, np.array([0.0, 0.0, 0.1]), 0.01 * np.eye(3))]))
    code, said, _ = run(capsys, "inspect", file, "--repair", file.with_name("none.urdf"))
    assert code == 1
    assert "nothing was written; correct by hand: link 'link1': it has inertia but no mass" in said


MJCF = """<mujoco model="m"><worldbody><body name="rod"><joint name="swing" axis="0 1 0"
  range="-60 60" damping="0.1"/><geom type="capsule" size="0.03 0.2" mass="1.5"/>
  <body name="tip" pos="0 0 0.4"><joint name="wrist" axis="1 0 0"/>
  <inertial pos="0 0 0.1" mass="0.5" diaginertia="0.002 0.002 0.001"/></body></body></worldbody>
</mujoco>"""


def test_mjcf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: MuJoCo's own body inertias; what its compiler refuses is an error here."""
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "robot.xml"
    path.write_text(MJCF)
    inspection = inspect_file(path)
    assert inspection.findings == ()
    model = mujoco.MjModel.from_xml_string(MJCF)
    rows = {row.link: row.body for row in inspection.rows}
    for name in ("rod", "tip"):
        expected = np.sort(model.body(name).inertia)
        np.testing.assert_allclose(rows[name].moments, expected, rtol=1e-12)
        assert rows[name].mass == pytest.approx(model.body(name).mass.item(), rel=1e-15)
    path.write_text(MJCF.replace("0.002 0.002 0.001", "0.002 0.002 0.01"))
    code, out, _ = run(capsys, "inspect", path)
    assert code == 1
    assert "MuJoCo rejects it" in out
    assert "error: link 'tip': the largest principal moment exceeds" in out
    code, _, err = run(capsys, "inspect", path, "--repair", tmp_path / "out.urdf")
    assert code == 2
    assert "--repair writes URDF" in err


def test_mjcf_without_mujoco(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: one sentence that says what to install."""
    (tmp_path / "robot.xml").write_text(MJCF)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    code, _, err = run(capsys, "inspect", tmp_path / "robot.xml")
    assert code == 2
    assert "pip install mujoco" in err


def test_negative_friction_is_a_sentence(
    shared_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Real data: a file that Pinocchio refuses is inspected all the same."""
    path = shared_data / "models/kuka_lwr4/kuka_lwr4_identified.urdf"
    with pytest.raises(ValueError, match="friction"):
        pinocchio.buildModelFromXML(path.read_text())
    code, out, err = run(capsys, "inspect", path)
    assert (code, err) == (1, "")
    assert "error: joint 'lwr_5_joint': the friction is -1.20111; expected 0 or more" in out


def test_names_of_base_parameters() -> None:
    """Oracle: a pendulum about y reveals m·x, m·z and its inertia, nothing else."""
    base = inspect_text(TINY_URDF, Path("robot.urdf")).base
    assert base is not None
    assert base.names == ["rod.mX", "rod.mZ", "rod.YY"]
