"""`symgen identify` of one log, in memory or streamed, or of several.

What `symgen identify` writes and prints of a result, and the table of its drives.
"""

import re
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from runtime.cli.common import ResultFolder, counting, numbers_option, open_robot, state
from runtime.cli.free_base import print_walk
from runtime.cli.log_options import (
    FitChoices,
    inputs_of,
    opened_logs,
    runs_of,
    shown_progress,
    walks_of,
)
from runtime.common.settings import data_field, method_field, model_field, output_field
from runtime.common.tables import Table
from runtime.common.terminal import VERBOSE, command_line, completing, program, say, say_notes, show
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.contradictions import FOLLOWS
from runtime.estimators.descent.fit import PRESETS
from runtime.estimators.methods import DEFAULT, METHODS
from runtime.estimators.optimizers import Status
from runtime.estimators.prior_file import KnownFriction, read_prior
from runtime.identification.free_base.prepared_walk import usual_rows
from runtime.identification.identified import Identification
from runtime.identification.identify import identify
from runtime.identification.posterior_file import spring_lines
from runtime.identification.problem_setup import settings_for
from runtime.identification.result_file import NewResult, write_result
from runtime.identification.result_record import ResultRecord
from runtime.identification.result_tables import error_table, share_table, tested_on
from runtime.identification.settings import AUTO, Settings
from runtime.identification.statistics_file import statistics_of, write_statistics
from runtime.library import Library
from runtime.outputs.model_files.export import write_urdf
from runtime.outputs.report.report import left_out_table, write_report
from runtime.recording import Recording, read_recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.recipes.recipe import COMMANDED
from runtime.recording.recipes.recipe_file import load_recipe


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifySettings(FitChoices):
    """Settings of `symgen identify`."""

    options = "robot recipe run method friction cutoff delay prior split out overwrite"
    method: str | None = method_field(
        metavar="NAME",
        autocompletion=completing(METHODS),
        help=f"Estimator: {', '.join(METHODS)}; default map, with the setting preset adam.",
    )
    preset: str | None = method_field(
        metavar="|".join(PRESETS),
        autocompletion=completing(PRESETS),
        help="Settings of the method adam: simulation and real are Tables 5.1 and 5.8 of the "
        "document, full uses all samples in every step; default full.",
    )
    prior: Path | None = model_field(
        metavar="FILE",
        help="Inertial prior as TOML: uncertainty of the URDF, known masses, centres of mass "
        "and symmetries.",
    )
    delay: str | None = model_field(
        metavar="S|auto|per-joint",
        help="Delay of the torque, s: of a commanded torque behind its stamp, of a measured "
        "one behind the motion; auto estimates it with its uncertainty, per-joint one for each "
        "joint; default torque_delay_s of the recipe, else none.",
    )
    encoder_bias: bool | None = model_field(
        None,
        "--encoder-bias/--no-encoder-bias",
        help="Estimate the error of the zero of every encoder, rad or m; default where --delay "
        "estimates the delay of a commanded torque.",
    )
    symmetric: list[str] | None = data_field(
        metavar="LEFT:RIGHT",
        help="Compare armature and friction of mirrored joints, whose names differ in these "
        "parts, such as left:right or FL:FR; repeatable.",
    )
    tie: bool = model_field(
        False,
        help="With the setting symmetric: the right link is the mirror image of the left one, "
        "and viscous friction and armature of both differ by a tenth; dry friction stays "
        "apart.",
    )
    preparation: str | None = method_field(
        metavar="FILE",
        help="Recipe whose table [preparation] states every step, for a log that has another "
        "recipe; cutoff, rate and regressor beside it have no place.",
    )
    validation: str | None = method_field(
        metavar="LOG", help="Another log for validation, given together with test."
    )
    test: str | None = method_field(
        metavar="LOG", help="Another log for the test, so that LOG is not split, of one log."
    )
    lam0: str | None = method_field(
        metavar="λ,λ,…",
        help="First guess of λ, ten numbers per link: ln m, centre of mass, logarithms and "
        "angles of the inertia as in result.json; default that of the URDF.",
    )
    friction_prior: Path | None = method_field(
        metavar="FILE",
        help="Inertial prior as TOML of which the friction alone counts, for map; default that "
        "of --prior.",
    )
    certify: bool = method_field(
        True, help="Compute the convex optimum and the uncertainty, which most other commands need."
    )
    robust: bool = method_field(
        False,
        help="Huber weights on blocks of training rows, for map, pc-ols, ols and wls; the "
        "notes name the rows that count less.",
    )
    gain_sigma: float = model_field(
        0.02,
        help="Largest relative σ of the gain of every torque or current, that of the data "
        "sheet; intervals of parameters contain it, or a smaller one that the log shows.",
    )
    payload_of: list[str] | None = model_field(
        metavar="LOG=FILE",
        help="Known payload of one of several logs: the payload.json that the command payload "
        "wrote; repeatable.",
    )
    refit: bool = method_field(
        True,
        help="Fit the parameters again to all rows once the errors on the test part are "
        "known (methods without early stopping).",
    )
    save_statistics: bool = output_field(
        False, help="Write statistics.npz, the compressed log that fleet needs."
    )
    report: bool = output_field(True, help="Write report.html; its figures cost most of a second.")
    out: Path | None = output_field(
        metavar="FOLDER", help="Folder of the result; default results/LOG-METHOD."
    )

    def fitted(self, lib: Library) -> Settings:
        """Settings of Python: the fields of the same names, of which some are files."""
        if self.save_statistics and not self.certify:
            raise IdentificationError(
                "save_statistics needs the uncertainty, which certify=false leaves out; "
                "leave out one of them"
            )
        files: dict[str, Any] = {
            "prior": self.prior and read_prior(self.prior, lib),
            "friction_prior": self._known_friction(lib),
            "symmetric": tuple(self.symmetric or ()),
            "preparation": self.preparation and load_recipe(self.preparation).preparation,
            "validation": self._other(self.validation, lib),
            "test": self._other(self.test, lib),
        }
        if self.lam0 is not None:
            files["lam0"] = numbers_option(self.lam0, len(lib.lam0), "the setting lam0")
        settings = settings_for(lib, Settings(**self.shared() | files))
        inputs = inputs_of([settings.estimator.name], lib, controller=self.controller)
        return replace(settings, inputs=inputs or None)

    def _known_friction(self, lib: Library) -> KnownFriction | None:
        if self.friction_prior is None:
            return None
        prior = read_prior(self.friction_prior, lib)
        if prior.friction is None:
            raise IdentificationError(
                f"the setting friction_prior expects a prior with a table [friction], which "
                f"'{self.friction_prior}' lacks; give one such as fleet writes, or leave it out"
            )
        return prior.friction

    def _other(self, log: str | None, lib: Library) -> Recording | None:
        """A log beside the first, read by the same recipe."""
        if log is None:
            return None
        return independent_joints(read_recording(log, self.recipe, None, lib.joint_names), lib)


