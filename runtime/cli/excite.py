"""`symgen excite`."""

from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from runtime.cli.approach import FromPose, Return, session_plan
from runtime.cli.common import (
    Overwrite,
    Robot,
    Seed,
    Yes,
    numbers_option,
    open_robot,
    sentences_of,
)
from runtime.cli.designed_motion import (
    Budget,
    GainError,
    MotionFiles,
    Motions,
    SeveralFiles,
    Until,
    criterion_and_unknowns,
    design_notes,
    excite_several,
    require_several,
    search_notes,
    search_progress,
    searched,
    until_kind,
    with_shown_unknowns,
    write_design,
)
from runtime.cli.motion_limits import (
    Box,
    Carry,
    Clearance,
    Coulomb,
    FrictionBand,
    LimitValues,
    ModelBand,
    Obstacles,
    PayloadBand,
    Table,
    TorqueFraction,
    Unchecked,
    Viscous,
    safety_of,
    table_height,
)
from runtime.cli.motion_output import (
    CONSENT,
    EXPORT_MARGIN,
    ROWS_HZ,
    files_of,
    json_path,
    stage_speeds,
)
from runtime.cli.planned_log import (
    NOISE_HELP,
    WHITE,
    Cutoff,
    EarlierLogs,
    NoiseModel,
    PayloadOnly,
    counted,
    information_of,
)
from runtime.cli.static_poses import PoseOptions, Poses, Static, excite_static, require_applicable
from runtime.common.files import require_unused
from runtime.common.settings import Choices
from runtime.common.terminal import completing
from runtime.common.threads import cores
from runtime.errors import RuntimeFault
from runtime.excitation.limits.safety import TABLE, require_consent
from runtime.excitation.limits.safety import unchecked as unchecked_limits
from runtime.excitation.motion.trajectory import BASES, basis_of
from runtime.excitation.motion_export import MOTION_FORMATS
from runtime.excitation.search.criteria import CRITERIA, criterion_of
from runtime.excitation.search.design import Design
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import FRICTION
from runtime.recording.friction import COLUMNS
from runtime.simulation import sample_times

