"""`symgen excite`."""

from dataclasses import astuple
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from runtime.cli.approach_options import FromPose, Return, session_plan
from runtime.cli.budget import Budget, search_notes
from runtime.cli.certificate_table import LimitValues, design_notes, safety_of, table_height
from runtime.cli.common import Robot, Seed, numbers_option, sentences_of
from runtime.cli.design_defaults import (
    HARMONICS_HELP,
    MARGIN_HELP,
    harmonics_of,
    margin_of,
    require_plain,
)
from runtime.cli.designed_motion import (
    MotionFiles,
    search_progress,
    with_shown_unknowns,
    write_design,
)
from runtime.cli.excite_options import (
    Document,
    Export,
    ExportRate,
    FrictionColumns,
    Home,
    Pictures,
    Processes,
    Scheduler,
    Speed,
)
from runtime.cli.given_options import given_options
from runtime.cli.limit_options import (
    Box,
    Carry,
    Clearance,
    Coulomb,
    FrictionBand,
    ModelBand,
    Obstacles,
    PayloadBand,
    Table,
    TorqueFraction,
    Unchecked,
    Viscous,
)
from runtime.cli.motion_output import ROWS_HZ, files_of, json_path, stage_speeds
from runtime.cli.overwriting import Overwrite
from runtime.cli.planned_noise import NOISE_HELP, WHITE, Cutoff, NoiseModel, counted
from runtime.cli.predict_tables import EarlierLogs, PayloadOnly, information_of
from runtime.cli.robot import Yes, open_robot
from runtime.cli.several_motions import Motions, SeveralFiles, excite_several, require_several
from runtime.cli.static_poses import PoseOptions, Poses, Static, excite_static, require_applicable
from runtime.cli.until import GainError, Until, criterion_and_unknowns, searched, until_kind
from runtime.common.files import require_unused
from runtime.common.threads import cores
from runtime.excitation import BASES, CRITERIA, Design, DesignSettings, basis_of
from runtime.excitation.limits.unchecked import TABLE, require_consent
from runtime.excitation.limits.unchecked import unchecked as unchecked_limits
from runtime.excitation.motion_export import MOTION_FORMATS
from runtime.excitation.search.criteria import criterion_of
from runtime.simulation import sample_times

STARTS_FOR_PROCESSES = {True: 10, False: 4}
"""Least number of starts for which several processes are faster than one, by document mode.

A process takes two seconds to begin, as long as one start with all limits; a start in document mode
takes a third of that.
"""