LEFT_OUT = "Leave one log out: torque error of each log"
STATISTICS = "statistics.npz"

UNFINISHED = {end.value for end in (Status.INTERRUPTED, Status.MAX_ITERATIONS, Status.DIVERGED)}


def finish(result: NewResult, folder: Path, given: IdentifySettings, inspect: str) -> None:
    """Write all files of a result, then print it: a pipe that closes costs no file."""
    record = write_result(result, folder, command_line())
    files = _written(result, folder, given)
    if not isinstance(result, Identification):
        files.append(f"result: {folder / 'result.json'}")
        lines = print_walk(result)
    else:
        lines = _summary(result, record, inspect, given.robot)
    for line in (*lines, *files):
        say(line)
    if VERBOSE.get():
        _print_details(result, record)


def command_after(doubt: str, inspect: str, record: ResultRecord, robot: str) -> str:
    """Command that follows a doubt, as it is typed; "" without one."""
    columns = () if record.friction is None else record.friction.columns
    again = command_line() + (" " if "--overwrite" in sys.argv else " --overwrite ")
    has_sensors = record.torque_source != COMMANDED
    built = f"python -m symgen build --robot {shlex.quote(robot)} --name {record.robot}_tilted "
    commands = {  # after a space follows what was found
        r"--(?:delay|friction|cutoff) auto|--settings encoder_bias=true": again,
        r"columns of --friction": f"{again}--friction {','.join((*columns, 'offset'))}",
        r"\buse map\b": f"{again}--method map",
        r"--gravity=\S+": built,
        r"\bruntime gains\b": inspect.replace(" inspect ", " gains ", 1) if has_sensors else "",
        r"\brecord\b": f"{program()} excite --robot {shlex.quote(robot)}",
        r"\binspect\b|(in|of) a recipe": "" if inspect in doubt else inspect,
    }
    for pattern, command in commands.items():
        if match := re.search(pattern, doubt):
            if command is again and match[0] in again:
                return ""  # it was done
            return command + match[0] if command.endswith(" ") else command
    return ""


