"""runtime.inspection: the traps of models, signs, gears and units are named.

The clean log is the bundled simulation (another program made it); each trap is put into it, or
is in a published log or model as it is. What is expected is what was put in.
"""

import copy
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from runtime import Recording
from runtime.inspection import inspect_log, recipe_text
from runtime.inspection.checks.signals import unsigned_torque
from runtime.library import Library
from runtime.recording import Friction
from runtime.recording.preprocessing.segments import differentiate
from runtime.recording.recipes.recipe_file import load_recipe
from tests.oracle import pinocchio_model
from tests.runtime.diagnosis import kinds, require_no_warning, sentences


def gravity_of(lib: Library, q: np.ndarray, pi: np.ndarray) -> np.ndarray:
    return lib.inverse_dynamics(q, 0 * q, 0 * q, pi)


def test_1_a_tool_that_the_model_lacks(lib: Library, clean: Recording, saved) -> None:
    """Property: 0.8 kg at the flange, to the 0.15 kg that links 10 % off feign there."""
    full = differentiate(clean)
    tool = np.array([0.8, 0.02, 0, 0.12, 0.02, 0.02, 0.001, 0, 0, 0])
    Y = lib.regressor(full.q, full.dq, full.ddq)[:, :, -10:]
    result = inspect_log(saved(clean, tau=clean.tau + Y @ tool), lib)
    assert set(sentences(result)) == {"tool"}
    assert "tool" in kinds(result)
    mass = next(f for f in result.findings if f.kind == "tool").evidence["mass_kg"]
    assert mass == pytest.approx(0.8, abs=0.15)


def test_1_a_hand_that_is_not_mounted(lib: Library, shared_data: Path) -> None:
    """Real data: a Panda without hand against a model with its 0.73 kg."""
    armed = copy.copy(lib)
    hand = np.array([0.73, -0.0073, 0, 0.095, 0.0155, 0.0139, 0.0026, 0, 0, 0])
    armed.pi0 = lib.pi0 + np.concatenate([np.zeros(60), hand])
    result = inspect_log(shared_data / "data" / "panda_gaz", armed, "panda_gaz")
    assert set(sentences(result)) == {"tool"}
    assert "not mounted" in sentences(result)["tool"]


def test_3_torque_counts_the_other_way(lib, clean, saved, tmp_path) -> None:
    """Property: reported as a sign and not as gravity, and proposed, not done."""
    log = saved(clean, tau=-clean.tau)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"torque_sign"}
    assert "torque_sign" in kinds(result)
    assert result.plan.torque.sign == -1.0
    require_no_warning(result, log, lib, tmp_path)


def test_3_one_joint_counts_the_other_way(lib, clean, saved, tmp_path) -> None:
    """Property: the joint is named."""
    sign = np.array([1.0, 1, 1, -1, 1, 1, 1])
    log = saved(clean, tau=clean.tau * sign)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"torque_sign"}
    assert "fr3_joint4" in sentences(result)["torque_sign"]
    assert result.plan.torque.sign == tuple(sign)
    require_no_warning(result, log, lib, tmp_path)


def test_3_velocity_of_one_joint_is_turned(lib, clean, saved, tmp_path) -> None:
    """Property: dq against the derivative of q."""
    sign = np.array([1.0, 1, -1, 1, 1, 1, 1])
    log = saved(clean, dq=clean.dq * sign)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"velocity_sign"}
    require_no_warning(result, log, lib, tmp_path)


def test_4_a_torque_that_no_sensor_has_measured(lib: Library, clean: Recording, saved) -> None:
    """Property: the model's own output, friction included, is too good to be true."""
    full = differentiate(clean.replace(dq=None))
    pi = lib.pi0 * 1.05
    tau = lib.inverse_dynamics(full.q, full.dq, full.ddq, pi) + 0.5 * full.dq
    result = inspect_log(saved(clean, dq=None, tau=tau), lib)
    assert set(sentences(result)) == {"not_measured"}
    assert "not_measured" in kinds(result)


