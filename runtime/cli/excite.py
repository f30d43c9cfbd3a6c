"""`python -m runtime excite`."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import Progress

from runtime.cli.common import Robot, Seed, console, say
from runtime.errors import RuntimeFault
from runtime.excitation import COST_SAMPLES, design
from runtime.library import load
from runtime.recording import Recording, write_recording
from runtime.simulation import sample_times
from runtime.threads import cores
from runtime.trajectory_file import write_trajectory

WORTH_PROCESSES = 10
"""Starts from which on more processes, which take two seconds to begin, end earlier."""


def excite_command(
    robot: Robot = "fr3",
    duration: Annotated[float, typer.Option(help="t_f, s.")] = 10.0,
    harmonics: Annotated[int, typer.Option(help="M, cosines per joint.")] = 5,
    starts: Annotated[int, typer.Option(help="Searches from random starts.")] = 5,
    processes: Annotated[
        int | None,
        typer.Option(
            help="Searching side by side; default: one per core, for less than ten starts 1."
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="Rate of the CSV, Hz.")] = 1000.0,
    seed: Seed = 0,
    out: Annotated[
        Path | None, typer.Option(help="JSON of the trajectory; default results/ROBOT-excite.json")
    ] = None,
) -> None:
    r"""Design a trajectory that makes the base parameters visible (Eqs. 3.24–3.29).

    Position, velocity and acceleration limits are kept at 1 kHz; torque and collision are NOT
    checked yet, so look at the motion in a simulator before sending it to a robot.
    Ctrl-C keeps the best start so far; the result depends on the seed, not on the processes.

    \b
    python -m runtime excite --robot fr3 --duration 10 --starts 10
    """
    lib = load(robot)
    path = out or Path("results") / f"{lib.name}-excite.json"
    if path.suffix != ".json":
        raise RuntimeFault(
            f"the trajectory needs a file that ends in .json, got '{path}'; "
            "its motion is written beside it as .csv"
        )
    t = sample_times(duration, rate)
    side_by_side = cores() if starts >= WORTH_PROCESSES else 1
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("excitation", total=starts)

        def report(done: int, condition: float, best: float) -> None:
            text = f"{done} starts: cond {condition:.3f}, best {best:.3f}"
            progress.update(task, completed=done, description=text)

        found = design(
            lib,
            duration,
            harmonics,
            starts,
            seed,
            progress=report,
            processes=processes if processes is not None else side_by_side,
        )
    write_trajectory(found, lib, path)
    q, dq, ddq, _ = found.trajectory.at(lib, t)
    sentence = f"Designed by symgen, condition number {found.condition:.4f}."
    table = path.with_suffix(".csv")
    write_recording(
        Recording(t, q, dq, ddq, name=table.stem, joint_names=lib.joint_names, history=(sentence,)),
        table,
    )
    spread = np.array(found.conditions)
    say(
        f"condition number {found.condition:.4f} of the column-normalised base regressor "
        f"({len(lib.base_columns)} columns, {COST_SAMPLES} samples)"
    )
    say(
        f"starts: best {spread.min():.3f}, median {np.median(spread):.3f}, worst {spread.max():.3f}"
    )
    say("use of limits: " + ", ".join(f"{kind} {100 * x:.1f} %" for kind, x in found.use.items()))
    for assumption in found.assumptions:
        say(f"note: {assumption}")
    effort = lib.limits()["effort"]
    torque = np.abs(lib.inverse_dynamics(q, dq, ddq, lib.pi0)).max(axis=0) / effort
    worst = int(np.argmax(torque))
    say(f"torque by the URDF: at most {100 * torque[worst]:.0f} % on {lib.joint_names[worst]}")
    say(f"trajectory: {path}, {table}")
