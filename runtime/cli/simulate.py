"""`symgen simulate`."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from rich.progress import Progress

from runtime import simulation
from runtime.cli.common import Overwrite, RobotChoices, Seed, open_robot
from runtime.common.files import require_unused, write_json
from runtime.common.settings import (
    data_field,
    method_field,
    model_field,
    output_field,
    settings_place,
)
from runtime.common.terminal import console, say
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import read_trajectory, write_motion
from runtime.excitation.search.design import design
from runtime.library import Library
from runtime.recording import Recording, write_recording
from runtime.simulation.closed_loop import perturbed_lam, write_controller
from runtime.simulation.plant import require_no_springs


class Engine(StrEnum):
    """Simulator of the robot."""

    compiled = "compiled"
    mujoco = "mujoco"


_ONLY_COMPILED = (
    *("exact", "perturb", "control_rate", "torque_noise", "position_noise", "velocity_noise"),
    *("viscous", "coulomb", "rotor"),
)
_ONLY_MUJOCO = ("payload", "virtual_robot", "truth_seed")

LEAST_ROWS = 2  # least number of samples that have a rate
BESIDE = ".truth.json", ".motion.json", ".loop.toml"
"""Suffixes of the files beside a log: true parameters, reference motion, controller."""
# Controller, rotors [kg·m²] and rate [Hz] of a log.
Loop = tuple[simulation.Controller, ArrayLike, float]
Made = tuple[Recording, dict[str, Any], Loop | None]  # log, true parameters, closed loop


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateSettings(RobotChoices):
    """Settings of `symgen simulate`."""

    options = "robot trajectory out engine seed payload exact overwrite"
    trajectory: Path | None = data_field(
        metavar="FILE", help="Motion written by excite; default a design with one start."
    )
    out: Path | None = output_field(
        metavar="FILE", help="Log as CSV or NPZ; default results/ROBOT-simulated.csv."
    )
    engine: Engine | None = method_field(
        help="compiled: compiled dynamics, linear friction, white noise. mujoco: effects of a "
        "real robot, see above; default with a payload, virtual_robot or truth_seed."
    )
    keep_every: int = method_field(1, help="Record every n-th sample only.", min=1)
    seed: Seed = 0
    payload: str | None = model_field(
        metavar="MASS,CX,CY,CZ[,LX,LY,LZ]",
        help="mujoco: a box as payload, in kg and m in the frame of the last link; or a TOML file.",
    )
    virtual_robot: Path | None = method_field(
        metavar="FILE",
        help="mujoco: TOML whose entries replace those of the robot: friction, sensors, delay.",
    )
    truth_seed: int = method_field(
        0, help="mujoco: seed of the true robot; --seed is that of the noise.", min=0, max=2**63 - 1
    )
    exact: bool = method_field(
        False, "--ideal", help="Follow the trajectory exactly, without a controller."
    )
    perturb: float = model_field(
        0.05, help="Fraction by which each λ of the URDF differs in the true robot."
    )
    control_rate: float | None = method_field(
        help="Rate of the controller and of the rows before the setting keep_every, Hz; "
        "default 1000, with --ideal 100."
    )
    torque_noise: float = model_field(
        0.05, help="Standard deviation of the torque noise, N·m or N."
    )
    position_noise: float = model_field(
        1e-5, help="Standard deviation of the position noise, rad or m."
    )
    velocity_noise: float = model_field(
        1e-3, help="Standard deviation of the velocity noise, rad/s or m/s."
    )
    viscous: float = model_field(0.0, help="Viscous friction of every joint, N·m·s/rad or N·s/m.")
    coulomb: float = model_field(0.0, help="Coulomb friction of every joint, N·m or N.")
    rotor: float = model_field(0.1, help="Motor inertia reflected to the joint, kg·m² or kg.")
    overwrite: Overwrite = False


def simulate_command(given: SimulateSettings) -> None:
    r"""Simulate the log of a robot with known parameters.

    \b
    symgen simulate --robot fr3 --settings coulomb=0.3 --out results/sim.csv
    symgen simulate --robot my --ideal --settings torque_noise=0
    symgen simulate --robot fr3 --engine mujoco --seed 1 --out results/empty.csv
    symgen simulate --robot fr3 --payload 1.8,0.01,0.02,0.167,0.1,0.08,0.1

    With --engine mujoco the log has the effects of a real robot: parameters that differ from the
    model within manufacturing tolerances, friction with memory, quantised sensors with bias, and a
    controller whose torque arrives late.

    The true parameters are written beside the log as NAME.truth.json, the controller as
    NAME.loop.toml and its reference motion as NAME.motion.json.
    """
    virtual = _is_virtual(given)
    lib = open_robot(given.robot, given.yes)
    if not (virtual or given.exact):
        require_no_springs(lib)
    path = given.out or Path("results") / f"{lib.name}-simulated.csv"
    require_unused([path, *map(path.with_suffix, BESIDE), settings_place(path)], given.overwrite)
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("designing a trajectory", total=1.0)
        if given.trajectory:
            motion = read_trajectory(given.trajectory, lib)
        else:
            motion = design(lib, starts=1, seed=given.seed).trajectory
        progress.update(task, description="simulating")

        def report(part: float) -> None:
            progress.update(task, completed=part)

        made = (_virtual if virtual else _compiled)(lib, motion, given, report)
    _write(lib, motion, made, path, given.keep_every)
    given.write(path)


def _is_virtual(given: SimulateSettings) -> bool:
    stated = given.stated()
    for_mujoco = any(name in stated for name in _ONLY_MUJOCO)
    virtual = for_mujoco if given.engine is None else given.engine is Engine.mujoco
    foreign = [name for name in (_ONLY_COMPILED if virtual else _ONLY_MUJOCO) if name in stated]
    if foreign:
        named = ", ".join(stated[name] for name in foreign)
        used, other = ("mujoco", "compiled") if virtual else ("compiled", "mujoco")
        raise IdentificationError(
            f"{named} belongs to the engine '{other}', not to '{used}'; leave it out, or "
            f"give --engine {other}"
        )
    return virtual


def _virtual(
    lib: Library, motion: Trajectory, given: SimulateSettings, report: Callable[[float], None]
) -> Made:
    settings = simulation.settings_of(lib, given.virtual_robot)
    box = None if given.payload is None else simulation.read_payload(given.payload)
    seeds = given.values("seed", "truth_seed")
    log = simulation.record(lib, motion, settings, **seeds, payload=box, progress=report)
    controller = simulation.Controller(stiffness=settings.stiffness, damping=settings.damping)
    known = controller, settings.rotor, settings.rate_hz
    is_known = settings.law == "computed_torque"
    return log.recording, log.truth.facts(lib), known if is_known else None


def _compiled(
    lib: Library, motion: Trajectory, given: SimulateSettings, report: Callable[[float], None]
) -> Made:
    rng = np.random.default_rng(given.seed)
    lam = perturbed_lam(lib, given.perturb, rng)
    pi = lib.pi_from_lam(lam)
    parts = given.values("viscous", "coulomb", "rotor")
    noise = given.values("position_noise", "velocity_noise", "torque_noise")
    plant = simulation.Plant(pi, **parts, **noise)
    usual = 100.0 if given.exact else 1000.0
    rate = usual if given.control_rate is None else given.control_rate
    truth = {
        "robot": lib.name,
        "seed": given.seed,
        "perturb": given.perturb,
        "pi": pi.tolist(),
        "lam": lam.tolist(),
        **parts,
        "coulomb_speed": plant.coulomb_speed,
    }
    if given.exact:
        return simulation.ideal(lib, motion, plant, rate, rng), truth, None
    recording = simulation.closed_loop(lib, motion, plant, rng, rate, report)
    return recording, truth, (simulation.Controller(), parts["rotor"], rate)


def _write(lib: Library, motion: Trajectory, made: Made, path: Path, keep_every: int) -> None:
    recording, facts, loop = made
    if keep_every > 1:
        rows = np.arange(0, len(recording), keep_every)
        if len(rows) < LEAST_ROWS:
            raise IdentificationError(
                f"the setting keep_every={keep_every} leaves {len(rows)} of {len(recording)} "
                f"samples, expected {LEAST_ROWS} or more; give a smaller number"
            )
        recording = recording.take(rows, f"Kept every {keep_every}. sample.")
    write_recording(recording, path)
    truth, reference, controller = map(path.with_suffix, BESIDE)
    if loop is not None:
        write_motion(motion, lib, reference)
        write_controller(controller, reference.name, *loop)
        facts["motion_sha256"] = hashlib.sha256(reference.read_bytes()).hexdigest()
    facts["log_sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    write_json(truth, facts)
    say(f"recording: {path} ({len(recording)} samples at {recording.rate_hz:g} Hz)")
    say(f"truth:     {truth}")
    if loop is not None:
        say(f"loop:      {controller}")
