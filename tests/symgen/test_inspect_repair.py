"""The projection that keeps base parameters: cvxpy, Pinocchio, real torque, all else untouched."""

from pathlib import Path

import cvxpy
import numpy as np
import pinocchio
import pytest

from runtime import read_recording
from runtime.identification import metrics
from runtime.library import Library
from runtime.recording.preprocessing import prepare
from symgen.errors import InertiaError
from symgen.inspect import inspection as door
from symgen.inspect.base import lumping
from symgen.inspect.inspection import inspect_file, inspect_text, repaired
from symgen.inspect.model import Body, pseudo_of
from symgen.inspect.repair import FLOOR, ROUND, THIN, Repair, repair, with_bodies
from symgen.mechanics import inertia
from tests.symgen.bodies import BRICK, FLAT, GOOD, POINT, arm, before_2024, block
from tests.taylor import Array


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
    text, changes, again = repaired(inspection, fer)
    assert changes.kept
    assert not again.errors
    assert "fer_link0" not in changes.bodies
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
    _, changes, again = repaired(inspection, shared_data / "fr3.urdf")
    assert not again.errors
    assert not changes.kept
    assert 0 < changes.torque_change < 0.01
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
    new, changes, _ = repaired(inspection, path)
    # 0.25: 50 states of another distribution against 400
    assert relative(torques(text), torques(new)) == pytest.approx(changes.torque_change, rel=0.25)


@pytest.mark.parametrize("fixed", [False, True])
def test_projection_is_the_optimum(*, fixed: bool) -> None:
    """Oracle: cvxpy solves the printed problem in plain coordinates, with P as its unknowns."""
    text = arm([GOOD, FLAT, GOOD])
    if fixed:  # link2 becomes a bracket of link1
        text = text.replace('name="joint2" type="revolute"', 'name="joint2" type="fixed"')
    inspection = inspect_text(text, Path("robot.urdf"))
    base = inspection.base
    assert base is not None
    changes = repair(inspection.model, base)
    assert changes.kept
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
        new = changes.bodies.get(name, body).pseudo_inertia
        value += float(np.sum((root @ (new - body.pseudo_inertia) @ root.T) ** 2))
    assert value > 0.01
    # 1e-5: two interior-point runs at their default tolerances of 1e-8 in a squared distance
    assert value == pytest.approx(optimum.value, rel=1e-5)
    new = with_bodies(text, changes.bodies)
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
    """Property: the text is read and checked again; what is still inconsistent is rejected."""
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
    _, changes, again = repaired(inspection, Path("robot.urdf"))
    assert list(changes.bodies) == ["link25"]
    assert not again.errors
