"""A library with a closed loop: names, maps, singular postures, logs, identification, wrenches."""

from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError, PostureError, RecordingError, ShapeError
from runtime.excitation import Trajectory
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Recording
from runtime.recording.coupled_joints import independent_joints
from runtime.simulation import Controller, Plant, record, settings_of
from runtime.simulation.closed_loop import follow
from runtime.simulation.plant_engine import plant_engine
from symgen.chain.mechanism import mechanism_from_table
from symgen.make.request import request_from_folder
from tests.linkages import Projection
from tests.runtime.library.conftest import PALLETIZER
from tests.virtual_settings import frictionless

ALL = ("waist", "arm", "forearm", "crank", "rod")


@pytest.fixture(scope="module")
def lib(palletizer: Library) -> Library:
    return palletizer


def motion(count: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    """A smooth motion of the three independent joints within ±0.7 rad, 100 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(count) / 100
    q, dq, ddq = (np.zeros((count, 3)) for _ in range(3))
    for frequency in (0.3, 0.55, 0.9, 1.3):
        w = 2 * np.pi * frequency
        a, phase = rng.uniform(0.05, 0.17, 3), rng.uniform(0, 6, 3)
        wave = w * t[:, None] + phase
        q += a * np.sin(wave)
        dq += a * w * np.cos(wave)
        ddq -= a * w * w * np.sin(wave)
    return t, q, dq, ddq


def test_names_and_positions(lib: Library) -> None:
    """Oracle: the rod stays parallel to the arm, so that forearm = crank − arm, rod = arm − crank;
    NumPy's Newton gives the same.
    """
    assert lib.joint_names == PALLETIZER.independent
    assert set(lib.all_joint_names) == set(ALL)
    assert (lib.n_joints, lib.n_links, lib.pi0.size) == (3, 5, 50)
    _, q, dq, ddq = motion(50)
    everything = dict(zip(lib.all_joint_names, lib.all_positions(q).T, strict=True))
    np.testing.assert_allclose(everything["forearm"], q[:, 2] - q[:, 1], atol=1e-14)
    np.testing.assert_allclose(everything["rod"], q[:, 1] - q[:, 2], atol=1e-14)
    rates = dict(zip(lib.all_joint_names, lib.all_velocities(dq, q).T, strict=True))
    np.testing.assert_allclose(rates["forearm"], dq[:, 2] - dq[:, 1], atol=1e-13)
    accelerations = lib.all_motion(q, dq, ddq)[2]
    place = lib.all_joint_names.index("rod")
    np.testing.assert_allclose(accelerations[:, place], ddq[:, 1] - ddq[:, 2], atol=1e-11)
    last = lib.all_positions(q[:-1])
    np.testing.assert_allclose(
        lib.next_positions(q[1:], last), lib.all_positions(q[1:]), atol=1e-14
    )
    jacobian = lib.joint_jacobian(q)
    np.testing.assert_allclose(jacobian @ dq[..., None], lib.all_velocities(dq, q)[..., None])
    with pytest.raises(ShapeError, match=r"all_velocities\(dq, q\)"):
        lib.all_velocities(dq)


def test_compiled_kernels_are_those_of_the_projection(lib: Library) -> None:
    """Oracle: τ and ddq of the compiled batch equal KKT equations of Pinocchio's tree; the kernels
    agree with each other.
    """
    _, q, dq, ddq = motion(40, 1)
    oracle = Projection(PALLETIZER, lib.all_joint_names, lib.gravity)
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    largest = np.abs(tau).max()
    for k in range(0, 40, 10):
        x = oracle.pose(q[k])
        v, a = oracle.rates(x, dq[k], ddq[k])
        np.testing.assert_allclose(oracle.torque(x, v, a), tau[k], atol=1e-10 * largest)
    zero = np.zeros(3)
    np.testing.assert_allclose(lib.forward_dynamics(q, dq, tau, lib.pi0, zero), ddq, atol=1e-9)
    base = lib.base_regressor(q, dq, ddq) @ (lib.base_matrix @ lib.pi0)
    np.testing.assert_allclose(base, tau, atol=1e-10 * largest)
    np.testing.assert_allclose(lib.regressor(q, dq, ddq) @ lib.pi0, tau, atol=1e-10 * largest)
    one = lib.inverse_dynamics(q[3], dq[3], ddq[3], lib.pi0)
    np.testing.assert_allclose(one, tau[3], atol=1e-12 * largest)


def test_the_folder_regenerates_itself(lib: Library, palletizer_folder: Path) -> None:
    """Property: the manifest keeps the loop, its kind and its coordinates."""
    assert lib.manifest.loops == ("the loop of 'R' and 'F'",)
    request = request_from_folder(palletizer_folder)
    assert request.options.mechanism == mechanism_from_table(PALLETIZER.mechanism, "M")


def test_singular_postures_are_refused_by_name(lib: Library) -> None:
    """Property: where rod and arm are in line with the crank, positions and logs are refused; the
    limits of the library keep away from there.
    """
    limits = lib.limits()
    beyond = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, np.pi / 2 + 0.1]])
    with pytest.raises(PostureError, match=r"1 of 2 .* row 1: .* crank = 1.671.*'R' and 'F'"):
        lib.all_positions(beyond)
    t, q, dq, ddq = motion(200)
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    with pytest.raises(PostureError, match="singular posture of the loop of 'R' and 'F'"):
        independent_joints(Recording(t=t, q=q + np.array([0, 0, 1.6]), dq=dq, tau=tau), lib)
    turned = q[0] + np.array([0, 0, 2 * np.pi])
    with pytest.raises(PostureError, match=rf"half a turn .*, such as crank = {q[0, 2]:.4g}$"):
        lib.all_positions(turned)
    assert limits["upper"][2] - limits["lower"][1] < np.pi
    assert np.isinf(limits["upper"][0])
    rng = np.random.default_rng(0)
    inside = rng.uniform(limits["lower"][1:], limits["upper"][1:], (200, 2))
    assert lib.loop_margins(np.column_stack([np.zeros(200), inside])).min() > 0.1


def test_a_log_of_all_joints_is_reduced(lib: Library) -> None:
    """Property: a torque of a dependent joint acts by Gᵀ; positions off the loop are refused."""
    t, q, dq, ddq = motion(60)
    q_all, dq_all, _ = lib.all_motion(q, dq, ddq)
    tau = np.random.default_rng(0).normal(0, 1, q_all.shape)
    log = Recording(t=t, q=q_all, dq=dq_all, tau=tau)
    reduced = independent_joints(log, lib)
    expected = np.einsum("tk,tkn->tn", tau, lib.joint_jacobian(q))
    np.testing.assert_allclose(reduced.tau, expected, atol=1e-13)
    np.testing.assert_array_equal(reduced.q, q)
    turned, wrong = q_all.copy(), q_all.copy()
    turned[:, lib.all_joint_names.index("rod")] += 4 * np.pi  # where its encoder began
    np.testing.assert_array_equal(independent_joints(log.replace(q=turned), lib).tau, reduced.tau)
    wrong[:, lib.all_joint_names.index("rod")] += 1.0
    with pytest.raises(IdentificationError, match=r"joint 'rod' .* deviates from its coupling"):
        independent_joints(log.replace(q=wrong), lib)


def test_identification_recovers_the_torque(lib: Library) -> None:
    """Property: from a log of another robot of the same geometry, with noise of 0.05 N·m, identify
    predicts unseen torques to the noise, with consistent links.
    """
    rng = np.random.default_rng(4)
    pi = lib.pi0.reshape(-1, 10) * rng.uniform(0.7, 1.4, (5, 1))
    t, q, dq, ddq = motion(900, 2)
    truth = lib.inverse_dynamics(q, dq, ddq, pi.ravel())
    tau = truth + 0.05 * rng.normal(size=truth.shape)
    log = Recording(t=t, q=q, dq=dq, ddq=ddq, tau=tau)
    result = identify_recording(log, lib, method="map", friction=Friction(columns=()))
    _, *unseen = motion(200, 9)
    right = lib.inverse_dynamics(*unseen, pi.ravel())
    error = np.sqrt(np.mean((result.predict(*unseen) - right) ** 2))
    assert error < 0.05
    assert lib.relative_eigenvalues(result.pi).min() > 0


def test_jacobian_of_a_link_on_the_loop(lib: Library) -> None:
    """Derivative: the Jacobian is that of central differences of the pose; the least inertia is a
    bound of the eigenvalues of M.
    """
    q, h = np.array([0.2, 0.3, -0.1]), 1e-6
    k = lib.link_names.index("F")
    slopes = [
        (lib.link_poses(q + h * e)[k, :3, 3] - lib.link_poses(q - h * e)[k, :3, 3]) / (2 * h)
        for e in np.eye(3)
    ]
    np.testing.assert_allclose(lib.frame_jacobian(q, "F")[:3], np.array(slopes).T, atol=1e-8)
    rng = np.random.default_rng(1)
    least = lib.least_inertia(lib.pi0)
    masses = lib.mass_matrix(motion(50)[1] * rng.uniform(0, 1, (50, 1)), lib.pi0)
    assert 0 < least <= np.linalg.eigvalsh(masses).min()


def test_friction_of_dependent_joints_is_identified(lib: Library) -> None:
    """Recovery: torques Gᵀ c(G dq) of two joints of the loop beside independent joints."""
    t, q, dq, ddq = motion(600)
    g = lib.joint_jacobian(q)
    forearm, rod = (g[:, lib.all_joint_names.index(name)] for name in ("forearm", "rod"))
    viscous, dry = 0.8, 0.5
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    tau += viscous * forearm * np.einsum("nj,nj->n", forearm, dq)[:, None]
    tau += dry * rod * np.tanh(np.einsum("nj,nj->n", rod, dq) / 0.02)[:, None]
    names = ("viscous", "joint_viscous:forearm", "joint_coulomb:rod")
    terms = Friction(names, coulomb_speed=0.02)
    log = Recording(t, q, dq, ddq, tau)
    result = identify_recording(log, lib, method="ols", friction=terms)
    table = dict(zip(names, result.phi.T, strict=True))
    np.testing.assert_allclose(table["joint_coulomb:rod"], [dry, 0.0, 0.0], atol=1e-6)
    # G of the forearm is constant here (a parallelogram), so that its column is a combination of
    # dq; the sum of the torques is what the motion determines.
    np.testing.assert_allclose(result.predict(q, dq, ddq), tau, atol=1e-6 * np.abs(tau).max())
    for wrong in ("crank", "nobody"):
        unknown = Friction((f"joint_viscous:{wrong}",))
        sentence = f"no joint '{wrong}' that follows others .there are: "
        with pytest.raises(RecordingError, match=sentence):
            identify_recording(log, lib, method="ols", friction=unknown)


def test_simulated_motion_is_that_of_the_constrained_tree(lib: Library) -> None:
    """Oracle: RK4 with KKT accelerations of Pinocchio's tree, all joints free to move; a fall with
    viscous friction, by the compiled simulation (order 2) and by the step of the virtual robot
    (order 1, errors of two steps extrapolated).
    """
    start, rates, seconds = np.array([0.1, 0.3, -0.2]), np.array([0.4, -0.5, 0.8]), 0.05
    friction = np.full(3, 0.3)
    oracle = Projection(PALLETIZER, lib.all_joint_names, lib.gravity)

    def slope(state: np.ndarray) -> np.ndarray:
        x, own = np.split(state, 2)
        v, _ = oracle.rates(x, own[oracle.own], np.zeros(3))
        ddq = oracle.acceleration(x, v, -friction * v[oracle.own])
        return np.concatenate([v, oracle.rates(x, v[oracle.own], ddq)[1]])

    x = oracle.pose(start)
    state, h = np.concatenate([x, oracle.rates(x, rates, np.zeros(3))[0]]), seconds / 25
    for _ in range(25):
        k1 = slope(state)
        k2 = slope(state + h / 2 * k1)
        k3 = slope(state + h / 2 * k2)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(state + h * k3))
    fallen, speeds = (part[oracle.own] for part in np.split(state, 2))
    moved = np.abs(fallen - start).max()
    assert np.abs(speeds - rates).max() > 0.5  # gravity acts

    reference = np.zeros((round(1000 * seconds) + 1, 3, 3))
    reference[0, 0], reference[0, 1] = start, rates
    plant = Plant(lib.pi0, viscous=friction, rotor=0.0)
    idle = Controller(0 * lib.pi0, rotor=0.0, stiffness=0.0, damping=0.0)
    motion_ = follow(lib, reference, plant, idle, 1000.0)
    assert np.abs(motion_.q[-1] - fallen).max() < 1e-6 * moved  # (2e-4 s)² x 10 /s²
    assert np.abs(motion_.dq[-1] - speeds).max() < 1e-6 * np.abs(speeds).max()

    ends = []
    for step in (2.5e-4, 1.25e-4):
        made = plant_engine(lib, lib.pi0, 0.0, step)
        made.q[:], made.dq[:], made.damping[:] = start, rates, friction
        for _ in range(round(seconds / step)):
            made.advance()
        ends.append(np.array(made.q))
    errors = [np.abs(end - fallen).max() for end in ends]
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.05)
    assert np.abs(2 * ends[1] - ends[0] - fallen).max() < 0.01 * errors[1]


def test_a_virtual_robot_with_a_loop_follows_its_equations(lib: Library) -> None:
    """Oracle: torque behind the rotors = inverse dynamics of the true bodies, to rounding: the
    first step of a tick solves these equations; a motion out of the range of the loop is refused.
    """
    wave = 0.05 * np.array([[1.0, -0.5], [-0.5, 1.0], [1.0, 0.5]])
    settings = frictionless(settings_of(lib))
    log = record(lib, Trajectory(np.zeros(3), wave, 0.3), settings, seed=0)
    m = log.motion
    assert log.truth.engine == "symgen kernels"
    torque = lib.inverse_dynamics(m.q, m.dq, m.ddq, log.truth.pi)
    np.testing.assert_allclose(m.link, torque, atol=1e-9 * np.abs(torque).max())
    with pytest.raises(PostureError, match="singular posture of the loop"):
        record(lib, Trajectory(np.array([0.0, 0.0, 1.7]), wave, 0.3), settings, seed=0)
