"""The virtual robot as a whole: its drive, its log and its truth."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import read_recording
from runtime.errors import SimulationError
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import write_motion
from runtime.library import Library
from runtime.recording import Recording
from runtime.recording.preprocessing import DOCUMENT, prepare
from runtime.simulation import Box, record, settings_of
from runtime.simulation.settings import Sensors, VirtualRobotSettings
from runtime.simulation.virtual_robot import VirtualLog, perturbed
from tests.runtime.conftest import Command
from tests.virtual_settings import frictionless

BOX = Box(1.8, (0.01, 0.02, 0.167), (0.1, 0.08, 0.1))


def perfect(settings: VirtualRobotSettings, **changes: object) -> VirtualRobotSettings:
    """Without friction, with perfect sensors."""
    n = len(settings.rotor)
    exact = {key: np.zeros(n) for key in Sensors.__dataclass_fields__}
    exact["velocity_cutoff_hz"] = np.full(n, 100.0)
    return replace(frictionless(settings), sensors=Sensors(**exact), **changes)


@pytest.fixture(scope="module")
def gentle(lib: Library) -> Trajectory:
    """One second out and back."""
    return Trajectory(lib.home, 0.02 * np.array([[1, -0.5]] * 7) * np.arange(1, 8)[:, None], 1.0)


@pytest.fixture(scope="module")
def plain(lib: Library, gentle: Trajectory) -> VirtualLog:
    """The FR3 as it is, on it."""
    return record(lib, gentle, seed=1)


def test_same_seeds_same_bits(lib: Library, gentle: Trajectory, plain: VirtualLog) -> None:
    """Property: one seed draws the noise, the other the robot; both together decide everything."""
    again, other = record(lib, gentle, seed=1), record(lib, gentle, seed=2)
    for key in ("q", "dq", "tau"):
        assert np.array_equal(getattr(again.recording, key), getattr(plain.recording, key))
        assert not np.array_equal(getattr(other.recording, key), getattr(plain.recording, key))
    assert again.truth.facts(lib) == plain.truth.facts(lib)
    assert np.array_equal(other.truth.pi, plain.truth.pi)
    assert np.array_equal(other.truth.sensors.gain, plain.truth.sensors.gain)
    third = record(lib, gentle, seed=1, truth_seed=1)
    assert not np.array_equal(third.truth.pi, plain.truth.pi)
    assert not np.array_equal(third.truth.sensors.bias, plain.truth.sensors.bias)


def test_without_friction_the_torque_is_the_librarys(lib: Library, gentle: Trajectory) -> None:
    """Oracle: our inverse dynamics of the truth with its payload along MuJoCo's true states."""
    settings = perfect(settings_of(lib))
    log = record(lib, gentle, settings, seed=0, payload=BOX)
    m = log.motion
    rigid = lib.inverse_dynamics(m.q, m.dq, m.ddq, log.truth.pi)
    # ddq is a difference over 0.25 ms: rounding of dq, 1e-16 / 2.5e-4, times 1 kg·m².
    assert m.link == pytest.approx(rigid, abs=1e-9)
    assert log.recording.tau == pytest.approx(rigid, abs=1e-9)
    assert log.recording.q == pytest.approx(m.q, abs=0)
    empty = lib.inverse_dynamics(m.q, m.dq, m.ddq, log.truth.pi_arm)
    # 1.8 kg on an arm of about half a metre.
    assert np.abs(rigid - empty).max() > 5.0


@pytest.mark.parametrize("delay", [0.0, 0.001, 0.003])
def test_the_torque_arrives_late(lib: Library, gentle: Trajectory, delay: float) -> None:
    """Oracle: computed torque by our library from the log of `delay` before, to rounding."""
    settings = replace(settings_of(lib), delay_s=delay)
    log = record(lib, gentle, settings, seed=0)
    q, dq, late = log.recording.q, log.recording.dq, round(delay * 1000)
    wanted = gentle.at(lib, log.recording.t)
    u = wanted[2] + 30 * (wanted[1] - dq) + 225 * (wanted[0] - q)
    requested = lib.inverse_dynamics(q, dq, u, lib.pi0) + settings.rotor * u
    count = len(requested) - late
    # Rounding of torques up to 90 N·m.
    assert log.motion.motor[late:] == pytest.approx(requested[:count], abs=1e-10)
    assert log.motion.motor[:late] == pytest.approx(np.tile(requested[0], (late, 1)), abs=1e-10)
    assert not log.truth.saturated.any()