def test_4_one_joint_moves(lib: Library, clean: Recording, saved) -> None:
    """Property: six joints at rest show no friction, which does not make their torque computed."""
    moves = np.arange(lib.n_joints) == 1
    still = clean.replace(q=np.where(moves, clean.q, clean.q[0]), dq=None, ddq=None)
    full = differentiate(still)
    friction = moves * (2.0 * full.dq + 1.0 * np.tanh(full.dq / 0.05))
    noise = 0.05 * np.random.default_rng(1).standard_normal(full.q.shape)
    tau = lib.inverse_dynamics(full.q, full.dq, full.ddq, 1.05 * lib.pi0) + friction + noise
    assert "not_measured" not in sentences(inspect_log(saved(still, tau=tau), lib))


def test_4_a_name_that_says_command(lib: Library, clean: Recording, tmp_path: Path) -> None:
    """Property: `tau_des` is read only where there is no measured torque, and then it is told."""
    titles = [*(f"q{j}" for j in range(1, 8)), *(f"tau_des_{j}" for j in range(1, 8))]
    rows = np.column_stack([clean.t, clean.q, clean.tau])
    log = tmp_path / "log.csv"
    np.savetxt(log, rows, delimiter=",", header=",".join(["time", *titles]), comments="")
    assert "tau_des_1" in sentences(inspect_log(log, lib))["not_measured"]
    titles += [f"tau_{j}" for j in range(1, 8)]
    rows = np.column_stack([rows, clean.tau])
    np.savetxt(log, rows, delimiter=",", header=",".join(["time", *titles]), comments="")
    result = inspect_log(log, lib)
    assert result.plan.torque.columns[0] == "tau_1"
    assert "not_measured" not in sentences(result)


@pytest.mark.parametrize(
    ("scale", "said", "build"),
    [
        (-1.0, "reversed", "--name fr3_turned --gravity 0,0,9.81 "),
        (0.0, "absent", "--name fr3_weightless --gravity 0,0,0 "),
    ],
)
def test_5_gravity_the_other_way_round(lib, clean, saved, scale, said, build) -> None:
    """Property: only consistent bodies determine the sign; a free fit is as good either way."""
    tau = clean.tau + (scale - 1.0) * gravity_of(lib, clean.q, lib.pi0)
    result = inspect_log(saved(clean, tau=tau), lib)
    assert said in sentences(result)["gravity"]
    assert f"symgen build --urdf {lib.folder / 'fr3.urdf'} {build}" in sentences(result)["gravity"]
    assert "gravity" in kinds(result)


def test_5_an_arm_on_the_wall(lib: Library, clean: Recording, saved) -> None:
    """Oracle: Pinocchio's inverse dynamics with gravity along x of the base."""
    model = pinocchio_model(lib.urdf(), np.array([9.81, 0.0, 0.0]))
    data, full = model.createData(), differentiate(clean)
    tau = np.array(
        [pinocchio.rnea(model, data, *row) for row in zip(full.q, full.dq, full.ddq, strict=True)]
    )
    noise = np.random.default_rng(0).normal(0, 0.05, tau.shape)
    result = inspect_log(saved(clean, tau=tau + noise), lib)
    said = sentences(result)["gravity"]
    assert f"--urdf {lib.folder / 'fr3.urdf'} --name fr3_wall --gravity 9.81,0,0 " in said
    assert (lib.folder / "fr3.urdf").exists()
    assert "once more with gravity along -x" in said


def test_5_a_base_that_is_tilted_by_some_degrees(lib: Library, clean: Recording, saved) -> None:
    """Oracle: Pinocchio's gravity torque, 4° from the vertical: the vector and no other cause.

    Links and friction of the log leave 0.2 % of the torque, a tenth of what the tilt leaves.
    """
    tilt = np.radians(4.0)
    vector = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    change = 0.0
    for gravity, sign in ((vector, 1.0), (np.array(lib.gravity), -1.0)):
        model = pinocchio_model(lib.urdf(), gravity)
        data = model.createData()
        change += sign * np.array(
            [pinocchio.computeGeneralizedGravity(model, data, q) for q in clean.q]
        )
    result = inspect_log(saved(clean, tau=clean.tau + change), lib)
    (finding,) = (f for f in result.findings if f.level != "info")
    assert finding.kind == "gravity"
    np.testing.assert_allclose(finding.evidence["gravity"], vector, atol=9.81 * np.radians(1.0))
    numbers = ",".join(f"{x:g}" for x in np.round(finding.evidence["gravity"], 2) + 0.0)
    assert f"--name fr3_tilted --gravity {numbers} " in finding.sentence


