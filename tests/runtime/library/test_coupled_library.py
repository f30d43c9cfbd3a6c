"""A library with coupled joints, springs and torque curves: sizes, maps, logs, friction, fit."""

from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError, RuntimeFault, SimulationError
from runtime.excitation import Trajectory
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction.coupled_motors import Coupling, spread
from runtime.recording.friction.model import torque
from runtime.recording.preprocessing import prepare
from runtime.simulation import Plant, closed_loop, ideal, record, settings_of
from symgen.chain.mechanism import mechanism_from_table
from symgen.make.request import request_from_folder
from tests.runtime.conftest import Command
from tests.runtime.library.conftest import WRIST
from tests.virtual_settings import frictionless

A, B = np.array([[1, 0], [0, 1], [0.5, -1.25], [1, -2.5]]), np.array([0, 0, 0.2, 0.3])


@pytest.fixture(scope="module")
def lib(wrist: Library) -> Library:
    return wrist


def motion(count: int = 400, seed: int = 0) -> tuple[np.ndarray, ...]:
    """A smooth motion of both joints within ±0.8 rad, 100 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(count) / 100
    w = 2 * np.pi * np.array([0.4, 0.7, 1.1])
    a, phase = rng.uniform(0.1, 0.25, (3, 2)), rng.uniform(0, 6, (3, 2))
    waves = w[:, None] * t + 0 * phase[:, :1]
    q = sum(a[k] * np.sin(waves[k][:, None] + phase[k]) for k in range(3))
    dq = sum(a[k] * w[k] * np.cos(waves[k][:, None] + phase[k]) for k in range(3))
    ddq = sum(-a[k] * w[k] ** 2 * np.sin(waves[k][:, None] + phase[k]) for k in range(3))
    return t, q, dq, ddq


def test_names_and_sizes(lib: Library) -> None:
    """Oracle: A and b by hand; π has ten numbers per link, q one per independent joint."""
    assert lib.joint_names == ("trunk_turn", "left_lift")
    assert lib.all_joint_names == ("trunk_turn", "left_lift", "left_roll", "right_lift")
    assert (lib.n_joints, lib.n_links, lib.pi0.size) == (2, 4, 40)
    q = np.array([[0.1, 0.2], [-0.4, 0.5]])
    np.testing.assert_allclose(lib.all_positions(q), q @ A.T + B, atol=1e-15)
    np.testing.assert_allclose(lib.all_positions(q[0]), A @ q[0] + B, atol=1e-15)
    np.testing.assert_allclose(lib.all_velocities(q), q @ A.T, atol=1e-15)
    assert lib.link_poses(q).shape == (2, 4, 4, 4)
    with pytest.raises(RuntimeFault, match="left_lift, got \\(4,\\)"):
        lib.all_positions(np.zeros(4))


def test_the_folder_regenerates_itself(lib: Library) -> None:
    """Property: the manifest holds the mechanism, from which the same request follows."""
    again = request_from_folder(lib.folder)
    assert again.options.mechanism == mechanism_from_table(WRIST, "M")


def test_kernels_agree(lib: Library) -> None:
    """Property: τ = Y π = Y_b K π = τ(λ), forward dynamics inverts it, and M is ∂τ/∂ddq."""
    _, q, dq, ddq = motion(20)
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    np.testing.assert_allclose(lib.regressor(q, dq, ddq) @ lib.pi0, tau, atol=1e-11)
    beta = lib.base_matrix @ lib.pi0
    np.testing.assert_allclose(lib.base_regressor(q, dq, ddq) @ beta, tau, atol=1e-11)
    np.testing.assert_allclose(lib.torque(q, dq, ddq, lib.lam0), tau, atol=1e-11)
    np.testing.assert_allclose(lib.forward_dynamics(q, dq, tau, lib.pi0), ddq, atol=1e-9)
    mass = lib.mass_matrix(q, lib.pi0)
    np.testing.assert_array_equal(mass, np.swapaxes(mass, 1, 2))
    change = lib.inverse_dynamics(q, dq, ddq + np.array([0.0, 1.0]), lib.pi0) - tau
    np.testing.assert_allclose(mass[:, :, 1], change, atol=1e-11)


def test_kernels_of_controllers(lib: Library) -> None:
    """Property: 2 C = ∂τ/∂dq, Y π of Slotine and Li, J dq is the motion of a link, the bound of M.

    All of them in the two independent joints, through A.
    """
    _, q, dq, ddq = motion(20)
    tau, _, by_dq, mass = lib.torque_derivatives(q, dq, ddq, lib.pi0)
    coriolis = lib.coriolis_matrix(q, dq, lib.pi0)
    np.testing.assert_allclose(2 * coriolis, by_dq, atol=1e-11)
    same = lib.slotine_li_regressor(q, dq, dq, ddq) @ lib.pi0
    np.testing.assert_allclose(same, tau, atol=1e-11)
    step = 1e-5  # central difference: h² of the third derivative, 1e-16 / h of rounding
    ahead, behind = (lib.link_poses(q + s * dq)[:, 3, :3, 3] for s in (step, -step))
    moved = np.einsum("kij,kj->ki", lib.frame_jacobian(q, lib.link_names[3])[:, :3], dq)
    np.testing.assert_allclose((ahead - behind) / (2 * step), moved, atol=1e-8)
    assert 0 < lib.least_inertia(lib.pi0, 0.01) <= np.linalg.eigvalsh(mass)[:, 0].min() + 0.01


def test_jacobian_in_lam_is_the_derivative(lib: Library) -> None:
    """Derivative: the Taylor remainder of τ(λ) falls with h²."""
    _, q, dq, ddq = motion(5)
    rng = np.random.default_rng(1)
    step = rng.normal(size=lib.lam0.size) * 0.1
    slope = lib.torque_jacobian(q, dq, ddq, lib.lam0) @ step
    rest = [
        np.abs(
            lib.torque(q, dq, ddq, lib.lam0 + h * step)
            - lib.torque(q, dq, ddq, lib.lam0)
            - h * slope
        ).max()
        for h in (1e-2, 1e-3)
    ]
    assert rest[1] < rest[0] / 80


def test_springs_and_curves_are_gradients_of_their_energy(lib: Library) -> None:
    """Derivative: S k and p are central differences of k (x − rest)²/2 and ∫p dx."""
    q = np.array([0.3, -0.5])

    def energies(q: np.ndarray) -> np.ndarray:
        x = A @ q + B
        arm = lib.link_poses(q)[1]
        strut = arm[:3, :3] @ [0.2, 0.0, 0.05] + arm[:3, 3] - [0.5, 0.0, 0.8]
        curve = 0.5 * x[0] - x[0] ** 2 / 2 + 0.25 * x[0] ** 3 / 3
        ramp = 0.75 * x[3] ** 2 if x[3] > 0 else -0.5 * x[3] ** 2
        return np.array(
            [
                (x[1] - 0.3) ** 2 / 2,
                (np.linalg.norm(strut) - 0.1) ** 2 / 2,
                x[2] ** 2 + curve + ramp,
            ]
        )

    h = 1e-5
    slopes = np.array([(energies(q + h * e) - energies(q - h * e)) / (2 * h) for e in np.eye(2)])
    assert lib.manifest.springs == ("back", "strut")
    np.testing.assert_allclose(lib.spring_columns(q), slopes[:, :2], atol=1e-9)
    np.testing.assert_allclose(lib.known_torque(q), slopes[:, 2], atol=1e-9)


def test_a_log_of_all_joints_is_reduced(lib: Library) -> None:
    """Property: positions of the independent joints, torques of the others through Aᵀ."""
    t, q, dq, ddq = motion(50)
    tau_all = np.random.default_rng(0).normal(size=(50, 4))
    order = [3, 1, 0, 2]
    names = tuple(lib.all_joint_names[k] for k in order)
    full = [values[:, order] for values in (q @ A.T + B, dq @ A.T, ddq @ A.T, tau_all)]
    for log in (
        Recording(t, *full, joint_names=names),
        Recording(t, q @ A.T + B, dq @ A.T, ddq @ A.T, tau_all),
    ):
        few = independent_joints(log, lib)
        np.testing.assert_allclose(few.q, q, atol=1e-14)
        np.testing.assert_allclose(few.required("ddq"), ddq, atol=1e-13)
        np.testing.assert_allclose(few.required("tau"), tau_all @ A, atol=1e-13)
    assert independent_joints(few, lib) is few
    wrong = Recording(t, q @ A.T - 2 * B, dq @ A.T, ddq @ A.T, tau_all)
    with pytest.raises(IdentificationError, match=r"'left_roll' of .* deviates from its coupling"):
        independent_joints(wrong, lib)


def test_springs_have_one_coefficient_for_all_joints() -> None:
    """Property: torque, F φ and the slope of a spring's column: one map and its adjoint."""
    rng = np.random.default_rng(0)
    columns, phi = rng.normal(size=(7, 3, 3)), rng.normal(size=(3, 3))
    coupling = Coupling(rng.normal(size=(3, 3)), (False, True, False), (False, False, True))
    tau = torque(columns, phi, coupling)
    rows = spread(columns, coupling)
    np.testing.assert_allclose(rows @ phi.ravel(), tau, atol=1e-14)
    weighted = rng.normal(size=(7, 3))
    adjoint = np.einsum("ijk,ij->k", rows, weighted).reshape(3, 3)
    np.testing.assert_allclose(coupling.slope(columns, weighted), adjoint, atol=1e-14)
    np.testing.assert_allclose(
        tau - torque(columns, phi * [1, 1, 0], coupling), columns[..., 2] * phi[0, 2]
    )


