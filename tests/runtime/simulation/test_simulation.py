"""runtime.simulation: the plant obeys its own physics, the bench measures what it says."""

import numpy as np
import pinocchio
import pytest
from scipy.integrate import solve_ivp

from runtime import Recording
from runtime.errors import IdentificationError, SimulationError
from runtime.excitation import Trajectory
from runtime.identification.metrics import torque_error
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation
from runtime.simulation import Controller, Plant, closed_loop, ideal, sample_times
from runtime.simulation.closed_loop import follow, perturbed_lam
from tests.oracle import pinocchio_model, with_parameters


def test_ideal_torque_is_pinocchios(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: Pinocchio's rnea of the changed robot, plus the friction law by hand."""
    plant = Plant(pi_true, viscous=0.5, coulomb=0.3, coulomb_speed=0.05)
    recording = ideal(lib, trajectories[0], plant, rate_hz=20.0)
    model = with_parameters(pinocchio_model(lib.urdf()), lib, pi_true)
    data = model.createData()
    rigid = np.array(
        [
            pinocchio.rnea(model, data, *state).copy()
            for state in zip(recording.q, recording.dq, recording.ddq, strict=True)
        ]
    )
    friction = 0.5 * recording.dq + 0.3 * np.tanh(recording.dq / 0.05)
    # Rounding of torques up to 90 N·m.
    assert recording.tau == pytest.approx(rigid + friction, abs=1e-12)
    assert (len(recording), recording.duration) == (201, 10.0)
    assert recording.joint_names == lib.joint_names


@pytest.fixture(scope="module")
def gentle(lib: Library) -> Trajectory:
    """A tenth of a second of the way out and back, brisk but short."""
    return Trajectory(lib.home, 0.02 * np.array([[1, -0.5]] * 7) * np.arange(1, 8)[:, None], 1.0)


def mismatch(recording: Recording, lib: Library, plant: Plant) -> np.ndarray:
    """τ − (Y π + friction) with ddq from forward differences: the torque holds over a step."""
    ddq = np.diff(recording.dq, axis=0) / np.diff(recording.t)[:, None]
    q, dq, tau = recording.q[:-1], recording.dq[:-1], recording.tau[:-1]
    friction = plant.viscous * dq + plant.coulomb * np.tanh(dq / plant.coulomb_speed)
    return tau - lib.inverse_dynamics(q, dq, ddq, plant.pi) - friction


def test_closed_loop_torque_is_that_of_the_true_plant(
    lib: Library, gentle: Trajectory, pi_true: np.ndarray
) -> None:
    """Oracle: inverse dynamics of the truth along the logged motion; the error falls as the step.

    The difference quotient of dq over one step h is off by h/2 · jerk, times inertias of 1 kg·m².
    """
    plant = Plant(pi_true, viscous=0.5, coulomb=0.3, coulomb_speed=0.1)
    sizes = []
    for rate in (1000.0, 2000.0, 4000.0):
        recording = closed_loop(lib, gentle, plant, np.random.default_rng(0), rate)
        sizes.append(np.abs(mismatch(recording, lib, plant)).max())
        assert recording.ddq is None
    # Torques reach 30 N·m; jerks of 100 rad/s³ make 0.05 N·m at h = 1 ms.
    assert sizes[0] < 0.05
    # First order: halved each time, within a fifth.
    assert np.array(sizes[:-1]) / sizes[1:] == pytest.approx([2, 2], rel=0.2)


def test_the_controller_follows_when_it_knows_the_robot(lib: Library, gentle: Trajectory) -> None:
    """Property: with the URDF's own parameters the loop stays on the trajectory, to first order."""
    recording = closed_loop(lib, gentle, Plant(lib.pi0), np.random.default_rng(0))
    wanted = gentle.at(lib, recording.t)[0]
    # The held torque lags by half a step of 1 ms: accelerations of 10 rad/s² over 225 /s².
    assert np.abs(recording.q - wanted).max() < 1e-3


def test_noise_is_as_large_as_it_says(lib: Library, gentle: Trajectory) -> None:
    """Property: the measured differences to the noise-free run have the standard deviations."""
    quiet = closed_loop(lib, gentle, Plant(lib.pi0), np.random.default_rng(0))
    plant = Plant(lib.pi0, position_noise=1e-4, velocity_noise=1e-2, torque_noise=0.2)
    loud = closed_loop(lib, gentle, plant, np.random.default_rng(0))
    for key, sigma in (("q", 1e-4), ("dq", 1e-2), ("tau", 0.2)):
        noise = getattr(loud, key) - getattr(quiet, key)
        # The deviation of an estimated deviation is σ/√(2·7007) = 0.85 %; four of them.
        assert noise.std() == pytest.approx(sigma, rel=0.035)
        assert abs(noise.mean()) < 4 * sigma / np.sqrt(noise.size)
    still = ideal(lib, gentle, plant, rng=np.random.default_rng(1))
    bare = ideal(lib, gentle, plant)
    assert np.array_equal(still.q, bare.q)
    # 707 samples: 2.7 %, four of them.
    assert (still.tau - bare.tau).std() == pytest.approx(0.2, rel=0.11)


def test_seeds_decide_everything(lib: Library, gentle: Trajectory) -> None:
    """Property: same seed, same bits; another seed, other noise and another robot."""
    plant = Plant(lib.pi0, torque_noise=0.1)
    runs = [closed_loop(lib, gentle, plant, np.random.default_rng(s), 200.0) for s in (1, 1, 2)]
    assert np.array_equal(runs[0].tau, runs[1].tau)
    assert not np.array_equal(runs[0].tau, runs[2].tau)
    lams = [perturbed_lam(lib, 0.05, np.random.default_rng(s)) for s in (1, 1, 2)]
    assert np.array_equal(lams[0], lams[1])
    assert not np.array_equal(lams[0], lams[2])
    # Elementwise and relative: 70 draws of N(0, 0.05²), four deviations of their deviation.
    relative = (lams[0] / lib.lam0 - 1)[lib.lam0 != 0]
    assert relative.std() == pytest.approx(0.05, rel=4 / np.sqrt(2 * relative.size))


def test_the_closed_loop_is_pinocchios(
    lib: Library, gentle: Trajectory, pi_true: np.ndarray
) -> None:
    """Oracle: aba of Pinocchio with rotors, integrated by solve_ivp period by period."""
    plant = Plant(pi_true, viscous=0.5, coulomb=0.4, offset=0.2, rotor=np.linspace(0.4, 0.1, 7))
    gains = Controller(stiffness=np.linspace(300, 200, 7), damping=25.0, rotor=0.15)
    t = sample_times(0.05, 1000.0)
    reference = np.stack(gentle.at(lib, t + 0.1)[:3], axis=1)
    reference[0, 0] += 0.01  # not where it should be
    noise = 1e-3 * np.random.default_rng(0).normal(size=(len(t), 2, 7))
    motion = follow(lib, reference, plant, gains, 1000.0, noise)

    believed = pinocchio_model(lib.urdf())
    real = with_parameters(believed, lib, pi_true)
    real.armature = np.asarray(plant.rotor)
    books = believed.createData(), real.createData()
    x = reference[0, :2].ravel()
    for k in range(len(t)):
        q, dq = np.split(x + noise[k].ravel(), 2)
        wanted_q, wanted_dq, wanted_ddq = reference[k]
        u = wanted_ddq + 25.0 * (wanted_dq - dq) + gains.stiffness * (wanted_q - q)
        tau = pinocchio.rnea(believed, books[0], q, dq, u) + 0.15 * u

        def slope(_: float, x: np.ndarray, tau: np.ndarray = tau) -> np.ndarray:
            q, dq = np.split(x, 2)
            free = tau - 0.5 * dq - 0.4 * np.tanh(dq / 0.03) - 0.2
            return np.concatenate([dq, pinocchio.aba(real, books[1], q, dq, free)])

        # 0.05 s of steps of 0.2 ms: h² times third derivatives of 1e3 rad/s³ leave 1e-6 rad
        # and 2e-5 rad/s; accelerations follow through K_d, friction 0.4/0.03 and torques.
        assert np.concatenate([motion.q[k], motion.dq[k]]) == pytest.approx(x, abs=2e-5)
        assert motion.motor[k] == pytest.approx(tau, abs=2e-3)
        assert motion.ddq[k] == pytest.approx(slope(0.0, x)[7:], abs=2e-2)
        x = solve_ivp(slope, (0, 1e-3), x, rtol=1e-10, atol=1e-12).y[:, -1]
    assert motion.link == pytest.approx(motion.motor - plant.rotor * motion.ddq, abs=1e-12)


def test_no_robot_and_no_control_are_reported(lib: Library, gentle: Trajectory) -> None:
    """Property: an indefinite mass matrix stops the simulation before the first NaN."""
    reference = np.stack(gentle.at(lib, sample_times(1.0, 1000.0))[:3], axis=1)
    with pytest.raises(SimulationError, match="not positive definite, so no such robot exists"):
        follow(lib, reference, Plant(-lib.pi0, rotor=0.01), Controller(), 1000.0)
    with pytest.raises(SimulationError, match=r"stopped after 0\.\d+ s: the motion diverged"):
        follow(lib, reference, Plant(lib.pi0), Controller(damping=-40.0), 1000.0)


def test_joints_have_separate_values(lib: Library, gentle: Trajectory) -> None:
    """Property: an array serves its joints, another length is one sentence."""
    reference = np.stack(gentle.at(lib, sample_times(0.1, 1000.0))[:3], axis=1)
    with pytest.raises(IdentificationError, match="viscous needs one number, or one for each of"):
        follow(lib, reference, Plant(lib.pi0, viscous=[0.1, 0.2]), Controller(), 1000.0)
    with pytest.raises(IdentificationError, match="stiffness needs one number"):
        follow(lib, reference, Plant(lib.pi0), Controller(stiffness=[1.0] * 6), 1000.0)
    same = [
        follow(lib, reference, Plant(lib.pi0, viscous=v), Controller(), 1000.0).q
        for v in (0.3, [0.3] * 7)
    ]
    assert np.array_equal(*same)


def test_a_closed_loop_log_identifies_the_truth(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: from a log as a bench gives it, the torques of the true robot on another motion."""
    truth = Plant(
        pi_true,
        viscous=0.5,
        coulomb=0.3,
        position_noise=1e-5,
        velocity_noise=1e-3,
        torque_noise=0.05,
    )
    log = closed_loop(lib, trajectories[0], truth, np.random.default_rng(0), 500.0)
    result = identify_recording(
        log,
        lib,
        friction=Friction(("viscous", "coulomb"), truth.coulomb_speed),
        preparation=Preparation(
            max_gap_s=0.01, filter="butterworth", cutoff_hz=15.0, trim_s=0.1, rate_hz=100.0
        ),
    )
    other = ideal(lib, trajectories[2], Plant(pi_true))
    before = lib.inverse_dynamics(other.q, other.dq, other.ddq, lib.pi0)
    after = lib.inverse_dynamics(other.q, other.dq, other.ddq, result.pi)
    assert result.is_consistent
    # The URDF is off by 4 % (link 7 doubled); noise, filter and smooth Coulomb leave 0.3 %.
    assert torque_error(other.tau, before).overall > 2.0
    assert torque_error(other.tau, after).overall < 0.5
    # 480 correlated samples of 0.05 N·m determine friction to a few hundredths.
    assert result.phi == pytest.approx(np.tile([0.5, 0.3], (7, 1)), abs=0.1)


def test_a_robot_too_far_from_the_model_diverges(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: a loop that the controller cannot hold is one sentence, not a log of NaN."""
    light = 1e-3 * lib.pi0
    with pytest.raises(SimulationError, match="the motion diverged"):
        closed_loop(lib, trajectories[0], Plant(light, rotor=1e-4), np.random.default_rng(0), 100)


@pytest.mark.parametrize(
    "field", ["viscous", "coulomb", "rotor", "position_noise", "velocity_noise", "torque_noise"]
)
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_impossible_plants_are_refused(lib: Library, field: str, value: float) -> None:
    """Property: no negative and no infinite property; the sentence names it."""
    with pytest.raises(IdentificationError, match=f"{field.replace('_', ' ')} cannot be"):
        Plant(lib.pi0, **{field: value})
    with pytest.raises(IdentificationError, match="not finite; lower the perturbation"):
        Plant(value * np.abs(lib.pi0) if value != -1 else np.full(70, np.nan))


@pytest.mark.parametrize(
    ("duration", "rate"),
    [(10, 0), (10, -5), (10, np.nan), (10, np.inf), (0, 100), (np.inf, 100), (1e9, 100)],
)
def test_clocks_that_are_none(duration: float, rate: float) -> None:
    """Property: no samples, or more than memory holds, are one sentence."""
    with pytest.raises(IdentificationError, match="positive duration and sampling rate"):
        sample_times(duration, rate)
    # The last instant is the duration, to rounding of the rate.
    assert sample_times(10.0, 30.0)[-1] == pytest.approx(10.0, rel=1e-15)
