"""Parts of the virtual robot: MuJoCo's model, friction, sensors, settings."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from runtime.errors import IdentificationError, SimulationError
from runtime.library import Library, load
from runtime.simulation import settings_of
from runtime.simulation.plant_engine import engine
from runtime.simulation.settings import Sensors, VirtualFriction
from runtime.simulation.virtual_robot import (
    Calibration,
    Encoders,
    SimulatedFriction,
    measured_torque,
    perturbed,
    quantised,
)
from tests.oracle import random_states

ROBOTS = ("fr3", "tree", "gantry", "iiwa14")


@pytest.mark.parametrize("name", ROBOTS)
def test_mujoco_and_the_library_are_one_robot(name: str, robot: Callable[[str], Library]) -> None:
    """Oracle: MuJoCo's inverse and forward dynamics of another π, branches, slides, any gravity."""
    lib = robot(name)
    rng = np.random.default_rng(1)
    pi = perturbed(lib, lib.pi0, 0.1, rng)
    rotor = rng.uniform(0.05, 0.3, lib.n_joints)
    made = engine(lib, pi, rotor, ranges=False)
    q, dq, ddq = random_states(lib.n_joints, 30, seed=2)
    tau = lib.inverse_dynamics(q, dq, ddq, pi) + rotor * ddq
    free = lib.forward_dynamics(q, dq, tau, pi, rotor)
    for k in range(len(q)):
        state = (made.sorted(x[k]) for x in (q, dq, ddq))
        # Rounding, 1e-13 of the torque; the inertia goes through λ and principal axes.
        size = np.abs(tau).max()
        assert made.restored(made.inverse_dynamics(*state)) == pytest.approx(
            tau[k], abs=1e-10 * size
        )
        made.data.qfrc_applied[:] = made.sorted(tau[k])
        made.mujoco.mj_forward(made.model, made.data)
        # Times the condition of M, up to 1e3.
        assert made.restored(made.data.qacc) == pytest.approx(
            free[k], abs=1e-9 * np.abs(free).max()
        )
    diagonal = np.diag(lib.mass_matrix(q[-1], pi)) + rotor
    assert made.restored(made.mass_diagonal(made.sorted(q[-1]))) == pytest.approx(diagonal)


def test_the_tree_is_the_urdfs(fr3: Library) -> None:
    """Oracle: MuJoCo's own reading of the URDF, which knows nothing of our manifest."""
    made = engine(fr3, fr3.pi0)
    theirs = made.mujoco.MjModel.from_xml_string(fr3.urdf())
    # 17 digits of text against the snapped tree: rounding of angles.
    assert made.model.body_pos[1:] == pytest.approx(theirs.body_pos[1:], abs=1e-12)
    assert np.abs(made.model.body_quat[1:]) == pytest.approx(
        np.abs(theirs.body_quat[1:]), abs=1e-12
    )
    assert made.model.jnt_range == pytest.approx(theirs.jnt_range, abs=0)
    assert made.model.body_mass[1:] == pytest.approx(theirs.body_mass[1:], abs=1e-12)


def test_a_free_pendulum_keeps_its_energy(tiny_built: Path) -> None:
    """Property: without friction and motor the sum of both energies stays, to first order in h."""
    pendulum = load(tiny_built)
    drift = []
    for step in (4e-4, 2e-4):
        made = engine(pendulum, pendulum.pi0, 0.03, step, ranges=False)
        made.data.qpos[0], made.data.qvel[0] = 0.3, 1.0
        energy = []
        for _ in range(round(0.4 / step)):
            q, dq = made.data.qpos[0], made.data.qvel[0]
            inertia = 0.02 + 1.5 * (0.1**2 + 0.2**2) + 0.03
            height = 0.2 * np.cos(q) - 0.1 * np.sin(q)
            energy.append(inertia * dq**2 / 2 + 1.5 * 9.81 * height)
            made.mujoco.mj_step(made.model, made.data)
        drift.append(np.abs(np.array(energy) - energy[0]).max())
    # Semi-implicit Euler: h/2 · power, 3.5 N·m at up to 5 rad/s.
    assert drift[1] < 4e-3
    assert drift[0] / drift[1] == pytest.approx(2, rel=0.1)


