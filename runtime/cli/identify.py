"""`symgen identify` of one log, in memory or streamed, and what it prints of a result."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from runtime.cli.common import (
    Overwrite,
    ResultFolder,
    Robot,
    Seed,
    Yes,
    counting,
    open_robot,
    require_result_folder,
    share_table,
    state,
    torque_table,
)
from runtime.cli.drive import delayed, drive_request, print_drives, terms_of, with_mirrored_links
from runtime.cli.free_base import EquationRows, identify_free_base_log, require_fixed_base
from runtime.cli.log_options import (
    AUTO,
    ControllerFile,
    CoulombSpeed,
    Cutoff,
    Delay,
    EncoderBias,
    FrictionNames,
    Parts,
    Rate,
    Recipe,
    Regressor,
    Run,
    Stream,
    Symmetric,
    Tie,
    inputs_of,
    prior_of,
    require_one_log,
)
from runtime.cli.prepared_log import (
    LogOptions,
    PreparedLog,
    read_prepared_log,
    usable_columns,
)
from runtime.cli.several_logs import (
    Logs,
    PayloadOf,
    delay_notes,
    identify_several,
    print_agreement,
    runs_of,
    with_delays,
)
from runtime.common.terminal import command_line, completing, console, say
from runtime.errors import IdentificationError
from runtime.estimators.choice.default_friction import MEMORY
from runtime.estimators.descent.fit import PRESETS
from runtime.estimators.methods import METHODS, chosen_method
from runtime.identification.drive.estimate import BIAS_PRIOR
from runtime.identification.drive.result import DriveFit, DriveRequest
from runtime.identification.drive.symmetry import identify_drives, with_sides
from runtime.identification.friction_intervals import spring_lines
from runtime.identification.identified import Identification
from runtime.identification.long_logs.identify import identify_streamed, require_streamable
from runtime.identification.problem_setup import settings_for
from runtime.identification.result_file import write_result
from runtime.identification.result_warnings import still_joints
from runtime.identification.settings import Settings
from runtime.identification.several_logs.identify import LogAgreement
from runtime.identification.single_log import identify
from runtime.identification.statistics_file import statistics_of, write_statistics
from runtime.library import Library
from runtime.outputs.model_files import write_urdf
from runtime.outputs.report import write_report
from runtime.recording import Recording, StreamedRecording, is_large

STATISTICS = "statistics.npz"
"""Name of the file of `--save-statistics`."""


_WRITTEN = ResultFolder(
    "identify",
    (
        *("result.json", "predictions.npz", "posterior.npz", "statistics.npz"),
        *("identified.urdf", "report.html"),
    ),
    "method",
)


def identify_command(
    logs: Logs,
    robot: Robot = "fr3",
    yes: Yes = False,
    method: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            autocompletion=completing(METHODS),
            help=f"Estimator: {', '.join(METHODS)}; default map, with --preset adam.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of the result; default results/LOG-METHOD."),
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(PRESETS),
            autocompletion=completing(PRESETS),
            help="Settings of the method adam: simulation and real are Tables 5.1 and 5.8 of the "
            "document, full uses all samples in every step; default full.",
        ),
    ] = None,
    prior: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Inertial prior as TOML: uncertainty of the URDF, known masses, centres of mass "
            "and symmetries.",
        ),
    ] = None,
    recipe: Recipe = None,
    run: Run = None,
    friction: FrictionNames = None,
    coulomb_speed: CoulombSpeed = None,
    cutoff: Cutoff = None,
    rate: Rate = None,
    regressor: Regressor = None,
    delay: Delay = None,
    encoder_bias: EncoderBias = None,
    symmetric: Symmetric = None,
    tie: Tie = False,
    split: Parts = None,
    controller: ControllerFile = None,
    stream: Stream = None,
    rows: EquationRows = None,
    robust: Annotated[
        bool,
        typer.Option(
            "--robust",
            help="Huber weights on blocks of training rows, for map, pc-ols, ols and wls; the "
            "notes name the rows that count less.",
        ),
    ] = False,
    payload_of: PayloadOf = None,
    refit: Annotated[
        bool,
        typer.Option(
            help="Fit the parameters again to all rows once the errors on the test part are "
            "known (methods without early stopping)."
        ),
    ] = True,
    save_statistics: Annotated[
        bool,
        typer.Option(
            "--save-statistics",
            help="Write statistics.npz, the compressed log that fleet needs.",
        ),
    ] = False,
    report: Annotated[
        bool, typer.Option(help="Write report.html; its figures cost a tenth of a second.")
    ] = True,
    seed: Seed = 0,
    overwrite: Overwrite = False,
) -> None:
    r"""Identify the inertial parameters of a robot from logs.

    \b
    symgen identify panda_gaz --robot fr3
    symgen identify log.csv --robot my --friction viscous,coulomb --cutoff 10
    symgen identify log.csv --robot my --friction auto --cutoff auto
    symgen identify log.csv --robot my --friction none
    symgen identify log.csv --robot my --method pc-ols --out results/convex
    symgen identify log.csv --robot my --prior my-arm.toml
    symgen identify log.csv --robot my --regressor momentum --cutoff 2
    symgen identify log.csv --method didim --controller log.loop.toml --friction viscous
    symgen identify log.npz --robot my --recipe pd.toml --delay auto
    symgen identify walk.npz --robot humanoid --rows base --cutoff 5
    symgen identify a.csv b.csv --robot my --payload-of b.csv=results/tool/payload.json

    A CSV log has the header t,q1…,dq1…,ddq1…,tau1… in SI units (s, rad or m, N·m or N); dq and
    ddq are optional. Every other layout is described by a recipe, which inspect proposes.

    Written to the folder --out: result.json (parameters, uncertainty, errors), identified.urdf and
    report.html. Errors are those of the test part by a fit that has not used it; the parameters are
    then fitted to all rows (--no-refit keeps those of the training part).

    Several logs, or --run 1,2,3, give one set of parameters; every log has its own torque offset,
    and the output shows how well the other logs predict each of them. Ctrl-C keeps the best
    parameters so far.
    """
    lib, log = open_robot(robot, yes, takes_free_base=True), logs[0]
    outputs = Outputs(report, save_statistics)
    if lib.manifest.floating:
        unused: dict[str, object] = {"--method": method, "--preset": preset, "--recipe": recipe}
        unused |= {"--run": run, "--friction": friction, "--rate": rate, "--regressor": regressor}
        unused |= {"--delay": delay, "--controller": controller, "--robust": robust}
        unused |= {"--symmetric": symmetric, "--tie": tie, "--coulomb-speed": coulomb_speed}
        unused |= {"--encoder-bias": encoder_bias, "--payload-of": payload_of, "--stream": stream}
        unused |= {"--save-statistics": save_statistics}
        identify_free_base_log(
            lib,
            logs,
            rows,
            cutoff=cutoff,
            split=split,
            prior=prior_of(prior, lib),
            out=out,
            overwrite=overwrite,
            others=unused,
        )
        return
    require_fixed_base(lib, rows)
    if stream is None and (
        not is_large(log)
        or controller
        or encoder_bias
        or symmetric
        or friction == AUTO
        or robust
        or not is_streamable(method, preset)
    ):
        stream = False  # these need the samples of the whole log
    options = LogOptions(
        recipe, run, friction, coulomb_speed, cutoff, rate, split, stream, regressor
    )
    known, sides = prior_of(prior, lib), tuple(symmetric or ())
    if sides or tie:
        known = with_mirrored_links(known, lib, sides, tie)  # or refused here
    settings = settings_for(
        lib,
        Settings(method=method, preset=preset, prior=known, seed=seed, robust=robust, refit=refit),
    )
    runs = runs_of(logs, run)
    several = f"{len(runs)}-" if len(runs) > 1 or payload_of else ""
    chosen = chosen_method(settings.method, settings.preset, settings.prior)
    folder = out or Path("results") / f"{Path(log).stem}-{several}{chosen}"
    require_result_folder(folder, _WRITTEN, overwrite)
    if several:
        require_one_log("several", controller, encoder_bias or symmetric)

        result, agreement = identify_several(runs, lib, settings, payload_of or (), options, delay)
        finish(result, folder, outputs, agreement)
        return
    usable = usable_columns([chosen])
    if delay is not None or encoder_bias:  # whose result states Coulomb friction per drive
        usable = tuple(name for name in usable if name != MEMORY)
    data = read_prepared_log(
        lib, log, options, usable, robust, known.friction_model if known else None
    )
    if data.streamed is not None:
        require_one_log("streamed", controller, encoder_bias or symmetric)

        result = streamed_result(data.streamed, data, lib, settings, delay)
        result = dataclasses.replace(result, notes=(*data.notes, *result.notes))
        finish(result, folder, outputs)
        return

    preparation = delayed(data, delay, bool(encoder_bias))
    result = _with_progress(
        data.recording,
        lib,
        dataclasses.replace(
            settings,
            preparation=preparation,
            splitting=data.splitting,
            friction_columns=terms_of(data, method, friction or coulomb_speed),
            inputs=inputs_of([chosen], lib, controller=controller),
        ),
        drive_request(data.recording, delay, encoder_bias, chosen, sides if tie else ()),
    )
    if sides:
        result = with_sides(result, sides)
    result = dataclasses.replace(result, notes=(*data.notes, *result.notes))
    finish(result, folder, outputs)


def _with_progress(
    recording: Recording, lib: Library, settings: Settings, drives: DriveRequest | None
) -> Identification:
    method = chosen_method(settings.method, settings.preset, settings.prior)
    total = None
    if METHODS[method].takes_preset:
        chosen = PRESETS.get(str(settings.preset or "full"))
        total = chosen.rule.max_iterations if chosen else None
    with counting(state()) as progress:
        task = progress.add_task(f"{method} on {lib.name}", total=total, state="")

        def report(iteration: int, best: float) -> None:
            progress.update(task, completed=iteration, state=f"best validation loss {best:.6g}")

        if drives is not None:
            return identify_drives(recording, lib, settings, drives, progress=report)

        return identify(recording, lib, settings, progress=report)


@dataclass(frozen=True, slots=True)
class Outputs:
    """Files that options switch on or off.

    Attributes:
        report: value of --report.
        statistics: value of --save-statistics.
    """

    report: bool
    statistics: bool


def finish(
    result: Identification,
    folder: Path,
    outputs: Outputs,
    agreement: LogAgreement | None = None,
) -> None:
    """Write and print a result."""
    facts = write_result(result, folder, command_line(), agreement.facts() if agreement else None)
    first = still_joints(result)
    for warning in first:
        say(f"warning: {warning}")
    console.print(torque_table(facts))
    shares = share_table(facts)
    if shares is not None:
        console.print(shares)
    print_drives(facts)
    _print_springs(facts)
    if agreement is not None:
        print_agreement(agreement)
    if result.uncertainty is not None:
        unknowns = len(result.uncertainty.beta_sigma)
        say(
            f"data: they determine {result.uncertainty.determined} of {unknowns} independent "
            "combinations of parameters better than the prior does"
        )
    say(f"status: {result.status}")
    verdict = "physically consistent" if result.is_consistent else "NOT physically consistent"
    smallest = float(result.relative_eigenvalues.min())
    say(f"links: all {len(facts['links'])} {verdict}, smallest relative eigenvalue {smallest:.1e}"
        if result.is_consistent
        else f"links: {verdict}, smallest relative eigenvalue {smallest:.1e}")  # fmt: skip
    say(
        f"gap to the convex optimum (PC-OLS on the same rows and weights): {100 * result.gap:.3f} %"
    )
    if result.uncertainty is not None:
        say(f"advice: {result.uncertainty.advice()}")
    say(f"time of the method: {result.seconds:.3f} s")
    for warning in facts["warnings"][len(first) :]:
        say(f"note: {warning}")
    if result.is_consistent:
        say(f"URDF:   {folder / 'identified.urdf'} ({_exported(result, folder)})")
    else:
        (folder / "identified.urdf").unlink(missing_ok=True)  # of a result that this one replaces
        say("URDF:   not written, because the model is not physically consistent")
    if outputs.report:
        say(f"report: {write_report(folder)}")
    else:
        (folder / "report.html").unlink(missing_ok=True)  # of a result that this one replaces
    if outputs.statistics:
        write_statistics(statistics_of(result, folder.resolve().name), folder / STATISTICS)
        say(f"statistics: {folder / STATISTICS}")
    else:
        (folder / STATISTICS).unlink(missing_ok=True)  # of a result that this one replaces


def _print_springs(facts: Mapping[str, Any]) -> None:
    for line in spring_lines(facts["friction"]):
        say(line)


def _exported(result: Identification, folder: Path) -> str:

    path = folder / "identified.urdf"
    return write_urdf(result.lib, result.pi, path, result.friction, result.usual_phi)


def is_streamable(method: str | None, preset: str | None) -> bool:
    """Whether a method works on streamed rows."""
    try:
        require_streamable(chosen_method(method, preset, None), preset)
    except IdentificationError:
        return False
    return True


def streamed_result(
    log: StreamedRecording,
    data: PreparedLog,
    lib: Library,
    settings: Settings,
    delay: str | None = None,
) -> Identification:
    """Identify from a log that is read piece by piece."""
    facts: list[dict[str, Any]] = []
    if delay is not None:
        (data,), facts = with_delays((log.name,), (data,), lib, settings, delay)
    say(f"streaming {log.rows} rows of {log.name}; --no-stream reads the log as a whole")
    with console.status("streaming") as status:
        result = identify_streamed(
            log,
            lib,
            settings,
            preparation=data.preparation,
            splitting=data.splitting,
            friction_columns=data.friction,
            progress=status.update,
        )
    return _with_delay(result, facts[0], len(data.recording)) if facts else result


def _with_delay(result: Identification, facts: dict[str, Any], rows: int) -> Identification:
    """The result with the delay of the first rows."""
    note = f"{delay_notes((facts,))[0]}, from the first {rows} rows"
    unknown = np.full(result.lib.n_joints, np.nan)
    width = result.phi.shape[1]
    known = facts["value"] is not None
    drive = DriveFit(
        delay=np.atleast_1d(facts["value"]) if known else np.zeros(0),
        delay_sigma=np.atleast_1d(facts["sigma"]) if known else np.zeros(0),
        bias=unknown,
        bias_sigma=unknown,
        bias_prior=BIAS_PRIOR,
        phi_sigma=np.full(result.phi.shape, np.nan),
        phi_covariance=np.full((len(unknown), width, width), np.nan),
    )
    return replace(result, drive=drive, notes=(note, *result.notes))
