"""Positions predicted from commands: against MuJoCo, by closed forms, in evaluate and inspect."""

from pathlib import Path

import numpy as np
import pytest

from runtime.errors import SimulationError
from runtime.identification.evaluation import evaluate
from runtime.inspection import inspect_log
from runtime.library import Array, Library
from runtime.simulation.commanded_motion import ServoDrive, commanded_motion
from runtime.simulation.plant_engine import engine
from tests.runtime.conftest import Command

RATE, SECONDS, LATE = 100.0, 12.0, 0.03
SIZES = np.array([1.0, 1, 1, 1, 0.3, 0.3, 0.3])
"""Of the drives, base to wrist."""
KP, KD = 600.0 * SIZES, 30.0 * SIZES


def drive_of(n: int, dry: float = 2.0) -> ServoDrive:
    """Drives with dry friction that holds the wrist for a third of the time."""
    return ServoDrive(
        KP, KD, viscous=3 * SIZES, dry=dry * SIZES, offset=np.zeros(n), armature=0.2 * SIZES
    )


@pytest.fixture(scope="module")
def simulated(lib: Library) -> tuple[Array, Array, Array]:
    """Instants, commands and positions of a servo arm in MuJoCo, whose commands act 30 ms late."""
    drive, n = drive_of(lib.n_joints), lib.n_joints
    plant = engine(lib, lib.pi0, drive.armature, step=1e-3, ranges=False)
    plant.model.dof_frictionloss[plant.places] = drive.dry
    plant.model.dof_damping[plant.places] = drive.viscous + drive.damping
    t = np.arange(0, SECONDS, 1 / RATE)
    slow = 2 * np.pi * np.array([0.11, 0.23, 0.17, 0.29, 0.37, 0.41, 0.31])
    start = lib.home
    wanted = start + 0.35 * np.sin(slow * t[:, None]) * np.exp(-0.02 * t[:, None])
    q, fine = np.empty((len(t), n)), round(1 / RATE / plant.step_s)
    targets = delayed(np.arange(len(t) * fine) * plant.step_s, t, wanted)
    plant.q[plant.places] = start
    for k, target in enumerate(targets):
        if k % fine == 0:
            q[k // fine] = plant.q[plant.places]
        plant.applied[plant.places] = KP * (target - plant.q[plant.places])
        plant.advance()
    return t, wanted, q


def at_rest(q: Array) -> tuple[Array, Array]:
    """First row of a motion that starts from rest."""
    return q, np.zeros_like(q)


def delayed(instants: Array, t: Array, wanted: Array) -> Array:
    """Commands that act at some instants."""
    return np.column_stack([np.interp(instants - LATE, t, each) for each in wanted.T])


def test_mujoco_moves_the_same(lib: Library, simulated: tuple[Array, Array, Array]) -> None:
    """Oracle: MuJoCo at 1 ms with friction loss, beside backward Euler at 10 ms.

    The step of 10 ms delays by half of it what moves at .7 rad/s, 3 mrad; MuJoCo's friction creeps.
    """
    t, wanted, q = simulated
    drive = drive_of(lib.n_joints)
    command, zero = KP * delayed(t, t, wanted), np.zeros(lib.n_joints)
    path = commanded_motion(lib, lib.pi0, drive, t, command, at_rest(q[0]), zero)
    error = np.sqrt(np.mean((path - q) ** 2, axis=0))
    assert (error < 0.1 * np.sqrt(np.mean((wanted - q) ** 2, axis=0))).all()
    assert error.max() < 2e-3


def test_a_free_swing(lib: Library) -> None:
    """Oracle: MuJoCo at 0.5 ms; backward Euler at 4 ms errs by h/2 of a second of speeds, 25 mrad.

    Without Coriolis torques the first joint would be off by 0.9 rad.
    """
    n, zero, t = lib.n_joints, np.zeros(lib.n_joints), np.arange(0, 1, 0.004)
    drive = ServoDrive(zero, zero, np.ones(n), zero, zero, np.full(n, 0.2))
    plant = engine(lib, lib.pi0, drive.armature, step=5e-4, ranges=False)
    plant.model.dof_damping[:] = 1.0
    plant.q[plant.places] = lib.home
    q = []
    for _ in t:
        q.append(plant.q[plant.places].copy())
        for _ in range(8):
            plant.advance()
    path = commanded_motion(lib, lib.pi0, drive, t, np.zeros((len(t), n)), at_rest(lib.home), zero)
    assert path == pytest.approx(np.array(q), abs=0.04)


def test_bodies_that_cannot_exist_diverge(lib: Library) -> None:
    """Property: the motion of negative masses ends in a sentence, not in numbers without bound."""
    zero, t = np.zeros(lib.n_joints), np.arange(0, 3, 1 / RATE)
    drive = ServoDrive(KP, zero, zero, zero, zero, zero)
    push = np.tile(KP * lib.home, (len(t), 1))
    with pytest.raises(SimulationError, match="diverged after"):
        commanded_motion(lib, -lib.pi0, drive, t, push, at_rest(lib.home), zero)


def test_friction_holds_and_gravity_bends(lib: Library) -> None:
    """Closed form: below its dry friction a joint keeps its place; without it, K (w − q) = g(q)."""
    n, t = lib.n_joints, np.arange(0, 3, 1 / RATE)
    place, zero = lib.home, np.zeros(lib.n_joints)
    gravity = lib.inverse_dynamics(place, zero, zero, lib.pi0)
    stuck = np.tile(KP * place + gravity + 1.9 * SIZES, (len(t), 1))
    held = commanded_motion(lib, lib.pi0, drive_of(n), t, stuck, at_rest(place), zero)
    assert held == pytest.approx(np.tile(place, (len(t), 1)), abs=1e-12)
    command, drive = np.tile(KP * place, (len(t), 1)), drive_of(n, dry=0.0)
    free = commanded_motion(lib, lib.pi0, drive, t, command, at_rest(place), zero)
    sag = KP * (place - free[-1])
    assert sag == pytest.approx(lib.inverse_dynamics(free[-1], zero, zero, lib.pi0), abs=1e-3)


def log_of(simulated: tuple[Array, Array, Array], folder: Path, **gains: Array) -> Path:
    """NPZ of the log, with or without gains."""
    t, wanted, q = simulated
    speed = np.gradient(q, t, axis=0)
    np.savez(folder / "servo.npz", t=t, q=q, dq=speed, q_des=wanted, **gains)
    return folder / "servo.npz"


def test_unknown_gains_carry_the_links(
    lib: Library, simulated: tuple[Array, Array, Array], tmp_path: Path
) -> None:
    """Oracle: inspect proposes the kp of the simulated drives that carry gravity.

    The wrist has a third of it, and carries 2 % of the torque of gravity; what is left is friction.
    """
    found = inspect_log(log_of(simulated, tmp_path), lib)
    kinds = [each.kind for each in found.findings]
    assert {"unknown_gains", "law_gain"} <= set(kinds)
    law = found.plan.law
    assert law is not None
    assert law.kp == pytest.approx(600, rel=0.1)


def test_stated_gains_are_left_alone(
    lib: Library, simulated: tuple[Array, Array, Array], tmp_path: Path
) -> None:
    """Property: gains that carry the links get no finding."""
    found = inspect_log(log_of(simulated, tmp_path, kp=KP, kd=KD), lib)
    assert "law_gain" not in [each.kind for each in found.findings]


def test_evaluate_states_errors_of_positions(
    command: Command, lib: Library, simulated: tuple[Array, Array, Array], tmp_path: Path
) -> None:
    """Property: a model identified from the log predicts its positions; a log of τ has none."""
    log = log_of(simulated, tmp_path, kp=KP, kd=KD)
    words = ("--robot", lib.folder, "--cutoff", "10", "--delay", "auto", "--out", "out")
    assert command("identify", log, *words, "--settings", "report=false").code == 0
    done = evaluate(tmp_path / "out", log, lib)
    assert done.position_errors is not None
    errors = done.position_errors
    assert errors.seconds == pytest.approx(SECONDS - 1 / RATE)
    assert (np.array(errors.predicted) < 0.2 * np.array(errors.commanded)).all()
    ran = command("evaluate", "out", log, "--robot", lib.folder)
    assert "positions predicted from the commands alone" in ran.out
    # A joint that rests in the first rows at 1.5 times its dry friction is held where it is.
    t, _, q = simulated
    still = np.zeros(lib.n_joints)
    push = lib.inverse_dynamics(q[0], still, still, lib.pi0) + 1.5 * drive_of(lib.n_joints).dry
    rests = np.minimum(t, 1.0)[:, None] * (q[200] - q[0]) * (np.arange(lib.n_joints) == 6)
    arrays = {"t": t, "q": q[0] + rests, "dq": np.gradient(rests, t, axis=0)}
    np.savez(tmp_path / "rests.npz", **arrays, q_des=q[0] + push / KP + rests, kp=KP, kd=KD)
    done = evaluate(tmp_path / "out", tmp_path / "rests.npz", lib)
    assert done.position_errors is not None
    # Half of the dry friction over kp, 1.7 mrad, is where they would go; the wrist shakes by 2e-5.
    assert max(done.position_errors.predicted[:4]) < 1e-4
    assert any("joints at rest in the first rows: fr3_joint1" in note for note in done.notes)