def test_identification_finds_springs_and_friction_of_dependent_joints(lib: Library) -> None:
    """Recovery: τ of a known robot with springs and friction on joints and on the dependent ones,
    without noise; what is not filtered is found to the tolerance of the friction's smooth sign.
    """
    t, q, dq, ddq = motion(600)
    directions = np.array(list(lib.manifest.friction_coordinates.values()))
    np.testing.assert_allclose(directions, [[-0.4, 1.0]], atol=1e-15)  # both dependents alike
    viscous, coulomb, own = np.array([3.0, 2.0]), np.array([1.0, 0.5]), 1.5
    speed = dq @ directions[0]
    tau = (
        lib.inverse_dynamics(q, dq, ddq, lib.pi0)
        + lib.known_torque(q)
        + lib.spring_columns(q) @ [7.0, 40.0]
        + dq * viscous
        + np.tanh(dq / 0.02) * coulomb
        + np.outer(own * np.tanh(speed / 0.02), directions[0])
    )
    names = ("viscous", "coulomb", "motor_coulomb", "spring:back", "spring:strut")
    terms = Friction(names, coulomb_speed=0.02)
    result = identify_recording(Recording(t, q, dq, ddq, tau), lib, method="ols", friction=terms)
    table = dict(zip(names, result.phi.T, strict=True))
    np.testing.assert_allclose(table["viscous"], viscous, rtol=1e-6)
    np.testing.assert_allclose(table["coulomb"], coulomb, rtol=1e-6)
    np.testing.assert_allclose(table["motor_coulomb"], [own, 0.0], atol=1e-6)
    np.testing.assert_allclose(table["spring:back"], [7.0, 0.0], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(table["spring:strut"], [40.0, 0.0], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(result.predict(q, dq, ddq), tau, atol=1e-6)


def test_the_certified_method_works_on_links(lib: Library) -> None:
    """Recovery: map with the URDF as prior returns four consistent bodies and the torque."""
    t, q, dq, ddq = motion(600)
    clean = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + lib.known_torque(q)
    tau = clean + np.random.default_rng(2).normal(0, 0.05, clean.shape)
    result = identify_recording(Recording(t, q, dq, ddq, tau), lib, method="map")
    assert result.pi.shape == (40,)
    assert (lib.relative_eigenvalues(result.pi) > 0).all()
    assert np.abs(result.predict(q, dq, ddq) - clean).max() < 0.05  # σ of the noise


def test_an_unknown_spring_is_named(lib: Library) -> None:
    """Property: one sentence with the springs of this robot."""
    t, q, dq, ddq = motion(50)
    log = Recording(t, q, dq, ddq, 0 * q + 1)
    with pytest.raises(RuntimeFault, match=r"no spring 'x' .*spring:back, spring:strut"):
        prepare(log, None, Friction(("spring:x",)), lib=lib)


def test_simulated_logs_contain_springs_and_curves(lib: Library) -> None:
    """Oracle: τ − known torque = Y π with the true bodies, to rounding, along a trajectory and in
    the first step of every tick of the virtual robot; the compiled simulation refuses.
    """
    motion_ = Trajectory(np.zeros(2), np.array([[0.05, -0.02], [-0.04, 0.03]]), 0.3)
    exact = ideal(lib, motion_, Plant(lib.pi0))
    q, dq, ddq, _ = motion_.at(lib, exact.t)
    left = exact.tau - lib.known_torque(q)
    np.testing.assert_allclose(left, lib.inverse_dynamics(q, dq, ddq, lib.pi0), atol=1e-12)
    with pytest.raises(SimulationError, match=r"springs or torque curves act on 'wrist'.*mujoco"):
        closed_loop(lib, motion_, Plant(lib.pi0), np.random.default_rng(0))
    log = record(lib, motion_, frictionless(settings_of(lib)), seed=0, truth_seed=0)
    known = lib.known_torque(log.motion.q)
    rigid = lib.inverse_dynamics(log.motion.q, log.motion.dq, log.motion.ddq, log.truth.pi)
    np.testing.assert_allclose(log.motion.link, rigid + known, atol=1e-9 * np.abs(rigid).max())
    assert np.abs(known).max() > 0.1


def test_simulate_refuses_springs_before_it_designs(lib: Library, command: Command) -> None:
    """Property: one sentence, exit code 2, no file; no design of a motion before it."""
    ran = command("simulate", "--robot", lib.folder, "--out", "sim.csv")
    assert ran.code == 2
    assert "springs or torque curves act on 'wrist'" in ran.err.replace("\n", " ")
    assert not Path("sim.csv").exists()
