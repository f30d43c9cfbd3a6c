"""The compiled loop without a motor: a pendulum falls as its equation says."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from runtime import load
from runtime.library import Library
from runtime.library.compiled_programs import (
    NOT_POSITIVE,
    ClosedLoopController,
    ClosedLoopPlant,
    CompiledClosedLoop,
)
from runtime.simulation import Plant

# The pendulum of the tests by hand: centre of mass at (0.1, 0, 0.2) m, axis y.
MASS, X, Z, I_YY, ROTOR = 1.5, 0.1, 0.2, 0.02, 0.03


def released(
    robot: Library, plant: Plant, start: np.ndarray, steps: int, h: float
) -> CompiledClosedLoop:
    """No motor: the plant falls freely from (q, dq) with `steps` steps of h."""
    n = robot.n_joints
    zero, every = np.zeros(n), np.ones(n)
    body = ClosedLoopPlant(
        plant.pi,
        *(np.asarray(x) * every for x in (plant.rotor, plant.viscous, plant.coulomb)),
        zero,
        plant.coulomb_speed,
    )
    law = ClosedLoopController(np.zeros_like(plant.pi), zero, zero, zero)
    reference = np.zeros((steps + 1, 3, n))
    reference[0, :2] = start
    loop = CompiledClosedLoop(robot.binding, body, law, reference, h, substeps=1)
    loop.run(steps + 1)
    return loop


def swing(_: float, state: np.ndarray) -> list[float]:
    angle, speed = state
    torque = 9.81 * MASS * (X * np.cos(angle) + Z * np.sin(angle)) - 0.2 * speed
    torque -= 0.4 * np.tanh(speed / 0.3)
    return [speed, torque / (I_YY + MASS * (X**2 + Z**2) + ROTOR)]


def test_forward_integration_of_a_pendulum(tiny_built: Path) -> None:
    """Oracle: scipy's solve_ivp on the pendulum's equation, written by hand; order two in h."""
    pendulum = load(tiny_built)
    plant = Plant(pendulum.pi0, viscous=0.2, coulomb=0.4, coulomb_speed=0.3, rotor=ROTOR)
    start = np.array([0.3, -2.0])
    truth = solve_ivp(swing, (0, 0.4), start, rtol=1e-12, atol=1e-13).y[:, -1]
    errors = []
    for steps in (100, 200, 400):
        log = released(pendulum, plant, start[:, None], steps, 0.4 / steps).log
        errors.append(np.abs(log[-1, :2, 0] - truth).max())
    # h² = 1e-6 times third derivatives of some 100 rad/s³ over 0.4 s.
    assert errors[-1] < 1e-4
    # Order two divides by 4; 3.5 to 4.5 leaves room for the next order.
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx([4, 4], abs=0.5)


def test_a_free_pendulum_keeps_its_energy(tiny_built: Path) -> None:
    """Property: without friction kinetic plus potential energy stays, to the order of the step."""
    pendulum = load(tiny_built)
    plant = Plant(pendulum.pi0, rotor=ROTOR)
    log = released(pendulum, plant, np.array([[0.5], [1.0]]), 5000, 2e-4).log
    q, dq = log[:, 0, 0], log[:, 1, 0]
    inertia = I_YY + MASS * (X**2 + Z**2) + ROTOR
    energy = inertia * dq**2 / 2 + MASS * 9.81 * (Z * np.cos(q) - X * np.sin(q))
    # h² = 4e-8 × rates of 100 /s² × 3 J.
    assert energy == pytest.approx(energy[0], abs=1e-5)


def test_stiff_friction_is_stable(tiny_built: Path) -> None:
    """Property: friction 3 and 50 times too fast for an explicit step brings the pendulum to rest.

    3.5 N·m of gravity against the friction: at rest the speed creeps at a fraction of ε.
    """
    pendulum = load(tiny_built)
    for coulomb, speed, at_rest in ((20.0, 2e-2, 100), (20.0, 1e-3, 900)):
        # 20 N·m over ε on 0.125 kg·m², times 1 ms: 8 and 160; Runge–Kutta ends at 2.8.
        plant = Plant(pendulum.pi0, coulomb=coulomb, coulomb_speed=speed, rotor=ROTOR)
        log = released(pendulum, plant, np.array([[0.3], [1.0]]), 1000, 1e-3).log
        # The midpoint rule rings where friction is very stiff, but within the first speed.
        assert np.abs(log[:, 1]).max() <= 1.0
        assert np.abs(log[at_rest:, 1]).max() < speed


def test_a_robot_that_cannot_exist_does_not_fall(lib: Library) -> None:
    """Property: the first step reports the indefinite mass matrix and writes no NaN."""
    loop = released(lib, Plant(-lib.pi0), np.stack([lib.home, np.zeros(7)]), 5, 1e-3)
    assert (loop.status, loop.done) == (NOT_POSITIVE, 0)
    assert np.isfinite(loop.log).all()