def test_6_coupled_gears(robot, shared_data: Path) -> None:
    """Real data: the wrist of a TX40, its friction fitted joint by joint."""
    recipe = load_recipe("tx40_figaroh")
    plain = recipe.replace(friction=Friction(("viscous", "coulomb", "offset", "rotor")))
    result = inspect_log(shared_data / "data" / "tx40_figaroh", robot("tx40"), plain)
    assert set(sentences(result)) == {"gear_coupling"}
    assert "joint_6" in sentences(result)["gear_coupling"]
    assert "gear_coupling" in kinds(result)


def test_6_motor_angles(robot, shared_data: Path) -> None:
    """Real data: what only the manufacturer knows is asked for, as a block to fill in."""
    result = inspect_log(shared_data / "data" / "tx40_figaroh", robot("tx40"), bare=True)
    assert set(sentences(result)) == {"missing_clock", "position_range", "current_unit"}
    assert "# [gear]" in recipe_text(result)


def test_7_rest(lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: two seconds before the motion are told and dropped."""
    count = 200
    t = np.concatenate([clean.t[0] + 0.01 * np.arange(-count, 0), clean.t])
    still = {key: np.repeat(getattr(clean, key)[:1], count, axis=0) for key in ("q", "tau")}
    noise = np.random.default_rng(0).normal(0, 1e-3, (count, 7))
    arrays = {
        key: np.concatenate([still[key] + noise * 1e-3, getattr(clean, key)]) for key in still
    }
    log = saved(clean, t=t, dq=np.concatenate([noise, clean.dq]), **arrays)
    result = inspect_log(log, lib, propose=True)
    assert set(sentences(result)) == {"rest"}
    assert "rest" in kinds(result)
    assert result.rest[0] == pytest.approx((-2.0, 0.0), abs=0.2)
    assert result.plan.preparation.rest_speed == 0.02
    require_no_warning(result, log, lib, tmp_path)


def test_7_a_slow_log_keeps_its_rows(lib: Library, clean: Recording, saved) -> None:
    """Property: where hardly any row is faster than rest, the proposed recipe drops none."""
    q = clean.q[0] + 0.002 * (clean.q - clean.q[0])
    result = inspect_log(saved(clean, q=q, dq=0.002 * clean.dq), lib, propose=True)
    assert "record a faster motion" in sentences(result)["rest"]
    assert result.plan.preparation.rest_speed is None


def test_10_degrees(lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: determined by the limits, with dq in rad/s beside it or without dq."""
    log = saved(clean, q=clean.q * 180 / np.pi)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"position_unit"}
    assert "position_unit" in kinds(result)
    require_no_warning(result, log, lib, tmp_path)
    assert set(sentences(inspect_log(saved(clean, q=clean.q * 180 / np.pi, dq=None), lib))) == {
        "position_unit"
    }


def test_10_wrap(lib: Library, clean: Recording, saved) -> None:
    """Property: jumps of one turn are unwrapped by the reader and told."""
    q = clean.q.copy()
    middle = np.median(q[:, 0])
    q[:, 0] = (q[:, 0] - middle) % (2 * np.pi) + middle
    result = inspect_log(saved(clean, q=q), lib)
    assert "wrap" in kinds(result)


@pytest.mark.parametrize("gain", [1e3, np.array([10.0, 9, 11, 10, 40, 45, 38])])
def test_11_effort_is_no_torque(lib, clean, saved, tmp_path, gain) -> None:
    """Property: one factor of 1000 is a unit; one for each joint are gains, to 30 % by the URDF."""
    log = saved(clean, tau=clean.tau * gain)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"torque_unit"}
    assert "torque_unit" in kinds(result)
    assert "saturation" not in kinds(result)  # peaks in another unit than the limits
    if np.ndim(gain):
        assert "not a calibration" in sentences(result)["torque_unit"]
        # The example's links are up to 10 % off the URDF's, those of the wrist more by leverage.
        np.testing.assert_allclose(result.plan.torque.gain[1:4], 1 / gain[1:4], rtol=0.3)
    else:
        assert result.plan.torque.unit == "mN*m"
    require_no_warning(result, log, lib, tmp_path)


