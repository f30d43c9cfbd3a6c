"""`python -m runtime simulate`."""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import Progress

from runtime.atomic import replacing
from runtime.cli.common import Robot, Seed, console, say
from runtime.excitation import design
from runtime.library import load
from runtime.loop import Loop, write_loop
from runtime.recording import write_recording
from runtime.simulation import Controller, Plant, closed_loop, ideal, perturbed_lam
from runtime.trajectory_file import read_trajectory, write_motion


def simulate_command(
    robot: Robot = "fr3",
    trajectory: Annotated[
        Path | None, typer.Option(help="JSON of excite; default: one quick design.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="CSV or NPZ; default results/ROBOT-simulated.csv")
    ] = None,
    exact: Annotated[
        bool,
        typer.Option("--ideal", help="Exact motion along the trajectory instead of closed loop."),
    ] = False,
    perturb: Annotated[
        float, typer.Option(help="True robot: each lambda of the URDF changed by this fraction.")
    ] = 0.05,
    rate: Annotated[float | None, typer.Option(help="Hz; default 1000, with --ideal 100.")] = None,
    keep_every: Annotated[int, typer.Option(help="Log every n-th sample only.", min=1)] = 1,
    torque_noise: Annotated[float, typer.Option(help="Standard deviation, N·m.")] = 0.05,
    position_noise: Annotated[float, typer.Option(help="Standard deviation, rad.")] = 1e-5,
    velocity_noise: Annotated[float, typer.Option(help="Standard deviation, rad/s.")] = 1e-3,
    viscous: Annotated[float, typer.Option(help="Friction of every joint, N·m·s/rad.")] = 0.0,
    coulomb: Annotated[float, typer.Option(help="Friction of every joint, N·m.")] = 0.0,
    rotor: Annotated[float, typer.Option(help="Reflected motor inertia, kg·m².")] = 0.1,
    seed: Seed = 0,
) -> None:
    r"""Record a robot whose parameters are known, to try methods on.

    The true parameters are written beside the recording as NAME.truth.json, the controller and
    the motion it was asked for as NAME.loop.toml and NAME.motion.json.

    \b
    python -m runtime simulate --robot fr3 --coulomb 0.3 --out results/sim.csv
    python -m runtime simulate --robot my --ideal --torque-noise 0
    """
    lib = load(robot)
    rng = np.random.default_rng(seed)
    lam = perturbed_lam(lib, perturb, rng)
    pi = lib.pi_from_lam(lam)
    plant = Plant(
        pi,
        viscous=viscous,
        coulomb=coulomb,
        rotor=rotor,
        position_noise=position_noise,
        velocity_noise=velocity_noise,
        torque_noise=torque_noise,
    )
    path = out or Path("results") / f"{lib.name}-simulated.csv"
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("designing a trajectory", total=1.0)
        motion = (
            read_trajectory(trajectory, lib)
            if trajectory
            else design(lib, starts=1, seed=seed).trajectory
        )
        progress.update(task, description="simulating")
        if exact:
            recording = ideal(lib, motion, plant, 100.0 if rate is None else rate, rng)
        else:
            recording = closed_loop(
                lib,
                motion,
                plant,
                rng,
                1000.0 if rate is None else rate,
                lambda x: progress.update(task, completed=x),
            )
    if keep_every > 1:
        rows = np.arange(0, len(recording), keep_every)
        recording = recording.take(rows, f"Kept every {keep_every}. sample.")
    write_recording(recording, path)
    if not exact:
        reference = path.with_suffix(".motion.json")
        write_motion(motion, lib, reference)
        used = Loop(motion, Controller(), rotor, 1000.0 if rate is None else rate)
        write_loop(used, reference.name, path.with_suffix(".loop.toml"))
    truth = path.with_suffix(".truth.json")
    facts = {
        "robot": lib.name,
        "seed": seed,
        "perturb": perturb,
        "pi": pi.tolist(),
        "lam": lam.tolist(),
        "viscous": viscous,
        "coulomb": coulomb,
        "rotor": rotor,
        "coulomb_speed": plant.coulomb_speed,
    }
    with replacing(truth) as file:
        file.write((json.dumps(facts, indent=1) + "\n").encode())
    say(f"recording: {path} ({len(recording)} samples at {recording.rate_hz:g} Hz)")
    say(f"truth:     {truth}")
    if not exact:
        say(f"loop:      {path.with_suffix('.loop.toml')}")
