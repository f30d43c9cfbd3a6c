"""`python -m runtime excite`."""

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import Progress
from rich.table import Table

from runtime.certificate import Certificate, certificate, pulled_inside, require_speed, slowed
from runtime.cli.common import Robot, Seed, console, say
from runtime.cli.prediction import information_of, tell
from runtime.errors import RuntimeFault
from runtime.excitation import BASES, CRITERIA, basis_of, design, predict
from runtime.library import load
from runtime.recording import Recording, write_recording
from runtime.simulation import sample_times
from runtime.threads import cores
from runtime.trajectory_export import export_trajectory, require_proof
from runtime.trajectory_file import write_trajectory

WORTH_PROCESSES = 10
"""Starts from which on more processes, which take two seconds to begin, end earlier."""


class Export(StrEnum):
    """Kinds of files, see `runtime.trajectory_export`."""

    csv = "csv"
    npz = "npz"
    ros = "ros"
    libfranka = "libfranka"


def excite_command(
    robot: Robot = "fr3",
    duration: Annotated[float, typer.Option(help="t_f, s.")] = 10.0,
    harmonics: Annotated[
        int, typer.Option(help="M: cosines, cosines and sines, or splines per joint.")
    ] = 5,
    starts: Annotated[int, typer.Option(help="Searches from random starts.")] = 5,
    processes: Annotated[
        int | None,
        typer.Option(
            help="Searching side by side; default: one per core, for less than ten starts 1."
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="Rate of csv, npz and ros, Hz.")] = 1000.0,
    seed: Seed = 0,
    out: Annotated[
        Path | None, typer.Option(help="JSON of the trajectory; default results/ROBOT-excite.json")
    ] = None,
    export: Annotated[
        list[Export] | None,
        typer.Option(
            help="Files for a robot, only if the certificate holds; repeatable. csv, npz: t, q, "
            "dq, ddq; ros: a JointTrajectory of ROS 2; libfranka: one row per ms."
        ),
    ] = None,
    speed: Annotated[
        list[float] | None,
        typer.Option(
            help="Percent of the designed speed, same path; repeatable: 10, 50, 100 are three "
            "stages to try on a robot, each checked anew. The file names end in -speed10."
        ),
    ] = None,
    document: Annotated[
        bool, typer.Option("--document", help="The document's problem: --criterion cond.")
    ] = False,
    criterion: Annotated[
        str | None,
        typer.Option(
            help=f"{' | '.join(CRITERIA)}: expected error of torque on other motions (v), of "
            "parameters (a), their confidence volume (d), the condition number, or v and cond "
            "together; default mixed."
        ),
    ] = None,
    basis: Annotated[str, typer.Option(help=" | ".join(BASES))] = "cosine",
    zero_jerk: Annotated[
        bool, typer.Option("--zero-jerk", help="Begin and end without jerk, too.")
    ] = False,
    noise: Annotated[
        str, typer.Option(metavar="σ", help="Torque noise, N·m: one number or one per joint.")
    ] = "0.05",
    log_rate: Annotated[float, typer.Option(help="Rate at which the robot will log, Hz.")] = 100.0,
    prior: Annotated[
        list[str] | None,
        typer.Option(metavar="LOG", help="What this log tells counts already; repeatable."),
    ] = None,
    payload: Annotated[
        bool,
        typer.Option(
            "--payload", help="Only the last link's ten parameters are unknown, the arm is known."
        ),
    ] = False,
    plot: Annotated[
        bool,
        typer.Option(
            "--plot", help="Draw every joint's motion and use of limits: PNG beside the JSON."
        ),
    ] = False,
) -> None:
    r"""Design a trajectory that makes the base parameters visible (Eqs. 3.24–3.29).

    All criteria of the motion are told, for the unknowns alone and with friction (viscous,
    Coulomb, offset) estimated beside them, with the errors to be expected of a log.
    The certificate proves for every instant, between samples too, that position (as a share of
    the way from home to its limit), velocity, acceleration and jerk keep the robot's limits;
    torque and collision are NOT checked yet, so look at the motion in a simulator before sending
    it to a robot.
    Ctrl-C keeps the best start so far; the result depends on the seed, not on the processes.

    \b
    python -m runtime excite --robot fr3 --duration 10 --starts 10
    python -m runtime excite --export libfranka --speed 10 --speed 50 --speed 100
    """
    lib = load(robot)
    path = out or Path("results") / f"{lib.name}-excite.json"
    if path.suffix != ".json":
        raise RuntimeFault(
            f"the trajectory needs a file that ends in .json, got '{path}'; "
            "its motion is written beside it as .csv"
        )
    wanted = criterion or ("cond" if document else "mixed")
    told = information_of(lib, noise, log_rate, prior, payload)
    # The document's criterion knows only the regressor.
    known = None if wanted == "cond" and not prior and not payload else told
    t = sample_times(duration, rate)
    side_by_side = cores() if starts >= WORTH_PROCESSES else 1
    speeds = [require_speed(percent / 100) for percent in speed or [100.0]]
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("excitation", total=starts)

        def report(done: int, value: float, best: float) -> None:
            text = f"{done} starts: {wanted} {value:.4g}, best {best:.4g}"
            progress.update(task, completed=done, description=text)

        found = design(
            lib,
            duration,
            harmonics,
            starts,
            seed,
            progress=report,
            processes=processes if processes is not None else side_by_side,
            criterion=wanted,
            basis=basis_of(basis, zero_jerk),
            information=known,
        )
    found = replace(found, trajectory=pulled_inside(lib, found.trajectory))
    expected = predict(lib, found.trajectory, told)
    write_trajectory(found, lib, path, expected)
    q, dq, ddq, _ = found.trajectory.at(lib, t)
    written = [path]
    if not export:
        sentence = f"Designed by symgen, condition number {found.condition:.4f}."
        table = path.with_suffix(".csv")
        names = lib.joint_names
        log = Recording(t, q, dq, ddq, name=table.stem, joint_names=names, history=(sentence,))
        write_recording(log, table)
        written.append(table)
    if plot:
        from runtime.report.trajectory import write_picture  # matplotlib loads slowly

        picture = path.with_suffix(".png")
        write_picture(lib, found.trajectory, picture)
        written.append(picture)
    tell(found, expected, len(lib.base_columns))
    effort = lib.limits()["effort"]
    torque = np.abs(lib.inverse_dynamics(q, dq, ddq, lib.pi0)).max(axis=0) / effort
    worst = int(np.argmax(torque))
    say(f"torque by the URDF: at most {100 * torque[worst]:.0f} % on {lib.joint_names[worst]}")
    stages = {100 * share: slowed(found.trajectory, share) for share in speeds}
    for percent, stage in stages.items():
        console.print(certificate_table(certificate(lib, stage), percent))
    say(f"trajectory: {', '.join(map(str, written))}")
    if export:
        for stage in stages.values():  # all of them before the first file
            require_proof(certificate(lib, stage))
        for percent, stage in stages.items():
            base = path.with_suffix("")
            if percent != 100:
                base = base.with_name(f"{base.name}-speed{percent:g}")
            files = [export_trajectory(lib, stage, base, kind.value, rate) for kind in export]
            say(f"exported: {', '.join(map(str, files))}, {base}.certificate.json")


def certificate_table(proof: Certificate, percent: float) -> Table:
    """The largest proven use of every limit, with joint and time."""
    verdict = "holds at every instant" if proof.holds else "does NOT hold"
    table = Table("limit", title=f"certificate at {percent:g} % speed: {verdict}")
    for head in ("largest use %", "margin %"):
        table.add_column(head, justify="right")
    table.add_column("joint")
    table.add_column("time s", justify="right")
    for use in proof.uses:
        # Rounded upwards: 100.00 is never what is left of 100.004.
        bound = np.ceil(1e4 * use.bound - 1e-6) / 100
        margin = f"{100 - bound:.2f}"
        table.add_row(use.kind, f"{bound:.2f}", margin, use.joint, f"{use.time:.3f}")
    for missing in proof.unlimited:
        table.add_row(missing, "no limit stated", "", "", "")
    return table