def excite_command(
    context: typer.Context,
    robot: Robot = "fr3",
    yes: Yes = False,
    duration: Annotated[float, typer.Option(help="Duration t_f of the motion, s.")] = 10.0,
    harmonics: Annotated[int | None, typer.Option(help=HARMONICS_HELP)] = None,
    starts: Annotated[int, typer.Option(help="Number of searches; the best one is kept.")] = 5,
    budget: Budget = None,
    processes: Processes = None,
    scheduler: Scheduler = None,
    export_rate: ExportRate = None,
    seed: Seed = 0,
    static: Static = False,
    poses: Poses = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="JSON of the motion; default results/ROBOT-excite.json."),
    ] = None,
    export: Export = None,
    speed: Speed = None,
    document: Document = False,
    criterion: Annotated[
        str | None,
        typer.Option(help=f"Quantity to minimise; default mixed. {sentences_of(CRITERIA)}."),
    ] = None,
    basis: Annotated[
        str, typer.Option(help=f"Functions of the motion. {sentences_of(BASES)}.")
    ] = "cosine",
    zero_jerk: Annotated[
        bool, typer.Option("--zero-jerk", help="Begin and end with zero jerk too.")
    ] = False,
    noise: Annotated[str, typer.Option(metavar="σ|LOG", help=f"{NOISE_HELP}.")] = "0.05",
    noise_model: NoiseModel = WHITE,
    cutoff: Cutoff = None,
    log_rate: Annotated[
        float, typer.Option(help="Rate at which the robot will record the motion, Hz.")
    ] = 100.0,
    friction: FrictionColumns = None,
    earlier_log: EarlierLogs = None,
    payload_only: PayloadOnly = False,
    home: Home = None,
    table: Table = None,
    unchecked: Unchecked = None,
    box: Box = None,
    clearance: Clearance = None,
    carry: Carry = None,
    obstacles: Obstacles = None,
    from_pose: FromPose = None,
    returns: Return = False,
    torque_fraction: TorqueFraction = 0.95,
    margin: Annotated[float | None, typer.Option(help=MARGIN_HELP)] = None,
    viscous: Viscous = None,
    coulomb: Coulomb = None,
    payload_band: PayloadBand = None,
    friction_band: FrictionBand = None,
    model_band: ModelBand = None,
    pictures: Pictures = False,
    until: Until = None,
    motions: Motions = 1,
    gain_error: GainError = 0.005,
    overwrite: Overwrite = False,
) -> None:
    r"""Design an excitation motion within all limits of a robot.

    \b
    symgen excite --robot fr3 --duration 10 --starts 10
    symgen excite --home 0,-0.785,0,-2.356,0,1.571,0.785 --table 0 --box 0.2,0.8,-0.5,0.5,0.1,1.0
    symgen excite --export libfranka --speed 10 --speed 50 --speed 100
    symgen excite --carry 1.8,0,0,0.1,0.1,0.1,0.2
    symgen excite --table 0 --obstacles cell.toml --from last.npz --return --export ros
    symgen excite --motions 4 --duration 40 --noise last.npz --noise-model coloured --cutoff 10
    symgen excite --static --poses 12 --table 0
    symgen excite --until "payload 5 g" --from home --return --table 0

    The motion makes the base parameters identifiable with the least error (--criterion). It
    respects every limit that the robot states: position, velocity (lower near the ends of the
    range), acceleration, torque and its rate, speed of the tip, distances between links; with
    --table, --box and --obstacles also those. --from adds the way from the present pose to the
    start under the same limits, --return the way back.

    Printed are all criteria with the standard deviations that a log will give, without and with
    friction (viscous, Coulomb, offset) as further unknowns; then the certificate: the largest use
    of every limit over continuous time, not only at the samples, and what was NOT checked.

    Written: the motion as JSON, and sampled as CSV or in the formats of --export. Ctrl-C keeps
    the best start so far. The result depends on --seed, not on --processes.
    """
    require_applicable(context, static)
    require_several(context, motions)
    lib = open_robot(robot, yes)
    height, has_no_table = table_height(table)
    limits = LimitValues(
        torque_fraction,
        clearance=clearance,
        table=height,
        box=box,
        viscous=viscous,
        coulomb=coulomb,
        carry=carry,
        obstacles=obstacles,
        payload_band=payload_band,
        friction_band=friction_band,
        model_band=model_band,
    )
    fraction = given_options(context).get("torque_fraction")  # its default is a number
    require_plain(document, (fraction, *astuple(limits)[1:], from_pose))
    safety = None if document else safety_of(lib, limits)
    if static and safety is not None:
        kept = PoseOptions(poses, out, noise, margin, starts, seed, has_no_table, overwrite)
        excite_static(lib, safety, kept)
        return
    path = json_path(out or Path("results") / f"{lib.name}-excite.json")
    kind = until_kind(context, until)
    wanted, alone = criterion_and_unknowns(criterion, document, payload_only, kind)
    planned, note = information_of(
        lib, noise, log_rate, earlier_log, alone, friction, noise_model, cutoff
    )
    is_informed = criterion_of(wanted).needs_information or bool(earlier_log) or alone
    rate = ROWS_HZ if export_rate is None else export_rate
    sample_times(duration, rate)  # before the search: they may be too many
    formats = [MOTION_FORMATS[name].name for name in export or []]  # before it, too
    rest = None if home is None else np.array(numbers_option(home, lib.n_joints, "--home"))
    accepted = [*(unchecked or ()), *([TABLE] if has_no_table else [])]
    if formats:
        require_consent(unchecked_limits(lib, safety), accepted)  # before the search, too
    side_by_side = cores() if starts >= STARTS_FOR_PROCESSES[document] else 1
    used = margin_of(margin, bool(formats))
    speeds = stage_speeds(duration, speed or [100.0])
    chosen = DesignSettings(
        duration=duration,
        harmonics=harmonics_of(harmonics, document),
        starts=starts,
        seed=seed,
        criterion=wanted,
        basis=basis_of(basis, zero_jerk),
        information=counted(planned, wanted, is_informed),
        safety=safety,
        home=rest,
        margin=used,
    )
    chosen, planned = with_shown_unknowns(lib, chosen, planned)
    if motions > 1:
        excite_several(
            lib,
            motions,
            chosen,
            planned,
            SeveralFiles(path, rate, speeds, overwrite),
            budget=budget,
            processes=processes if processes is not None else side_by_side,
            scheduler=scheduler,
        )
        return
    require_unused(files_of(path, formats, speed or [100.0], pictures), overwrite)
    ways = session_plan(lib, from_pose, returns, rest, safety, used, zero_jerk, seed)
    with search_progress(wanted, starts) as report:
        optimum, promise, promised = searched(
            lib,
            until,
            chosen,
            ways,
            planned,
            gain_error,
            progress=report,
            budget=budget,
            processes=processes if processes is not None else side_by_side,
            scheduler=scheduler,
        )

    def sentences(best: Design) -> tuple[str, ...]:
        return (
            *search_notes(best, budget, starts),
            *(() if until else design_notes(lib, duration, best.trajectory.duration)),
            *ways.sentences(best.trajectory),
            *promised,
        )

    files = MotionFiles(path, rate, formats, export_rate, speeds, pictures, accepted)
    write_design(
        lib,
        optimum,
        planned,
        ways,
        files,
        promise=promise,
        note=note,
        sentences=sentences,
        margin=used,
    )