def test_the_feedforward_law(lib: Library, gentle: Trajectory) -> None:
    """Oracle: ID of the reference plus gains times the diagonal of M + J at home."""
    settings = replace(settings_of(lib), delay_s=0.0, law="feedforward")
    log = record(lib, gentle, settings, seed=0)
    q, dq = log.recording.q, log.recording.dq
    wanted = gentle.at(lib, log.recording.t)
    known = lib.inverse_dynamics(*wanted[:3], lib.pi0) + settings.rotor * wanted[2]
    inertia = np.diag(lib.mass_matrix(lib.home, lib.pi0)) + settings.rotor
    requested = known + inertia * (30 * (wanted[1] - dq) + 225 * (wanted[0] - q))
    assert log.motion.motor == pytest.approx(requested, abs=1e-10)


def test_friction_eats_the_work_of_the_motors(lib: Library, gentle: Trajectory) -> None:
    """Property: from rest to rest at one pose, ∫ τ dq is what friction took: f_c times the way.

    Every turn gives back what the bent contact kept, f_c z_c: with z_c of 0.1 mrad nothing.
    """
    level = np.array([0.4, 0.4, 0.3, 0.3, 0.2, 0.2, 0.1])
    work = []
    for coulomb in (np.zeros(7), level):
        settings = perfect(settings_of(lib))
        friction = replace(settings.friction, coulomb=coulomb, dahl_stroke=np.full(7, 1e-4))
        log = record(lib, gentle, replace(settings, friction=friction), seed=0)
        m = log.motion
        power = m.motor * m.dq
        work.append(power.sum(axis=0) * 1e-3)
        way = np.abs(m.dq).sum(axis=0) * 1e-3
    # 30 N·m a millimetre of arc from home at the end, where PD control has not brought it yet.
    assert abs(work[0].sum()) < 0.05
    lost = (work[1] - work[0]).sum()
    # Likewise: 0.05 J of 0.79 J.
    assert lost == pytest.approx(level @ way, abs=0.05)


