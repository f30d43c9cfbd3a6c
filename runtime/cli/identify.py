"""`symgen identify`."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.cli.common import Robot, Seed, Yes, counting, open_robot, state
from runtime.cli.free_base import Rows, require_fixed_base
from runtime.cli.identify_output import Outputs, finish
from runtime.cli.identify_request import (
    inputs_of,
    prior_of,
    require_one_log,
)
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
)
from runtime.cli.overwriting import Overwrite, ResultFolder, require_result_folder
from runtime.cli.prepared_log import (
    LogOptions,
    read_prepared_log,
    usable_columns,
)
from runtime.cli.several_logs import Logs, PayloadOf, runs_of
from runtime.cli.streamed_log import is_streamable
from runtime.common.terminal import completing
from runtime.estimators.choice.default_friction import MEMORY
from runtime.estimators.descent.fit import PRESETS
from runtime.estimators.methods import METHODS, chosen_method
from runtime.identification.identified import Identification
from runtime.identification.problem_setup import settings_for
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording import Recording, is_large

if TYPE_CHECKING:
    from runtime.identification.drive.result import DriveRequest

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
    rows: Rows = None,
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
        from runtime.cli.free_base import identify_free_base_log

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
        from runtime.cli.drive import with_mirrored_links

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
        from runtime.cli.several_logs import identify_several

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
        from runtime.cli.streamed_log import streamed_result

        result = streamed_result(data.streamed, data, lib, settings, delay)
        result = dataclasses.replace(result, notes=(*data.notes, *result.notes))
        finish(result, folder, outputs)
        return
    from runtime.cli.drive import delayed, drive_request, terms_of

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
        from runtime.identification.drive.symmetry import with_sides

        result = with_sides(result, sides)
    result = dataclasses.replace(result, notes=(*data.notes, *result.notes))
    finish(result, folder, outputs)


def _with_progress(
    recording: Recording, lib: Library, settings: Settings, drives: "DriveRequest | None"
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
            from runtime.identification.drive.symmetry import identify_drives

            return identify_drives(recording, lib, settings, drives, progress=report)
        from runtime.identification.single_log import identify

        return identify(recording, lib, settings, progress=report)