def test_mujoco_is_missing(fr3: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: one sentence with the command that installs it."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(SimulationError, match=r"pip install 'symgen\[simulation\]'"):
        engine(fr3, fr3.pi0)


def law(**changes: float) -> VirtualFriction:
    """VirtualFriction of one joint, nothing but what is named."""
    values = dict.fromkeys(VirtualFriction.__dataclass_fields__, 0.0)
    values |= {"stribeck_speed": 0.1, "dahl_stroke": 2e-3} | changes
    return VirtualFriction(**{key: np.array([value]) for key, value in values.items()})


def moved(terms: VirtualFriction, speed: float, seconds: float, tau: float = 0.0) -> float:
    """VirtualFriction at the end of a way with constant speed, from rest at q = 0."""
    step, joint = 1e-4, SimulatedFriction(terms, 1e-4, np.array([0]))
    f = np.zeros(1)
    for k in range(round(seconds / step)):
        q, dq, load_ = np.array([speed * step * (k + 1)]), np.array([speed]), np.array([tau])
        f, _ = joint.advance(q, dq, load_)
    return float(f[0])


def test_steady_friction_is_the_closed_form() -> None:
    """Oracle: f by hand, long after the contact has given way (z = ±1)."""
    terms = law(
        coulomb=0.8, asymmetry=0.1, stribeck=0.25, viscous=0.3, load=0.02, ripple=0.06,
        ripple_waves=8.0, ripple_phase=0.5,
    )  # fmt: skip
    for speed in (0.15, -0.15):
        # 0.3 s at 0.15 rad/s are 22 strokes of 2 mrad.
        f = moved(terms, speed, 0.3, tau=-20.0)
        level = 0.8 * (1 + 0.1 * np.sign(speed)) + 0.2 * np.exp(-((speed / 0.1) ** 2)) + 0.4
        wave = 0.06 * 0.8 * np.sin(8 * 0.3 * speed + 0.5)
        # exp(−22) of the transient.
        assert f == pytest.approx(np.sign(speed) * level + 0.3 * speed + wave, abs=1e-8)


def test_friction_remembers_its_way() -> None:
    """Oracle: Dahl from rest, f = f_c (1 − exp(−x/z_c)); the implicit step is off by h/2 of it."""
    for way in (0.5e-3, 2e-3, 5e-3):
        # 0.01 rad/s: steps of 1e-6 rad, 1/2000 of the stroke.
        assert moved(law(coulomb=1.0), 0.01, way / 0.01) == pytest.approx(
            1 - np.exp(-way / 2e-3), abs=5e-4
        )


def test_friction_tells_its_slope() -> None:
    """Derivative: ∂f/∂dq of one step by differences, where f has no kink, and never |z| > 1."""
    terms = law(coulomb=0.8, viscous=0.3, dahl_stroke=1e-4)
    for speed in (0.02, -0.3):
        ends = []
        for side in (-1e-6, 1e-6):
            joint = SimulatedFriction(terms, 2.5e-4, np.array([0]))
            joint.z = np.array([0.4 * np.sign(speed)])
            ends.append(joint.advance(np.zeros(1), np.array([speed + side]), np.zeros(1)))
            assert np.abs(joint.z) <= 1
        slope = (ends[1][0] - ends[0][0]) / 2e-6
        assert (ends[0][1] + ends[1][1]) / 2 == pytest.approx(slope, rel=1e-5)


def sensors_of(n: int, **changes: float) -> Sensors:
    """Perfect sensors of n joints but for what is named."""
    values = dict.fromkeys(Sensors.__dataclass_fields__, 0.0) | {"velocity_cutoff_hz": 100.0}
    return Sensors(**{key: np.full(n, value) for key, value in (values | changes).items()})


def test_sensors_err_as_much_as_they_say() -> None:
    """Oracle: a line through 4e4 samples has the gain and the bias, its rest the noise."""
    rng = np.random.default_rng(3)
    of = Calibration(np.array([1.01, 0.99]), np.array([0.2, -0.1]))
    true = rng.normal(0, 10, (40_000, 2))
    sensed = measured_torque(true, sensors_of(2, torque_noise=0.05, torque_quantum=0.02), of, rng)
    assert sensed / 0.02 == pytest.approx(np.round(sensed / 0.02), abs=1e-6)
    for j in range(2):
        line = np.stack([true[:, j], np.ones(len(true))], axis=1)
        gain, bias = np.linalg.lstsq(line, sensed[:, j])[0]
        rest = sensed[:, j] - gain * true[:, j] - bias
        # σ/√N: 2.5e-4 N·m of bias, a tenth of it in the gain; four of them.
        assert gain == pytest.approx(of.gain[j], abs=1e-4)
        assert bias == pytest.approx(of.bias[j], abs=1e-3)
        # Noise and the uniform error of the quantum; 1/√(2N) = 0.35 %, four of them.
        assert rest.std() == pytest.approx(np.hypot(0.05, 0.02 / np.sqrt(12)), rel=0.014)


def test_encoders_differ_and_filter() -> None:
    """Oracle: the step response of the low-pass, 1 − exp(−2π f t), of a speed that sets in."""
    period, speed = 1e-3, 0.7
    encoders = Encoders(sensors_of(1), np.zeros((50, 1)), period, np.array([0]))
    sensed = []
    for k in range(50):
        q = np.array([speed * period * k])
        sensed.append(encoders.read(k, q, np.zeros(1))[1][0])
    expected = speed * (1 - np.exp(-2 * np.pi * 100 * period * np.arange(50)))
    assert sensed == pytest.approx(expected, abs=1e-12)
    coarse = Encoders(sensors_of(1, position_quantum=1e-3), np.zeros((9, 1)), period, np.array([0]))
    read = [coarse.read(k, np.array([2.6e-4 * k]), np.zeros(1))[0][0] for k in range(9)]
    assert read == pytest.approx(1e-3 * np.array([0, 0, 1, 1, 1, 1, 2, 2, 2]), abs=1e-15)
    assert quantised(np.array([0.123]), np.zeros(1)) == 0.123


def test_the_truth_is_near_and_exists(fr3: Library) -> None:
    """Oracle: the eigenvalues of P⁻¹ P' are exp(s · those of S), S from the same draws."""
    pi = perturbed(fr3, fr3.pi0, 0.02, np.random.default_rng(4))
    draws = np.random.default_rng(4).normal(size=(7, 4, 4))
    pairs = zip(fr3.pseudo_inertia(fr3.pi0), fr3.pseudo_inertia(pi), draws, strict=True)
    for before, after, draw in pairs:
        S = (draw + draw.T) / 2
        result = np.log(scipy.linalg.eigh(after, before, eigvals_only=True))
        # Rounding over the thinnest body, 1e-16 / 1e-5.
        assert result == pytest.approx(0.02 * np.linalg.eigvalsh(S), abs=1e-9)


def test_settings_of_any_robot(tiny_built: Path, fr3: Library) -> None:
    """Property: limits make a plausible robot, the bundled file the FR3."""
    pendulum = settings_of(load(tiny_built))
    assert pendulum.friction.coulomb == pytest.approx([0.1])  # a hundredth of 10 N·m
    ours = settings_of(fr3)
    assert ours.friction.coulomb.tolist() == [0.85, 0.2, 0.6, 0.1, 0.75, 0.14, 0.27]
    assert ours.rotor.tolist() == [0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1]
    assert len(ours.sha256) == 64


def test_settings_without_limits(tiny_built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a pendulum that nobody told a limit of lifts three times m g √(x² + z²), by hand."""
    pendulum = load(tiny_built)
    limits = pendulum.limits() | {"effort": np.array([np.inf]), "velocity": np.array([np.inf])}
    monkeypatch.setattr(Library, "limits", lambda _: limits)
    strongest = 3 * 1.5 * 9.81 * np.hypot(0.1, 0.2)
    friction = settings_of(pendulum).friction
    # 100 poses of 3 rad: the nearest to the worst one is less than 0.1 rad away.
    assert friction.coulomb == pytest.approx([0.01 * strongest], rel=0.005)
    assert friction.viscous == pytest.approx(0.5 * friction.coulomb / np.pi)


def test_a_file_replaces_single_entries(fr3: Library, tmp_path: Path) -> None:
    """Property: what the file names changes, nothing else does, and the hash with it."""
    file = tmp_path / "mine.toml"
    file.write_text("[drive]\ndelay_s = 0.002\n[controller]\nlaw = 'feedforward'\n")
    ours, mine = settings_of(fr3), settings_of(fr3, file)
    assert (mine.delay_s, mine.law) == (0.002, "feedforward")
    same = replace(mine, delay_s=ours.delay_s, law=ours.law)
    assert same.sha256 == ours.sha256 != mine.sha256


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[friction]\ncolomb = 1", "unknown key 'colomb' in friction; did you mean 'coulomb'"),
        ("[frictions]\ncoulomb = 1", "unknown key 'frictions'; did you mean 'friction'"),
        ("friction = 1", "friction expects a table, got 1"),
        ("[friction]\ncoulomb = [1, 2]", "one for each of the 7 joints, got"),
        ("[friction]\ncoulomb = -1", "expects one number from 0 up"),
        ("[friction]\ncoulomb = nan", "friction.coulomb expects a finite number, got inf or nan"),
        ("[friction]\ncoulomb = 'much'", "expects one number from 0 up"),
        ("[friction]\ndahl_stroke = 0", "expects one number above 0"),
        (
            "[inertia]\nspread = [0, 0, 0, 0, 0, 0, 1]",
            r"spread expects one number from 0 to 1 \(0.02 is usual\), got .0, 0,",
        ),
        (
            "[inertia]\nspread = 5",
            r"spread expects one number from 0 to 1 \(0.02 is usual\), got 5",
        ),
        ("[drive]\nstep_s = 1.0", "does not go into a period of the controller"),
        ("[drive]\nstep_s = 1e9", "does not go into a period of the controller"),
        ("[drive]\nstep_s = 1e-320", "does not go into a period of the controller"),
        ("[drive]\ndelay_s = 1e-4", "does not go into delay_s of 0.0001 s"),
        ("[controller]\nrate_hz = 300", "into a period of the controller of 0.00333333 s"),
        ("[controller]\nlaw = 'magic'", "one of computed_torque, feedforward, got 'magic'"),
        ("[friction", "cannot be read as TOML"),
    ],
)
def test_settings_that_are_none(fr3: Library, tmp_path: Path, text: str, message: str) -> None:
    """Property: one sentence that names the entry."""
    file = tmp_path / "bad.toml"
    file.write_text(text)
    with pytest.raises(IdentificationError, match=message):
        settings_of(fr3, file)