def _summary(
    result: Identification, record: ResultRecord, inspect: str, robot: str
) -> Iterator[str]:
    """What a result comes to: at most one doubt, errors, share of friction, bodies, one advice."""
    known, shares = result.uncertainty, record.torque_error_percent
    if record.doubts:
        doubt = record.doubts[0].replace("python -m runtime inspect LOG", inspect)
        yield f"{'note' if doubt.endswith(FOLLOWS) else 'warning'}: {doubt}"
        if command := command_after(doubt, inspect, record, robot):
            yield f"run: {command}"
    if result.status in UNFINISHED:
        yield f"status: {result.status}"
    before, after = shares.before_overall or 0.0, shares.after_overall or 0.0
    yield f"torque error on {tested_on(record)} data: {before:.3f} → {after:.3f} %"
    if (between := shares.urdf_friction_overall) is not None:
        part = (before - between) / (before - after) if before > between > after else None
        share = "" if part is None else f", {100 * part:.0f} % of the decrease"
        yield f"friction: the URDF with friction fitted has {between:.3f} %{share}"
    smallest = float(result.relative_eigenvalues.min())
    verdict = "physically consistent" if result.is_consistent else "NOT physically consistent"
    count = f"all {len(record.links)} " if result.is_consistent else ""
    yield f"links: {count}{verdict}, smallest relative eigenvalue {smallest:.1e}"
    if record.sessions is not None:
        yield f"repeatability: {record.sessions.repeatability.sentence}"
    yield from delay_lines(record)
    if known is not None:
        gains = f"; intervals assume torque gains known to {100 * known.gain_sigma:.2g} % (σ)"
        yield (
            f"data: they determine {known.determined} of {len(known.beta_sigma)} independent "
            "combinations of parameters better than the prior does"
            + (gains if known.gain_sigma else "")
        )
        if not record.doubts:
            yield f"advice: {known.first_advice()}"


def _print_details(result: NewResult, record: ResultRecord) -> None:
    if record.sessions is not None:
        show(replace(left_out_table(record.sessions), title=LEFT_OUT))
    if not isinstance(result, Identification):
        return
    title = f"{record.robot}, {record.method}: torque error on {tested_on(record)} data"
    errors = record.torque_error_percent, record.torque_rms
    first = error_table(*record.rows_of_errors, *errors, title)
    for table in (first, share_table(record), drive_table(record)):
        if table is not None:
            show(table)
    say(f"status: {result.status}")
    say(
        f"gap to the convex optimum (PC-OLS on the same rows and weights): {100 * result.gap:.3f} %"
    )
    if record.uncertainty is not None:
        say(f"advice: {record.uncertainty.advice}")
    say(f"time of the method: {result.seconds:.3f} s")
    say_notes(record.warnings)


def _written(result: NewResult, folder: Path, given: IdentifySettings) -> list[str]:
    """Write the files beside result.json; a line for each. Those of an earlier result go."""
    lines = [urdf_line(result, folder)]
    if given.report:
        lines.append(f"report: {write_report(folder)}")
    else:
        (folder / "report.html").unlink(missing_ok=True)
    if given.save_statistics:
        name = folder.resolve().name
        write_statistics(statistics_of(result, name), folder / STATISTICS)
        lines.append(f"statistics: {folder / STATISTICS}")
    else:
        (folder / STATISTICS).unlink(missing_ok=True)
    return lines


def urdf_line(result: NewResult, folder: Path) -> str:
    """Write identified.urdf of a consistent result, else remove that of an earlier one."""
    path = folder / "identified.urdf"
    if result.is_consistent:
        written = write_urdf(result.lib, result.pi, path, result.friction, result.usual_phi)
        return f"URDF:   {path} ({written})"
    path.unlink(missing_ok=True)
    return "URDF:   not written, because the model is not physically consistent"


def drive_table(record: ResultRecord) -> Table | None:
    """Drives of result.json, value ± standard deviation; None where none was estimated."""
    drives = record.drive or ()
    names = ("armature", "viscous", "coulomb", "offset", "encoder_bias")
    kept = [name for name in names if any(getattr(each, name) is not None for each in drives)]
    if not kept:
        return None
    rows = tuple(
        (each.joint, *(_cell(getattr(each, x), getattr(each.sigma, x)) for x in kept))
        for each in drives
    )
    head = ("joint", *(name.replace("_", " ") for name in kept))
    return Table(head, rows, title="Drives: value ± standard deviation, SI units")


def delay_lines(record: ResultRecord) -> Iterator[str]:
    """Delays of the torque, joints of unknown bias, and springs."""
    drives = record.drive or ()
    for delay in record.delays if drives else ():
        yield f"delay of the torque: {_cell(delay.value, delay.sigma, 1e3)} ms"
    unknown = [each.joint for each in drives if each.encoder_bias_verdict.startswith("not ident")]
    if unknown:
        yield f"encoder bias: not identifiable from this motion at {', '.join(unknown)}"
    yield from spring_lines(record.friction)


