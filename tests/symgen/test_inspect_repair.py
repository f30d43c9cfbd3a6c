"""The projection that keeps base parameters: cvxpy, Pinocchio, real torque, files, the command."""

import json
import sys
from pathlib import Path

import cvxpy
import numpy as np
import pinocchio
import pytest

from runtime import metrics, read_recording
from runtime.library import Library
from runtime.preprocessing import prepare
from symgen import inertia
from symgen.errors import InertiaError
from symgen.inspect import Body, Repair, inspect_file, inspect_text, repaired
from symgen.inspect import inspection as door
from symgen.inspect.base import lumping, pseudo_of
from symgen.inspect.repair import FLOOR, ROUND, THIN, repair
from symgen.inspect.rewrite import with_bodies
from tests.conftest import TINY_URDF
from tests.symgen.test_cli import run
from tests.symgen.test_inspect import BRICK, GOOD, POINT, arm, before_2024, block
from tests.taylor import Array

FLAT = block(1.5, POINT, BRICK - np.diag([0.0, 0.0, 0.003]) + np.diag([0.004, 0, 0]))
"""J = 0.0242, 0.0167, 0.0011: impossible by 0.0065."""


def torques(text: str, seed: int = 0) -> Array:
    """Pinocchio's τ at 50 random states."""
    model = pinocchio.buildModelFromXML(text)
    data, rng = model.createData(), np.random.default_rng(seed)
    states = rng.uniform(-2, 2, (50, 3, model.nv))
    return np.array([pinocchio.rnea(model, data, q, dq, ddq) for q, dq, ddq in states])


def relative(before: Array, after: Array) -> float:
    """Root mean square of the change, each joint by its own torque."""
    scale = np.sqrt(np.mean(before**2, axis=0))
    return float(np.sqrt(np.mean(((after - before) / scale) ** 2)))


@pytest.fixture(scope="module")
def fer(shared_data: Path) -> Path:
    return shared_data / "models/franka_fer/fer.urdf"


def test_fer_keeps_every_torque(fer: Path) -> None:
    """Oracle: Pinocchio on both files; link 4 can exist afterwards, masses and the rest stay."""
    inspection = inspect_file(fer)
    text, found, again = repaired(inspection, fer)
    assert found.kept
    assert not again.errors
    assert "fer_link0" not in found.bodies
    before, after = torques(inspection.text or ""), torques(text)
    # 17 digits through two recursions, condition of K about 1e3
    assert np.abs(after - before).max() <= 1e-11 * np.abs(before).max()
    for name, link in again.model.links.items():
        old = inspection.model.links[name].body
        if link.body is not None and old is not None:
            assert link.body.mass == pytest.approx(old.mass, rel=1e-14)
            assert link.body.is_realisable


def test_fr3_before_2024_predicts_no_worse(shared_data: Path, fr3: Library) -> None:
    """Real data: e on the last 40 % of panda_gaz, nothing fitted, at most 4.18 %.

    The impossible original has 4.18 %, the manufacturer's own repair 4.47 %.
    """
    text = before_2024(shared_data / "models")
    inspection = inspect_text(text, shared_data / "fr3.urdf")
    _, found, again = repaired(inspection, shared_data / "fr3.urdf")
    assert not again.errors
    assert not found.kept
    assert 0 < found.torque_change < 0.01
    log = prepare(read_recording(shared_data / "data/panda_gaz"))
    part = slice(int(0.6 * len(log)), None)

    def error(pi: Array) -> float:
        tau = fr3.inverse_dynamics(log.q[part], log.dq[part], log.ddq[part], pi)
        return metrics.torque_error(log.tau[part], tau).overall

    pi = np.concatenate([_pi(again.model.links[name].body) for name in fr3.link_names])
    assert error(pi) <= 4.18
    assert error(fr3.pi0) > 4.4


def _pi(body: Body | None) -> Array:
    assert body is not None
    return body.pi


def test_reported_torque_change(shared_data: Path) -> None:
    """Oracle: Pinocchio; the change that is reported is the one at other random states."""
    path = shared_data / "models/kuka_lwr4/kuka_lwr4_identified.urdf"
    text = before_2024(shared_data / "models")
    inspection = inspect_text(text, path)
    new, found, _ = repaired(inspection, path)
    # 0.25: 50 states of another distribution against 400
    assert relative(torques(text), torques(new)) == pytest.approx(found.torque_change, rel=0.25)


