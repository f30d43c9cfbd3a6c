"""Walking robots without force sensors: commanded torques, unknown wrenches, an IMU."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.estimators.uncertainty import IDENTIFIED, PRIOR_DOMINATED
from runtime.identification.free_base.rows import (
    CLEARANCE,
    Drives,
    contact_jacobian,
    lifted_feet,
    rows_of,
)
from runtime.identification.identify import identify
from runtime.library import Library, to_pinocchio_order
from runtime.recording.free_base import free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from runtime.recording.preprocessing.segments import interpolate
from runtime.recording.settings import Friction
from tests.free_base_logs import Experiment, VirtualLog, virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command

Arrays = dict[str, np.ndarray]
HOPPER = (DATA / "hopper.urdf").read_text()
DELAY_S = 0.012
VISCOUS, COULOMB = np.array([0.3, 2.0, 0.2]), np.array([0.5, 1.0, 0.4])
ARMATURE = np.array([0.05, 0.3, 0.04])
TERMS = Friction(("viscous", "coulomb", "rotor"))
KP, KD = 80.0, 2.0


@pytest.fixture(scope="module")
def log() -> VirtualLog:
    return foot_log()


def foot_log() -> VirtualLog:
    """One foot on the ground."""
    return virtual_log(HOPPER, ("left_foot",), 3, Experiment(count=900, changed=0.2))


@pytest.fixture(scope="module")
def arrays(log: VirtualLog) -> Arrays:
    return walk_by_commands(log)


def walk_by_commands(log: VirtualLog) -> Arrays:
    """What a robot without force sensors logs: an IMU and the law of its commands."""
    a = log.arrays
    rng = np.random.default_rng(0)
    motor = a["tau"] + VISCOUS * a["dq"] + COULOMB * np.tanh(a["dq"] / 0.02) + ARMATURE * a["ddq"]
    command = interpolate(a["t"] + DELAY_S, a["t"], motor) + 0.005 * rng.normal(size=motor.shape)
    twist, change = a["base_twist"], a["base_acceleration"]
    place, w = np.array([0.03, -0.02, 0.05]), twist[:, 3:]
    gravity = np.einsum("nji,j->ni", free_base_of(a, "log").rotation, [0.0, 0.0, -9.81])
    felt = change[:, :3] + np.cross(w, twist[:, :3]) - gravity
    felt += np.cross(change[:, 3:], place) + np.cross(w, np.cross(w, place))
    return {key: a[key] for key in ("t", "q", "dq", "joints", "base_pose", "contact_links")} | {
        "q_des": a["q"] + (command + KD * a["dq"]) / KP,
        "kp": np.array(KP),
        "kd": np.full(3, KD),
        "imu_gyro": w,
        "imu_acceleration": felt,
        "imu_position": place,
        "contact_flags": np.ones((len(a["t"]), 1)),
    }


def true_pi(log: VirtualLog) -> np.ndarray:
    order = np.argsort(to_pinocchio_order(np.arange(10.0)))
    return log.pi.reshape(-1, 10)[:, order].ravel()


def test_projected_rows_are_those_with_explicit_wrenches(hopper: Library, arrays: Arrays) -> None:
    """Oracle: for any model, the projected rows leave what the best explicit wrenches leave."""
    rng = np.random.default_rng(1)
    motion = motion_of(free_base_of(arrays, "log"), hopper.joint_names, 15.0, terms=TERMS)
    motion = motion.rows(np.arange(20, 800, 40))
    mixed = rng.normal(size=(9, 9))
    covariance = mixed @ mixed.T + 0.1 * np.eye(9)
    drives = Drives(TERMS, covariance, 0.0, is_delay_unknown=True)
    rows = rows_of(hopper, motion, "all", drives)
    assert rows.samples.equations == 3
    pi = hopper.pi0 * rng.uniform(0.8, 1.2, hopper.pi0.size)
    phi = rng.normal(size=rows.samples.shape)
    assert motion.friction is not None
    assert motion.tau is not None
    assert motion.tau_rate is not None
    torque = np.einsum("njk,jk->nj", motion.friction, phi[0, :-1].reshape(3, 3))
    torque += motion.tau_rate * phi[0, -1] - motion.tau
    needed = hopper.inverse_dynamics(motion.q, motion.dq, motion.ddq, pi)
    needed[:, 6:] += torque
    weight = np.linalg.inv(np.linalg.cholesky(covariance))
    projected = rows.samples.rigid(hopper, pi) + rows.samples.friction(phi) - rows.samples.tau
    for need, jacobian, short in zip(needed, contact_jacobian(hopper, motion), projected,
                                     strict=True):  # fmt: skip
        wrench, *_ = np.linalg.lstsq(weight @ jacobian.T, weight @ need, rcond=None)
        rest = weight @ (need - jacobian.T @ wrench)
        # Products of numbers up to 1e3 with weights up to 1e1 in double precision.
        assert np.linalg.norm(short) == pytest.approx(np.linalg.norm(rest), rel=1e-8)


def test_bodies_friction_and_delay_without_forces(
    hopper: Library, log: VirtualLog, arrays: Arrays
) -> None:
    """Oracle: bodies, friction, armature and delay of the virtual robot, within their intervals."""
    result = identify(free_base_of(arrays, "log"), hopper, rows="all", cutoff=15.0)
    true = true_pi(log)
    # The wrench at the foot takes up all that moves the foot, which therefore has no equation.
    link = hopper.link_names.index("left_foot")
    pick = np.where(np.arange(true.size) % 10 == 0, 1.0, 0.0)
    pick[10 * link] = 0.0
    sigma = np.linalg.norm(pick @ result.posterior.pi_root)
    assert result.record.uncertainty.links[link].verdicts[0] == PRIOR_DOMINATED
    assert pick @ result.pi == pytest.approx(pick @ true, rel=0.02)
    assert abs(pick @ (result.pi - true)) < 4 * sigma
    assert abs(pick @ (hopper.pi0 - true)) > 10 * sigma
    late, spread = result.record.delay_s.value, result.record.delay_s.sigma
    assert late == pytest.approx(DELAY_S, abs=4 * spread + 1e-4)
    for name, values in (("viscous", VISCOUS), ("coulomb", COULOMB), ("rotor", ARMATURE)):
        friction = result.record.friction
        at = friction.columns.index(name)
        rows = zip(friction.values, friction.sigma, friction.interval_95, values, strict=True)
        for estimate, spread, ends, value in ((x[at], s[at], i[at], v) for x, s, i, v in rows):
            assert abs(estimate - value) < 4 * spread + 0.02 * value
            assert np.diff(ends) / 2 == pytest.approx(1.96 * spread, rel=1e-4)
    # As for an arm: identified is what has less than a tenth of its prior variance.
    known = result.record.uncertainty
    identified = [word == IDENTIFIED for each in known.links for word in each.verdicts]
    assert identified == [share < 0.1 for share in known.posterior_over_prior]
    # Ten base parameters of the foot have no equation, and four more hardly move here.
    assert len(known.beta_verdicts) == len(hopper.base_matrix)
    assert 10 < known.beta_verdicts.count(IDENTIFIED) <= len(hopper.base_matrix) - 10
    rms = result.record.torque_rms
    assert (np.array(rms.after) < 0.5 * np.array(rms.before)).all()
    assert len(rms.after) == 9


def test_equations_per_instant_change_with_the_contacts(
    hopper: Library, log: VirtualLog, arrays: Arrays
) -> None:
    """Oracle: total mass; a foot whose wrench is measured for a while leaves nine equations, not
    three, as a foot that is lifted does.
    """
    wrench = log.arrays["contact_wrench"].copy()
    wrench[300:600] = np.nan
    result = identify(free_base_of(arrays | {"contact_wrench": wrench}, "log"), hopper, cutoff=15.0)
    assert any("3 to 9 of 9 equations" in note for note in result.record.warnings)
    mass, total = result.record.total_mass, true_pi(log)[::10].sum()
    assert abs(mass.value - total) < 4 * mass.sigma < 0.1 * total


@pytest.mark.parametrize(("cutoff", "ends"), [(None, 0.1), (5.0, 0.2)])
def test_ends_without_a_whole_delay_or_period_are_left_out(
    hopper: Library, arrays: Arrays, cutoff: float | None, ends: float
) -> None:
    """Oracle: the largest delay, 0.1 s, or a period of the low-pass at 5 Hz."""
    log = free_base_of(arrays, "log")
    result = identify(log, hopper, rows="all", cutoff=cutoff, delay=DELAY_S)
    # Rows of a low-pass are five a period.
    assert 0 <= arrays["t"][-1] - ends - result.predictions["t"][-1] < 0.05


def test_the_imu_gives_the_equations_of_the_whole_motion(
    hopper: Library, log: VirtualLog, arrays: Arrays
) -> None:
    """Oracle: forces by what an IMU reads are those by pose, twist and acceleration."""
    read = motion_of(free_base_of(arrays, "log"), hopper.joint_names)
    known = motion_of(free_base_of(log.arrays, "log"), hopper.joint_names)
    forces = [hopper.inverse_dynamics(m.q, m.dq, m.ddq, hopper.pi0)[10:-10, :6]
              for m in (read, known)]  # fmt: skip
    # ω̇ is a difference of 10 ms of sines up to 9 rad/s: 0.1 % of accelerations.
    assert np.abs(forces[0] - forces[1]).max() < 0.01 * np.abs(forces[1]).max()


def test_feet_that_may_touch_count_as_touching(hopper: Library) -> None:
    """Property: contacts are lifted by height above the lowest one alone, in any attitude."""
    t, turn = np.arange(20) * 0.01, np.linspace(-1.2, 1.2, 20)
    arrays = {
        "t": t,
        "q": np.tile([0.3, 0.0, 0.1], (20, 1)),
        "base_position": np.zeros((20, 3)),
        "base_rpy": np.stack([turn, 0 * turn, 0 * turn], axis=1),
        "contact_links": np.array(["left_foot", "right_thigh"]),
        "contact_position": np.array([[0.0, 0.0, -0.1], [0.2, 0.0, 0.0]]),
    }
    log = free_base_of(arrays, "log")
    lifted = lifted_feet(log, hopper)
    motion = np.hstack([np.zeros((20, 3)), np.outer(turn, [1.0, 0.0, 0.0]), arrays["q"]])
    poses = hopper.link_poses(motion)
    places = zip(log.contacts.links, log.contacts.position, strict=True)
    z = np.stack([(poses[:, hopper.link_names.index(link)] @ np.append(p, 1.0))[:, 2]
                  for link, p in places], axis=1)  # fmt: skip
    assert (lifted == (z - z.min(axis=1, keepdims=True) > CLEARANCE)).all()
    assert lifted.any(axis=0).all()
    assert not lifted.all(axis=1).any()


def test_flags_are_not_inferred_where_they_are_stated(hopper: Library, arrays: Arrays) -> None:
    """Property: contact_flags decide; without them the result says what it assumed."""
    unstated = {key: value for key, value in arrays.items() if key != "contact_flags"}
    stated, free = (
        identify(free_base_of(each, "log"), hopper, rows="all", cutoff=15.0, delay=0.012)
        for each in (arrays, unstated)
    )
    assert not any("height of the feet" in note for note in stated.record.warnings)
    assert any("height of the feet" in note for note in free.record.warnings)
    # One foot is always the lowest one.
    assert free.pi == pytest.approx(stated.pi, rel=1e-9)
    assert (free.record.delay_s.value, free.record.delay_s.sigma) == (0.012, 0.0)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"tau": "q"}, "has tau and q_des; keep tau"),
        ({"dq": None}, "the control law of q_des needs dq"),
        ({"kp": None}, "no array kp"),
        ({"imu_gyro": None}, "no array imu_gyro"),
        ({"base_twist": "base_twist"}, "readings of an IMU beside"),
    ],
)
def test_layouts_that_are_refused(
    arrays: Arrays, change: dict[str, str | None], sentence: str
) -> None:
    """Property: what a log of commands lacks or states twice is named."""
    log = {key: value for key, value in arrays.items() if change.get(key, "") is not None}
    more = arrays | {"base_twist": np.zeros((900, 6))}
    log |= {key: more[value] for key, value in change.items() if value}
    with pytest.raises(RuntimeFault, match=sentence):
        free_base_of(log, "log")


def test_commands_of_the_opposite_sign_are_refused(hopper: Library, arrays: Arrays) -> None:
    """Property: torques on the world instead of on the joints are named."""
    opposite = arrays | {"q_des": 2 * arrays["q"] - arrays["q_des"], "kd": -arrays["kd"]}
    with pytest.raises(RuntimeFault, match="opposite to those that move the URDF"):
        identify(free_base_of(opposite, "log"), hopper, rows="all", cutoff=15.0)


def test_nothing_determines_the_scale_without_forces_and_torques(
    hopper: Library, arrays: Arrays
) -> None:
    """Property: rows of the base alone, with every force unknown, are not a result."""
    alone = {key: value for key, value in arrays.items() if key not in {"q_des", "kp", "kd"}}
    alone |= {"contact_kind": np.array("point")}
    with pytest.raises(RuntimeFault, match="nothing determines the scale of the masses"):
        identify(free_base_of(alone, "log"), hopper, rows="base", cutoff=15.0)


def test_command_states_drives(
    hopper: Library, arrays: Arrays, tmp_path: Path, command: Command
) -> None:
    """Property: the command prints the drives of such a log, and takes --friction and --delay."""
    path, out = tmp_path / "walk.npz", tmp_path / "out"
    np.savez(path, **arrays)  # type: ignore[arg-type]
    words = ("identify", path, "--robot", hopper.folder, "--cutoff", "15", "--out", out)
    done = command(*words, "--friction", "viscous,rotor", "--delay", "0.012", "--verbose")
    assert done.code == 0, done.err
    assert ": not identifiable " in done.out
    assert "drives: viscous of left_hip " in done.out
    assert "coulomb" not in done.out
    facts = json.loads((out / "result.json").read_text())
    assert facts["delay_s"] == {"value": 0.012, "sigma": 0.0}
    assert facts["friction"]["columns"] == ["viscous", "rotor"]
    assert np.shape(facts["friction"]["values"]) == np.shape(facts["friction"]["sigma"]) == (3, 2)
    done = command("evaluate", out, path, "--robot", hopper.folder, "--json")
    assert done.code == 0, done.err
    rms = json.loads(done.out)["rms"]
    assert (np.array(rms["after"]) < 0.5 * np.array(rms["before"])).all()
    done = command(*words, "--delay", "fast", "--overwrite")
    assert done.code == 2
    assert "--delay needs auto or a number of -0.03 to 0.1 s" in done.err
    done = command(*words, "--friction", "no", "--overwrite")
    assert done.code == 2
    assert "'no'; choose from " in done.err


def test_offsets_of_force_sensors_have_sigma(hopper: Library, log: VirtualLog) -> None:
    """Property: σ of an offset is at most its prior's, and contains the true offset."""
    axes = free_base_of(log.arrays, "log").rotation
    pose = hopper.link_poses(motion_of(free_base_of(log.arrays, "log"), hopper.joint_names).q)
    foot = pose[:, hopper.link_names.index("left_foot"), :3, :3]
    wrench = log.arrays["contact_wrench"][: len(foot), 0].reshape(-1, 2, 3)
    vertical = np.einsum("nij,nhj->nhi", foot, wrench)[:, 0, 2:]
    kept = ("t", "q", "dq", "ddq", "base_pose", "base_twist", "base_acceleration", "contact_links")
    noise = np.random.default_rng(2).normal(size=vertical.shape)
    arrays = {key: log.arrays[key][: len(axes)] for key in kept} | {
        "contact_force_z": vertical + 3.0 + noise,
        "contact_force_z_sigma": np.array([4.0]),
    }
    result = identify(free_base_of(arrays, "log"), hopper, rows="base", cutoff=20.0)
    assert result.record.sensors.keys() == {"left_foot"}
    offset, sigma = (getattr(result.record.sensors["left_foot"], k) for k in ("value", "sigma"))
    # It exchanges with the mass, whose prior is of 2 kg, and accelerations tell them apart.
    assert 0 < sigma <= 4.001
    assert abs(offset - 3.0) < 3 * sigma