def _cell(value: Any, sigma: Any, factor: float = 1.0) -> str:
    if value is None:
        return "–"
    spread = "" if sigma is None else f" ± {factor * sigma:.2g}"
    return f"{factor * value:.4g}{spread}"


_FILES = ("result.json", "predictions.npz", "posterior.npz", STATISTICS, "identified.urdf")
_WRITTEN = ResultFolder((*_FILES, "report.html"), "method")


def identify_command(given: IdentifySettings) -> None:
    r"""Identify the inertial parameters of a robot from logs.

    \b
    symgen identify fr3_simulated
    symgen identify log.csv --robot my --friction viscous,coulomb --cutoff 10
    symgen identify log.csv --robot my --friction auto --cutoff auto
    symgen identify log.csv --robot my --friction none
    symgen identify log.csv --robot my --method pc-ols --out results/convex
    symgen identify log.csv --robot my --prior my-arm.toml
    symgen identify log.csv --robot my --settings regressor=momentum --cutoff 2
    symgen identify log.csv --method didim --settings controller=log.loop.toml --friction viscous
    symgen identify log.npz --robot my --recipe pd.toml --delay auto
    symgen identify walk.npz --robot humanoid --settings rows=base --cutoff 5
    symgen identify a.csv b.csv --robot my --settings payload_of=b.csv=results/tool/payload.json

    A CSV log has the header t,q1…,dq1…,ddq1…,tau1… in SI units (s, rad or m, N·m or N); dq and
    ddq are optional. Every other layout is described by a recipe, which inspect proposes.

    Written to the folder --out: result.json (parameters, uncertainty, errors), identified.urdf and
    report.html. Errors are those of the test part by a fit that has not used it; the parameters are
    then fitted to all rows (--settings refit=false keeps those of the training part).

    Several logs, or --run 1,2,3, give one set of parameters; every log has its own torque offset,
    and the output shows how well the other logs predict each of them. Ctrl-C keeps the best
    parameters so far.
    """
    lib = open_robot(given.robot, given.yes, takes_free_base=True)
    settings = given.fitted(lib)
    walks = walks_of(given, lib, OF_WALK)
    place = ("--recipe", given.recipe) if given.recipe else ()
    inspect = shlex.join(("inspect", given.logs[0], "--robot", given.robot, *place))
    inspect = f"{program()} {inspect} --recipe-out proposed.toml"
    count = len(runs_of(given.logs, given.run))
    words = [Path(given.logs[0]).stem, *[f"{count}"] * (count > 1 or bool(given.payload_of))]
    method = settings.estimator
    words += [settings.rows or usual_rows(walks)] if walks else []
    words += [method.name] if not walks or method.name != DEFAULT else []
    folder = given.out or Path("results") / "-".join(words)
    _WRITTEN.require(folder, given, given.overwrite)
    with counting(state()) as bar, _naming(inspect):
        preset = PRESETS.get(str(given.preset or "full")) if method.takes_preset else None
        total = preset.rule.max_iterations if preset else None
        shown = shown_progress(bar, method.name, lib.name, total)
        stream = False if given.stream is None and needs_samples(settings) else given.stream
        log = walks or opened_logs(given, lib, stream, given.payload_of or ())
        result = identify(log, lib, settings, progress=shown)
    _WRITTEN.begin(folder, given)
    finish(result, folder, given, inspect)


OF_WALK = (  # parameters of the command that apply to a robot with a free base
    *("logs", "robot", "yes", "rows", "cutoff", "split", "prior", "out", "overwrite", "report"),
    *("friction", "coulomb_speed", "delay", "method", "preset", "symmetric", "tie", "robust"),
    *("save_statistics", "friction_prior", "refit"),
)


@contextmanager
def _naming(inspect: str) -> Iterator[None]:
    """Add the command that proposes a recipe to a sentence that asks for one."""
    try:
        yield
    except (IdentificationError, RecordingError) as error:
        text = re.sub(
            r"python -m runtime inspect LOG( --recipe-out \S+)?", lambda _: inspect, f"{error}"
        )
        if "in a recipe" in text and " inspect " not in text:
            text = f"{text}; one is proposed by: {inspect}"
        raise type(error)(text) from None


def needs_samples(settings: Settings) -> bool:
    """Whether a method or option needs the samples of the whole log, or is better with them."""
    options = settings.inputs, settings.encoder_bias, settings.symmetric, settings.robust
    needs = settings.estimator.needs_samples(settings.preset)
    return needs or any(options) or settings.friction == AUTO