def test_saturation(lib: Library, clean: Recording, saved) -> None:
    """Property: flat tops of a clipped torque are counted, the joint named."""
    tau = clean.tau.copy()
    tau[:, 1] = np.clip(tau[:, 1], -25.0, 25.0)
    clipped = int(np.sum(np.abs(tau[:, 1]) == 25.0))
    assert clipped > 20
    result = inspect_log(saved(clean, tau=tau), lib)
    assert "fr3_joint2" in sentences(result)["saturation"]


@pytest.mark.parametrize(("moving", "words"), [(0, "no joint moves"), (2, "(5 of 7 joints)")])
def test_7_joints_that_never_move_come_first(
    lib: Library, clean: Recording, saved, moving: int, words: str
) -> None:
    """Property: before what follows from it; no advice to drop all rows."""
    rest = np.arange(7) >= moving
    q, dq = np.where(rest, clean.q[0], clean.q), np.where(rest, 0.0, clean.dq)
    result = inspect_log(saved(clean, q=q, dq=dq), lib)
    first = next(f for f in result.findings if f.level == "warning")
    assert first.kind == "still_joints"
    assert words in first.sentence
    assert all("rest_speed" not in f.sentence for f in result.findings if not moving)


def test_8_rounding_is_reported_by_symgen(shared_data: Path) -> None:
    """Published model: four-digit angles; `symgen inspect` says so and finds the 43 that remain."""
    from symgen.inspect.inspection import inspect_file

    result = inspect_file(shared_data / "models" / "kinova_gen3" / "kinova.urdf")
    assert any("angles are rounded" in note for note in result.notes)
    assert result.base is not None
    assert len(result.base.names) == 43
    assert result.base.condition < 1e4  # with the rounding taken at its word it is 1e7


@pytest.mark.parametrize("value", [0.0, 1.3])
def test_a_constant_torque_is_the_only_accused(lib, clean, saved, value) -> None:
    """Property: the torque of a wrist joint that was not logged, without causes beside it."""
    tau = clean.tau.copy()
    tau[:, 6] = value
    result = inspect_log(saved(clean, tau=tau), lib)
    assert set(sentences(result)) == {"constant_torque"}
    assert "fr3_joint7" in sentences(result)["constant_torque"]


def test_torques_without_sign_are_named(lib, clean, saved) -> None:
    """Property: of every joint; the sign of three joints of a log with signs may be one."""
    result = inspect_log(saved(clean, tau=np.abs(clean.tau)), lib)
    assert set(sentences(result)) == {"unsigned_torque"}
    assert unsigned_torque(clean) == []
    signs = np.where(np.arange(7) < 3, np.sign(clean.tau), 1.0)
    assert unsigned_torque(clean.replace(tau=clean.tau * signs)) == []


def test_a_position_beyond_its_limits_may_be_negated(lib, clean, saved, tmp_path) -> None:
    """Property: joint 4 of an FR3 is never positive; the recipe turns it back."""
    sign = np.where(np.arange(7) == 3, -1.0, 1.0)
    log = saved(clean, q=clean.q * sign, dq=clean.dq * sign)
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"position_sign"}
    np.testing.assert_allclose(result.recording.q, clean.q)
    require_no_warning(result, log, lib, tmp_path)


def test_positions_exchanged_beyond_their_limits(lib, clean, saved, tmp_path) -> None:
    """Property: the torques are in order, so that not all signals are exchanged."""
    order = [0, 1, 2, 3, 4, 6, 5]
    log = saved(clean, q=clean.q[:, order], dq=clean.dq[:, order])
    result = inspect_log(log, lib)
    assert set(sentences(result)) == {"position_order"}
    np.testing.assert_array_equal(result.recording.q, clean.q)
    require_no_warning(result, log, lib, tmp_path)