@pytest.mark.parametrize("fixed", [False, True])
def test_projection_is_the_optimum(*, fixed: bool) -> None:
    """Oracle: cvxpy solves the printed problem in plain coordinates, with P as its unknowns."""
    text = arm([GOOD, FLAT, GOOD])
    if fixed:  # link2 becomes a bracket of link1
        text = text.replace('name="joint2" type="revolute"', 'name="joint2" type="fixed"')
    inspection = inspect_text(text, Path("robot.urdf"))
    base = inspection.base
    assert base is not None
    found = repair(inspection.model, base)
    assert found.kept
    names = [name for name, link in inspection.model.links.items() if link.body is not None]
    old = {name: _body(inspection.model.links[name].body) for name in names}
    unknowns = {name: cvxpy.Variable((4, 4), symmetric=True) for name in names}
    whole = base.parameters.matrix @ lumping(inspection.model, base.chain, names)
    pi = cvxpy.hstack([_pi_of(p) for p in unknowns.values()])
    start = np.concatenate([body.pi for body in old.values()])
    distance, constraints = 0, [whole @ pi == whole @ start]
    for name, p in unknowns.items():
        body = old[name]
        root = np.linalg.inv(np.linalg.cholesky(pseudo_of(_near(body, ROUND))))
        least = pseudo_of(body.pi if body.is_realisable else _near(body, THIN))
        distance += cvxpy.sum_squares(root @ (p - body.pseudo_inertia) @ root.T)
        constraints += [root @ (p - FLOOR * least) @ root.T >> 0, p[3, 3] == body.mass]
    optimum = cvxpy.Problem(cvxpy.Minimize(distance), constraints)
    optimum.solve(solver="CLARABEL")
    value = 0.0
    for name in names:
        body = old[name]
        root = np.linalg.inv(np.linalg.cholesky(pseudo_of(_near(body, ROUND))))
        new = found.bodies.get(name, body).pseudo_inertia
        value += float(np.sum((root @ (new - body.pseudo_inertia) @ root.T) ** 2))
    assert value > 0.01
    # 1e-5: two interior-point runs at their default tolerances of 1e-8 in a squared distance
    assert value == pytest.approx(optimum.value, rel=1e-5)
    new = with_bodies(text, found.bodies)
    assert np.abs(torques(new) - torques(text)).max() <= 1e-11 * np.abs(torques(text)).max()


def _body(body: Body | None) -> Body:
    assert body is not None
    return body


def _near(body: Body, floor: float) -> Array:
    return np.asarray(inertia.nearest_realisable(inertia.ca.DM(body.pi), floor)).ravel()


def _pi_of(p: cvxpy.Variable) -> cvxpy.Expression:
    sigma = p[:3, :3]
    i = cvxpy.trace(sigma) * np.eye(3) - sigma
    entries = [p[3, 3], p[0, 3], p[1, 3], p[2, 3]]
    entries += [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return cvxpy.hstack(entries)


def test_everything_else_stays() -> None:
    """Property: outside the <inertial> blocks that moved, the text is the same to the byte."""
    text = "<?xml version='1.0'?>\n<!-- häufig <inertial> -->\n" + arm([GOOD, FLAT, "\n  " + GOOD])
    inspection = inspect_text(text, Path("robot.urdf"))
    link = inspection.model.links["link2"].body
    moved = Body(3.0, np.array([0.1, -0.2, 1 / 3]), np.diag([0.1, 0.2, 0.25]))
    new = with_bodies(text, {"link2": moved, "link3": _body(link)})
    assert new.split("<inertial>")[0:3] == text.split("<inertial>")[0:3]
    rest = [part.split("</inertial>")[-1] for part in new.split("<inertial>")]
    assert rest == [part.split("</inertial>")[-1] for part in text.split("<inertial>")]
    read = inspect_text(new, Path("robot.urdf"), with_base=False).model.links["link2"].body
    assert read is not None
    assert (read.mass, *read.com) == (moved.mass, *moved.com)
    assert np.array_equal(read.inertia, moved.inertia)


def test_what_cannot_be_repaired() -> None:
    """Property: no mass is invented."""
    inspection = inspect_text(arm([GOOD, block(-1.0, POINT, BRICK)]), Path("robot.urdf"))
    with pytest.raises(InertiaError, match=r"link 'link2' has the mass -1 kg, .* correct it"):
        repaired(inspection, Path("robot.urdf"))


def test_a_failed_repair_is_not_handed_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: the text is read and judged again; what is still impossible is refused."""
    inspection = inspect_text(arm([GOOD, FLAT]), Path("robot.urdf"))
    monkeypatch.setattr(door, "repair", lambda *_: Repair({}, 0.0, True))
    with pytest.raises(InertiaError, match=r"not written: .* link 'link2'"):
        repaired(inspection, Path("robot.urdf"))


def test_too_large_for_base_parameters() -> None:
    """Property: without base parameters each link is projected on its own, and it is said."""
    text = arm([GOOD] * 24 + [FLAT])
    inspection = inspect_text(text, Path("robot.urdf"))
    assert inspection.base is None
    assert any("25 moving joints are more than 24" in note for note in inspection.notes)
    _, found, again = repaired(inspection, Path("robot.urdf"))
    assert list(found.bodies) == ["link25"]
    assert not again.errors


# --- the command -----------------------------------------------------------------------------


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
        (b"<sdf/>", "expected a URDF whose first element is <robot>, got <sdf>"),
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
    """Property: JSON tells what moved; a file that exists survives without --overwrite."""
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
        assert "exists; name another file, or allow it with --overwrite" in err
    assert (out.read_bytes(), file.read_bytes()) == before
    assert run(capsys, "inspect", file, "--repair", file, "--overwrite")[0] == 1
    assert run(capsys, "inspect", file)[0] == 0
    code, said, _ = run(capsys, "inspect", file, "--repair", file.with_name("none.urdf"))
    assert "nothing was written" in said
    assert not file.with_name("none.urdf").exists()


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
    assert "MuJoCo refuses it" in out
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