Processes = Annotated[
    int | None,
    typer.Option(
        help="Number of parallel processes; default one per core, 1 for few starts (fewer than "
        "4, with --settings document=true 10)."
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="tcp://HOST:PORT",
        help="Search on the workers of this dask cluster instead (pip install "
        "'symgen\\[cluster]'). Each worker loads the robot's folder, so it needs the same file "
        "system.",
    ),
]
ExportRate = Annotated[
    float | None,
    typer.Option(
        help="Rate of the rows of files, Hz; default 1000, for ros 25. libfranka has 1000 Hz "
        "always."
    ),
]
Export = Annotated[
    list[str] | None,
    typer.Option(
        metavar="FORMAT",
        autocompletion=completing(MOTION_FORMATS),
        help="Files for a robot, written only if the certificate holds; repeatable. "
        f"{sentences_of(MOTION_FORMATS)}.",
    ),
]
Speed = Annotated[
    list[float] | None,
    typer.Option(
        help="Speed of a stage in % of the designed speed, on the same path; "
        "repeatable, each with its own certificate: 10, 50 and 100 are three stages to try on "
        "a robot. File names end in -speed10. Default 100."
    ),
]
Document = Annotated[
    bool,
    typer.Option(
        "--document",
        help="Problem of the document: criterion cond, limits of position, velocity and "
        "acceleration only. Such a motion can hit the table that an FR3 stands on.",
    ),
]
FrictionColumns = Annotated[
    str | None,
    typer.Option(
        metavar="COLUMNS",
        autocompletion=completing(COLUMNS),
        help="Friction columns that are estimated too, with commas, or none; default "
        f"{','.join(FRICTION)}, with --settings payload_only=true offset. All criteria but the "
        f"document's "
        "cond count them.",
    ),
]
Home = Annotated[
    str | None,
    typer.Option(
        metavar="Q",
        help="Start and end position, one number per joint with commas, rad or m; default the "
        "home of the robot.",
    ),
]
Pictures = Annotated[
    bool,
    typer.Option(
        "--pictures",
        help="Write PNG files beside the JSON: motion and torque of every joint with limits, "
        "velocity over position (-speed), path of the tip and distances (-space).",
    ),
]
HARMONICS = 8
"""Default number of harmonics: logs of virtual arms give smaller errors than with 5, and the same
as with 10 (`scripts/bench_excitation --designs`)."""
DOCUMENT_HARMONICS = DesignSettings().harmonics
"""That of the document's problem."""
HARMONICS_HELP = (
    f"Number M of harmonics or splines per joint; default {HARMONICS}, with --settings "
    f"document=true "
    f"{DOCUMENT_HARMONICS}."
)
MARGIN_HELP = (
    "Share of every limit that the motion may use, 0 to 1; distances and the box have margins in "
    f"m. Default {EXPORT_MARGIN:g} with --export, which leaves the rest to the robot's controller, "
    "else 1."
)
STARTS_FOR_PROCESSES = {True: 10, False: 4}
"""Least number of starts for which several processes are faster than one, by document mode.

A process takes two seconds to begin, as long as one start with all limits; a start in document mode
takes a third of that.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExciteSettings(Choices):
    """Settings of `symgen excite`."""

    command = "excite"
    options = (
        "robot duration budget criterion noise table box obstacles carry from_pose returns "
        "until export speed out"
    )
    robot: Robot = "fr3"
    yes: Yes = False
    duration: Annotated[float, typer.Option(help="Duration t_f of the motion, s.")] = 10.0
    harmonics: Annotated[int | None, typer.Option(help=HARMONICS_HELP)] = None
    starts: Annotated[int, typer.Option(help="Number of searches; the best one is kept.")] = 5
    budget: Budget = None
    processes: Processes = None
    scheduler: Scheduler = None
    export_rate: ExportRate = None
    seed: Seed = 0
    static: Static = False
    poses: Poses = None
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="JSON of the motion; default results/ROBOT-excite.json."),
    ] = None
    export: Export = None
    speed: Speed = None
    document: Document = False
    criterion: Annotated[
        str | None,
        typer.Option(
            autocompletion=completing(CRITERIA),
            help=f"Quantity to minimise; default mixed. {sentences_of(CRITERIA)}.",
        ),
    ] = None
    basis: Annotated[
        str,
        typer.Option(
            autocompletion=completing(BASES),
            help=f"Functions of the motion. {sentences_of(BASES)}.",
        ),
    ] = "cosine"
    zero_jerk: Annotated[
        bool, typer.Option("--zero-jerk", help="Begin and end with zero jerk too.")
    ] = False
    noise: Annotated[str, typer.Option(metavar="σ|LOG", help=f"{NOISE_HELP}.")] = "0.05"
    noise_model: NoiseModel = WHITE
    cutoff: Cutoff = None
    log_rate: Annotated[
        float, typer.Option(help="Rate at which the robot will record the motion, Hz.")
    ] = 100.0
    friction: FrictionColumns = None
    earlier_log: EarlierLogs = None
    payload_only: PayloadOnly = False
    home: Home = None
    table: Table = None
    unchecked: Unchecked = None
    box: Box = None
    clearance: Clearance = None
    carry: Carry = None
    obstacles: Obstacles = None
    from_pose: FromPose = None
    returns: Return = False
    torque_fraction: TorqueFraction = 0.95
    margin: Annotated[float | None, typer.Option(help=MARGIN_HELP)] = None
    viscous: Viscous = None
    coulomb: Coulomb = None
    payload_band: PayloadBand = None
    friction_band: FrictionBand = None
    model_band: ModelBand = None
    pictures: Pictures = False
    until: Until = None
    motions: Motions = 1
    gain_error: GainError = 0.005
    overwrite: Overwrite = False


def excite_command(given: ExciteSettings) -> None:
    r"""Design an excitation motion within all limits of a robot.

    \b
    symgen excite --robot fr3 --duration 10 --settings starts=10
    symgen excite --settings home=0,-0.79,0,-2.36,0,1.57,0.79 --table 0 --box 0.2,0.8,-0.5,0.5,0.1,1
    symgen excite --export libfranka --speed 10 --speed 50 --speed 100
    symgen excite --carry 1.8,0,0,0.1,0.1,0.1,0.2
    symgen excite --table 0 --obstacles cell.toml --from last.npz --return --export ros
    symgen excite --duration 40 --noise last.npz --settings motions=4 --settings cutoff=10
    symgen excite --settings static=true --settings poses=12 --table 0
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
    the best start so far. The result depends on the setting seed, not on processes.
    """
    require_applicable(given.stated(), given.static)
    require_several(given.stated(), given.motions)
    lib = open_robot(given.robot, given.yes)
    height, has_no_table = table_height(given.table)
    limits = LimitValues(
        given.torque_fraction,
        clearance=given.clearance,
        table=height,
        box=given.box,
        viscous=given.viscous,
        coulomb=given.coulomb,
        carry=given.carry,
        obstacles=given.obstacles,
        payload_band=given.payload_band,
        friction_band=given.friction_band,
        model_band=given.model_band,
    )
    fraction = given.stated().get("torque_fraction")  # its default is a number
    require_plain(given.document, (fraction, *astuple(limits)[1:], given.from_pose))
    safety = None if given.document else safety_of(lib, limits)
    if given.static and safety is not None:
        kept = PoseOptions(
            given.poses,
            given.out,
            given.noise,
            given.margin,
            given.starts,
            given.seed,
            has_no_table,
            given.overwrite,
        )
        given.write(excite_static(lib, safety, kept))
        return
    path = json_path(given.out or Path("results") / f"{lib.name}-excite.json")
    kind = until_kind(given.stated(), given.until)
    wanted, alone = criterion_and_unknowns(
        given.criterion, given.document, given.payload_only, kind
    )
    planned, note = information_of(
        lib,
        given.noise,
        given.log_rate,
        given.earlier_log,
        alone,
        given.friction,
        given.noise_model,
        given.cutoff,
    )
    is_informed = criterion_of(wanted).needs_information or bool(given.earlier_log) or alone
    rate = ROWS_HZ if given.export_rate is None else given.export_rate
    sample_times(given.duration, rate)  # before the search: they may be too many
    formats = [MOTION_FORMATS[name].name for name in given.export or []]  # before it, too
    rest = (
        None
        if given.home is None
        else np.array(numbers_option(given.home, lib.n_joints, "the setting home"))
    )
    accepted = [*(given.unchecked or ()), *([TABLE] if has_no_table else [])]
    if formats:
        require_consent(unchecked_limits(lib, safety), accepted)  # before the search, too
    side_by_side = cores() if given.starts >= STARTS_FOR_PROCESSES[given.document] else 1
    used = margin_of(given.margin, bool(formats))
    speeds = stage_speeds(given.duration, given.speed or [100.0])
    chosen = DesignSettings(
        duration=given.duration,
        harmonics=harmonics_of(given.harmonics, given.document),
        starts=given.starts,
        seed=given.seed,
        criterion=wanted,
        basis=basis_of(given.basis, given.zero_jerk),
        information=counted(planned, wanted, is_informed),
        safety=safety,
        home=rest,
        margin=used,
    )
    chosen, planned = with_shown_unknowns(lib, chosen, planned)
    if given.motions > 1:
        excite_several(
            lib,
            given.motions,
            chosen,
            planned,
            SeveralFiles(path, rate, speeds, given.overwrite),
            budget=given.budget,
            processes=given.processes if given.processes is not None else side_by_side,
            scheduler=given.scheduler,
        )
        given.write(path)
        return
    names = files_of(path, formats, given.speed or [100.0], given.pictures)
    require_unused(names, given.overwrite, consent=CONSENT)
    ways = session_plan(
        lib, given.from_pose, given.returns, rest, safety, used, given.zero_jerk, given.seed
    )
    with search_progress(wanted, given.starts) as report:
        optimum, session, session_sentences = searched(
            lib,
            given.until,
            chosen,
            ways,
            planned,
            given.gain_error,
            progress=report,
            budget=given.budget,
            processes=given.processes if given.processes is not None else side_by_side,
            scheduler=given.scheduler,
        )

    def sentences(best: Design) -> tuple[str, ...]:
        return (
            *search_notes(best, given.budget, given.starts),
            *(() if given.until else design_notes(lib, given.duration, best.trajectory.duration)),
            *ways.sentences(best.trajectory),
            *session_sentences,
        )

    files = MotionFiles(path, rate, formats, given.export_rate, speeds, given.pictures, accepted)
    write_design(
        lib,
        optimum,
        planned,
        ways,
        files,
        session=session,
        note=note,
        sentences=sentences,
        margin=used,
    )
    given.write(path)


def harmonics_of(given: int | None, document: bool) -> int:
    """Number of harmonics of a design."""
    if given is not None:
        return given
    return DOCUMENT_HARMONICS if document else HARMONICS


def margin_of(given: float | None, is_exported: bool) -> float:
    """Share of every limit that a design may use."""
    if given is not None:
        return given
    return EXPORT_MARGIN if is_exported else 1.0


def require_plain(document: bool, options: tuple[object, ...]) -> None:
    """Refuse options of limits beside --settings document=true."""
    if document and any(option is not None for option in options):
        raise RuntimeFault(
            "--settings document=true excludes --table, --box, --carry, --obstacles, --from, "
            "and the "
            "settings torque_fraction, clearance, viscous, coulomb, payload_band, friction_band "
            "and "
            "model_band; give --criterion cond instead, which keeps all limits"
        )
