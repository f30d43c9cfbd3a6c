"""Two virtual robots and their clean logs, into which faults are put (`tests.runtime.faults`).

The cobot has motor currents, geared joints with much friction, and a clock whose steps are 10 or
12 ms. The other arm stands on a wall: gravity acts along +x of its base. Both are simulated by
`runtime.simulation` in a closed loop; their bodies differ from the URDF.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import basis_of
from runtime.library import Array, Library
from runtime.recording import Preparation, Recipe
from runtime.recording.recipes.recipe import Signal, Time
from runtime.simulation import record
from runtime.simulation.settings import VirtualRobotSettings, by_limits, settings_from
from runtime.simulation.virtual_robot import VirtualLog

DURATION, SPLINES, SPAN = 30.0, 24, 2.4
"""Length of the motion [s], number of its splines, and the range of every joint [rad]."""
TICK_HZ, ENGINE_STEP = 500.0, 1e-3
"""Rate of the controller, and step of the engine [s]."""
SPREAD = 0.04
"""Difference of the true bodies from the URDF."""
GAINS = (13.6, 13.7, 13.7, 9.67, 8.7, 9.0)
"""Torque constant times gear ratio of the cobot's motors [N·m/A]."""
CURRENT_NOISE = 0.02
"""Noise of a motor current [A]."""
WALL = (9.81, 0.0, 0.0)
"""Gravity in the base frame of the arm on the wall [m/s²]."""


@dataclass(frozen=True, slots=True)
class Log:
    """A log of a virtual arm.

    Attributes:
        arrays: the file: t [s], q [rad], dq [rad/s], and tau [N·m] or current [A].
        recipe: of that file; None where the default convention fits.
        simulated: rows at `TICK_HZ`, true states and parameters.
        reference: motion that the controller followed.
        rows: indices of the logged rows, (N,).
    """

    arrays: dict[str, Array]
    recipe: Recipe | None
    simulated: VirtualLog
    reference: Trajectory
    rows: Array


@dataclass(frozen=True, slots=True)
class Arm:
    """A virtual robot with one clean log.

    Attributes:
        lib: library of the robot as it is mounted.
        other_urdf: another robot with as many joints.
        torque: name of the torque array.
        gains: torque per logged unit, (n,).
        log: the clean log.
    """

    lib: Library
    other_urdf: Path
    torque: str
    gains: Array
    log: Log


def motion_of(lib: Library, seed: int) -> Trajectory:
    """Draw a motion of all joints about the home position.

    Args:
        lib: library of the robot.
        seed: of the coefficients.

    Returns:
        The motion; every joint spans `SPAN`, its middle is the home position.
    """
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(lib.n_joints, SPLINES))
    basis = basis_of("bspline")
    drawn = Trajectory(np.zeros(lib.n_joints), waves, DURATION, basis)
    q = drawn.at(lib, np.linspace(0.0, DURATION, 1000))[0]
    low, high = q.min(axis=0), q.max(axis=0)
    scale = SPAN / (high - low)
    home = lib.home - scale * (low + high) / 2
    return replace(drawn, home=home, coefficients=waves * scale[:, None])


def cobot(lib: Library, other_urdf: Path, seed: int = 1, motion_seed: int | None = None) -> Arm:
    """The cobot: currents of geared motors on an irregular clock of 10 and 12 ms.

    Args:
        lib: library of a robot with six joints.
        other_urdf: another such robot.
        seed: of the robot.
        motion_seed: of motion and noise; None is `seed`. Other values are other logs of one robot.

    Returns:
        The robot with its clean log.
    """
    settings = _settings(lib, coulomb=0.04, viscous=0.03, load=0.02)
    drawn = seed if motion_seed is None else motion_seed
    motion = motion_of(lib, drawn)
    log = record(lib, motion, settings, seed=drawn, truth_seed=seed)
    rng = np.random.default_rng([drawn, 1])
    ticks = np.cumsum(rng.choice([5, 6], size=len(log.recording) // 5))
    rows = ticks[ticks < len(log.recording)]
    gains = np.array(GAINS)
    current = log.motion.motor[rows] / gains + CURRENT_NOISE * rng.normal(size=(len(rows), 6))
    arrays = _arrays(log, rows) | {"current": np.round(current, 3)}
    recipe = Recipe(
        time=Time(layout="npz", key="t", unit="s"),
        position=Signal("rad", layout="npz", key="q"),
        velocity=Signal("rad/s", layout="npz", key="dq"),
        torque=Signal("A", layout="npz", key="current", gain=GAINS),
        preparation=Preparation(max_gap_s=0.05, grid_hz=100.0),
    )
    return Arm(lib, other_urdf, "current", gains, Log(arrays, recipe, log, motion, rows))


def wall_arm(lib: Library, other_urdf: Path, seed: int = 2, motion_seed: int | None = None) -> Arm:
    """The arm on a wall: torques behind the gears at 100 Hz.

    Args:
        lib: library of a robot that was built with gravity `WALL`.
        other_urdf: another robot with as many joints.
        seed: of the robot.
        motion_seed: of motion and noise; None is `seed`. Other values are other logs of one robot.

    Returns:
        The robot with its clean log.
    """
    settings = _settings(lib, coulomb=0.01, viscous=0.01, load=0.005)
    drawn = seed if motion_seed is None else motion_seed
    motion = motion_of(lib, drawn)
    log = record(lib, motion, settings, seed=drawn, truth_seed=seed)
    rows = np.arange(0, len(log.recording), round(TICK_HZ / 100.0))
    arrays = _arrays(log, rows) | {"tau": log.recording.required("tau")[rows]}
    ones = np.ones(lib.n_joints)
    return Arm(lib, other_urdf, "tau", ones, Log(arrays, None, log, motion, rows))


def _arrays(log: VirtualLog, rows: Array) -> dict[str, Array]:
    """Clock, positions and velocities of the logged rows."""
    recording = log.recording
    return {"t": recording.t[rows], "q": recording.q[rows], "dq": recording.required("dq")[rows]}


def _settings(lib: Library, coulomb: float, viscous: float, load: float) -> VirtualRobotSettings:
    """Settings with friction as shares of the largest torque."""
    tables = by_limits(lib)
    effort = lib.limits()["effort"]
    tables["inertia"]["spread"] = SPREAD
    tables["friction"] |= {
        "coulomb": coulomb * effort,
        "viscous": viscous * effort / np.maximum(lib.limits()["velocity"], 1.0),
        "load": load,
    }
    tables["drive"] = {"delay_s": 1.0 / TICK_HZ, "step_s": ENGINE_STEP}
    tables["controller"] |= {"rate_hz": TICK_HZ, "stiffness": 1600.0, "damping": 80.0}
    return settings_from(tables, lib)