def test_an_arm_that_is_lost(
    lib: Library, gentle: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: motors that cannot carry the payload are one sentence, and no file of MuJoCo."""
    monkeypatch.chdir(tmp_path)  # where MuJoCo would write
    heavy = Box(60.0, (0.0, 0.0, 0.3))
    with pytest.raises(SimulationError, match=r"lost its trajectory after 0\.\d+ s .* too weak"):
        record(lib, gentle, seed=0, payload=heavy)
    with pytest.raises(SimulationError, match="gains are wrong"):
        record(lib, gentle, replace(settings_of(lib), damping=np.full(7, -40.0)), seed=0)
    assert not list(tmp_path.iterdir())


def test_a_weak_motor_saturates(lib: Library, gentle: Trajectory) -> None:
    """Property: no torque above the effort limit is ever applied, and the truth tells how often."""
    log = record(lib, gentle, seed=0, payload=Box(12.0, (0.0, 0.05, 0.25)))
    assert (np.abs(log.motion.motor) <= lib.limits()["effort"]).all()
    assert log.truth.saturated.max() > 0.01


@pytest.mark.parametrize("name", ["tree", "gantry"])
def test_any_robot_follows(name: str, robot: Callable[[str], Library]) -> None:
    """Property: settings from limits let a tree and a slide follow, as far behind as friction says.

    At low speed K_p (M + J) e = f, for a loop without integrator.
    """
    lib, limits = robot(name), robot(name).limits()
    room = np.minimum(limits["upper"] - lib.home, lib.home - limits["lower"])
    motion = Trajectory(lib.home, 0.5 * np.minimum(room, 1.0)[:, None], 4.0)
    log = record(lib, motion, seed=0)
    m, settings = log.motion, settings_of(lib)
    friction = np.abs(m.link - lib.inverse_dynamics(m.q, m.dq, m.ddq, log.truth.pi)).max(axis=0)
    assert (friction > 0.5 * settings.friction.coulomb).all()
    inertia = lib.mass_matrix(lib.home, lib.pi0) + np.diag(settings.rotor)
    behind = np.abs(m.q - motion.at(lib, log.recording.t)[0]).max(axis=0)
    # Half as much again: the poses differ from home, and reversals overshoot.
    assert (behind < 1.5 * np.abs(np.linalg.inv(inertia)) @ friction / 225).all()


def test_the_documents_preprocessing() -> None:
    """Oracle: numpy's convolution with 51 ones, central differences, once more; every tenth."""
    t = np.arange(3000) / 1000
    rng = np.random.default_rng(0)
    q, dq, tau = rng.normal(size=(3, 3000, 2))
    result = prepare(Recording(t, q, dq, None, tau), DOCUMENT)

    def mean(x: np.ndarray) -> np.ndarray:
        return np.stack([np.convolve(c, np.ones(51) / 51, "same") for c in x.T], axis=1)

    inner = slice(10, -10)
    for key, raw in (("q", q), ("dq", dq), ("tau", tau)):
        # Rounding of running sums.
        assert getattr(result, key)[inner] == pytest.approx(mean(raw)[::10][inner], abs=1e-10)
    ddq = mean(np.gradient(mean(dq), 1e-3, axis=0))
    assert result.ddq is not None
    assert result.ddq[inner] == pytest.approx(ddq[::10][inner], abs=1e-8)
    assert result.rate_hz == pytest.approx(100)


@pytest.fixture
def motion(lib: Library, gentle: Trajectory, tmp_path: Path) -> Path:
    """The gentle trajectory as a file."""
    write_motion(gentle, lib, tmp_path / "m.json")
    return tmp_path / "m.json"


def test_the_command_writes_a_log_like_a_real_one(
    command: Command, lib: Library, motion: Path, tmp_path: Path
) -> None:
    """Property: raw 1 kHz signals, quantised, and the truth; run again, the same bytes."""
    words = ("simulate", "--robot", lib.folder, "--trajectory", "m.json", "--seed", "3")
    words += ("--payload", "1.8,0.01,0.02,0.167,0.1,0.08,0.1", "--settings", "truth_seed=2")
    for name in ("a", "b"):
        ran = command(*words, "--out", f"{name}.csv")
        assert ran.code == 0, ran.err
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert (tmp_path / "a.truth.json").read_bytes() == (tmp_path / "b.truth.json").read_bytes()
    log, truth = (
        read_recording(tmp_path / "a.csv"),
        json.loads((tmp_path / "a.truth.json").read_text()),
    )
    assert (len(log), log.rate_hz, log.ddq) == (1001, pytest.approx(1000), None)
    assert log.tau is not None
    assert log.tau / 0.005 == pytest.approx(np.round(log.tau / 0.005), abs=1e-6)
    extra = np.array(truth["pi"]) - np.array(truth["pi_arm"])
    assert extra.reshape(7, 10)[:, 0] == pytest.approx([0, 0, 0, 0, 0, 0, 1.8], abs=1e-12)
    assert truth["beta"] == pytest.approx(lib.base_matrix @ truth["pi"], abs=1e-12)
    assert (truth["seed"], truth["truth_seed"]) == (3, 2)
    assert truth["engine"].startswith("mujoco ")
    assert truth["settings"]["friction"]["coulomb"][0] == 0.85
    assert (tmp_path / "a.loop.toml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("--engine", "mujoco", "--settings", "viscous=1"),
            "the setting viscous belongs to the engine 'compiled'",
        ),
        (("--payload", "1,0,0,0", "--ideal"), "--ideal belongs to the engine 'compiled'"),
        (
            ("--engine", "compiled", "--settings", "truth_seed=1"),
            "the setting truth_seed belongs to the engine 'mujo",
        ),
        (("--settings", "virtual_robot=none.toml"), "'none.toml' cannot be read .* one: fr3"),
        (("--payload", "60,0,0,0.3"), "lost its trajectory"),
        (("--ideal", "--settings", "keep_every=100000"), "keep_every=100000 leaves 1 of "),
    ],
)
def test_commands_that_are_refused(
    command: Command,
    lib: Library,
    motion: Path,
    tmp_path: Path,
    words: tuple[str, ...],
    message: str,
) -> None:
    """Property: one sentence, exit code 2, no file."""
    head = ("simulate", "--robot", lib.folder, "--trajectory", motion.name, "--out", "x.csv")
    ran = command(*head, *words)
    assert ran.code == 2
    assert len(ran.err.splitlines()) == 1
    assert re.search(message, ran.err)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.json"]


def test_ctrl_c_leaves_nothing(
    command: Command, lib: Library, motion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: an interrupt while the arm moves leaves no file, whole or half."""

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("runtime.simulation.virtual_robot.measured_torque", interrupt)
    words = ("simulate", "--robot", lib.folder, "--trajectory", motion.name, "--out", "x.csv")
    ran = command(*words, "--engine", "mujoco")
    assert ran.code == 130
    assert "interrupted" in ran.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.json"]


def test_a_plate_without_thickness_is_drawn(lib: Library) -> None:
    """Property: I_xx + I_yy = I_zz is a body, whose pseudo-inertia has an eigenvalue 0 or, by
    rounding, below it.
    """
    plate = np.array([0.5, 0.005, 0, -0.01, 0.0009, 0.00085, 0.00135, 0, 0.0001, 0])
    pi = np.tile(plate, lib.n_links)
    least = np.linalg.eigvalsh(lib.pseudo_inertia(pi))[:, 0]
    assert np.abs(least).max() < 1e-18
    drawn = perturbed(lib, pi, 0.05, np.random.default_rng(0))
    assert (lib.relative_eigenvalues(drawn) > 0).all()
