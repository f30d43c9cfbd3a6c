"""Choices on logs that several commands share, the files that they name, and their progress."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress as Bar

from runtime.cli import common
from runtime.common import settings
from runtime.common.tables import Table
from runtime.common.terminal import VERBOSE, completing, say, show
from runtime.common.texts import number_of
from runtime.errors import IdentificationError
from runtime.estimators.choice.friction_choice import FrictionChoice
from runtime.estimators.choice.regressor_choice import CutoffCandidate, CutoffChoice
from runtime.estimators.methods import METHODS
from runtime.identification.identify import SEVERAL_STREAMED, Source
from runtime.identification.saved_result import SavedResult, read_result, require_model
from runtime.identification.settings import AUTO, NAMES, Progress
from runtime.identification.several_logs import NamedLog, read_carried
from runtime.library import Array, Library
from runtime.recording import EVERYTHING, REGRESSORS, Friction, Split, read_recording
from runtime.recording.free_base import FreeBaseRecording, read_free_base
from runtime.recording.log_files import known_names
from runtime.recording.settings import COLUMNS
from runtime.recording.streamed import StreamedRecording, open_log


def bundled_logs(incomplete: str) -> list[str]:
    """Names of known data sets, read when a shell asks."""
    return completing(known_names())(incomplete)


Log = Annotated[
    str,
    typer.Argument(
        metavar="LOG",
        autocompletion=bundled_logs,
        help="A log as CSV, NPZ, Parquet, HDF5, MCAP or ROS bag, a folder with a recipe, or the "
        "name of a known data set such as panda_gaz.",
    ),
]
Recipe = Annotated[
    str | None,
    settings.data_option(
        metavar="FILE",
        help="TOML that describes the log: columns, units, joint order, signs, gears, filters; "
        "default recipe.toml in the folder LOG, or the bundled recipe of a known data set.",
    ),
]
Run = Annotated[
    str | None,
    settings.data_option(
        help="Name of the run, where a recipe lists several; default that of the recipe."
    ),
]
Parts = Annotated[
    str | None,
    typer.Option(
        "--split",
        metavar="A,B|B|all",
        help="Fractions of the duration: training from 0 to A, 0.8 B where B stands alone, "
        "validation from A to B, test from B to 1; all trains on all rows, for a test by evaluate "
        "with another log. Methods that do "
        "not stop by the validation part train on it as well. Default from the recipe, else "
        "0.48,0.6.",
    ),
]
Cutoff = Annotated[
    str | None,
    typer.Option(
        metavar="HZ|auto",
        help="Cut-off of the zero-phase low-pass of q, dq and tau, Hz; auto chooses it by "
        "cross-validation; default from the recipe, else auto where ddq is noise without a "
        "filter, else no filter.",
    ),
]
Rate = Annotated[
    float | None,
    settings.data_option(
        metavar="HZ",
        help="Rate of rows to which the log is decimated, Hz; default from the recipe, else every "
        "sample.",
    ),
]
CoulombSpeed = Annotated[
    float | None,
    settings.model_option(
        help="Speed over which the smooth Coulomb sign changes, rad/s or m/s; default from the "
        f"recipe, else {Friction(columns=()).coulomb_speed:g}."
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogChoices(common.RobotChoices):
    """A log of a robot."""

    recipe: Recipe = None
    run: Run = None
    overwrite: common.Overwrite = False


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyChoices(LogChoices):
    """A log of a body on a link."""

    rate: Rate = None
    link: str | None = settings.model_field(
        help="Link that carries the payload; default the link of the tip."
    )
    cutoff: float | None = settings.method_field(
        metavar="HZ",
        help="Cut-off of the zero-phase low-pass of q, dq and tau, Hz; default from the "
        "recipe, else no filter.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FitChoices(LogChoices):
    """A log that parameters are fitted to."""

    rate: Rate = None
    friction: str | None = settings.model_field(
        metavar="COLUMNS|auto|none",
        autocompletion=completing((*COLUMNS, AUTO, "none")),
        help="Friction columns with commas, of "
        f"{', '.join(COLUMNS)}; auto chooses them by cross-validation, 'auto,rotor' adds a "
        "column to every candidate, none fits the inertia only; default from the recipe, else "
        "identify and compare choose among offset, viscous, coulomb and rotor by "
        "cross-validation.",
    )
    coulomb_speed: CoulombSpeed = None
    cutoff: Cutoff = None
    regressor: str | None = settings.method_field(
        metavar="FORM",
        help=f"Form of the equations, of {', '.join((*REGRESSORS, AUTO))}: acceleration "
        "needs ddq, momentum does not, energy gives one row for all joints and less "
        "information; auto takes momentum where the differentiation of dq fails. Default from "
        "the recipe, else acceleration.",
    )
    split: Parts = None
    logs: list[str] = settings.argument_field(
        metavar="LOG...",
        autocompletion=bundled_logs,
        help="One or several logs: CSV, NPZ, Parquet, HDF5, MCAP or ROS bags, folders with a "
        "recipe, or names of known data sets such as panda_gaz.",
    )
    controller: Path | None = settings.model_field(
        metavar="FILE",
        help="TOML with the controller's gains and the reference motion, which the methods iv "
        "and didim need; simulate writes one as LOG.loop.toml.",
    )
    rows: str | None = settings.method_field(
        metavar="base|joints|all",
        help="Equations of a robot with a free base: the six of the base, those of the joints, "
        "or all; default all, and base without torques.",
    )
    stream: bool | None = settings.data_field(
        None,
        "--stream/--no-stream",
        help="Read the log block by block instead of as a whole; default for NPZ, Parquet, CSV "
        "and bags above 200 MB.",
    )
    seed: common.Seed = 0

    def shared(self) -> dict[str, Any]:
        """Fields that `Settings` has, too."""
        same = [each.name for each in fields(self) if each.name in NAMES]
        return self.values(*same) | {"split": split_of(self.split)}


@dataclass(frozen=True, slots=True, kw_only=True)
class OfResult(settings.Choices):
    """The robot of a result."""

    robot: str | None = settings.data_field(
        autocompletion=common.robots,
        help="Name or folder of the robot; default that of the result.",
    )
    yes: common.Yes = False


def open_result(
    given: OfResult,
    result: Path,
    learned: bool = False,
    free_base: bool = False,
    same_bodies: bool = False,
) -> tuple[SavedResult, Library, tuple[str, ...]]:
    """Open a result and its robot, or the named one, with notes on the model."""
    saved = read_result(result, with_learned=learned)
    free_base = free_base and saved.record.is_free
    lib = common.open_robot(given.robot or saved.record.robot, given.yes, takes_free_base=free_base)
    return saved, lib, require_model(saved.record, lib, result, same_bodies)


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultChoices(OfResult):
    """A result of identify."""

    result: Path = settings.argument_field(metavar="RESULT", help="Folder written by identify.")


@dataclass(frozen=True, slots=True, kw_only=True)
class LaterLogChoices(ResultChoices):
    """A result of identify and another log, prepared in the same way unless it is stated."""

    log: str = settings.argument_field(
        metavar="LOG",
        autocompletion=bundled_logs,
        help="Another log of the same robot, of any length.",
    )
    recipe: Recipe = None
    run: Run = None
    cutoff: float | None = settings.method_field(
        metavar="HZ",
        help="Cut-off of the zero-phase low-pass of q, dq and tau, Hz; default from the "
        "recipe, else that of identify.",
    )
    rate: float | None = settings.data_field(
        metavar="HZ",
        help="Rate of rows to which the log is decimated, Hz; default from the recipe, else "
        "that of identify.",
    )


TRAINED = 0.8  # share of training in all but the test, where --split states the end of both alone


def split_of(text: str | None) -> Split | None:
    """Parts of a log from --split."""
    if text is None:
        return None
    if text == "all":
        return EVERYTHING
    b = number_of(text)
    a, b = common.numbers_option(text, 2, "--split") if b is None else (TRAINED * b, b)
    if not 0 < a < b < 1:
        raise IdentificationError(f"--split needs 0 < A < B < 1, got '{text}'")
    return Split((0.0, a), (a, b), (b, 1.0))


def runs_of(logs: Sequence[str], run: str | None) -> list[tuple[str, str | None]]:
    """Logs with their runs; `--run 1,2,3` of one log gives three."""
    if len(logs) == 1 and run is not None and "," in run:
        return [(logs[0], each.strip()) for each in run.split(",")]
    return [(log, run) for log in logs]


def opened_logs(
    given: FitChoices,
    lib: Library,
    stream: bool | None,
    payload_of: Sequence[str] = (),
    need: str = "",
) -> Source | list[NamedLog]:
    """One log, left in its file where that is large, or several with names and known payloads."""
    runs = runs_of(given.logs, given.run)
    if len(runs) > 1 or payload_of:
        if given.stream:
            raise IdentificationError(SEVERAL_STREAMED)
        carried = _carried(payload_of, [log for log, _ in runs], lib)
        same = len({log for log, _ in runs}) == 1
        named = []
        for place, run in runs:
            name = f"run {run}" if same and run else Path(place).stem
            read = read_recording(place, given.recipe, run, lib.joint_names)
            named.append(NamedLog(name, read, carried=carried.get(place)))
        return named
    log = open_log(given.logs[0], given.recipe, given.run, lib.joint_names, stream)
    if isinstance(log, StreamedRecording):
        say(
            f"streaming {log.rows} rows of {log.name}; --settings stream=false reads the log as a "
            f"whole{need}"
        )
    return log


def walks_of(given: FitChoices, lib: Library, taken: Collection[str]) -> list[FreeBaseRecording]:
    """Logs of a robot with a free base, for which some choices are taken; none of other robots."""
    if not lib.manifest.floating:
        return []
    if unused := given.stated_beyond(taken):
        raise IdentificationError(
            f"{unused[0]} does not apply to a robot with a free base; leave it out"
        )
    return [read_free_base(Path(log)) for log in given.logs]


def _carried(payload_of: Sequence[str], logs: Sequence[str], lib: Library) -> dict[str, Array]:
    """Log → π of its known payload, from the setting payload_of."""
    payloads = {}
    for text in payload_of:
        log, mark, file = text.rpartition("=")
        if not mark or log not in logs:
            raise IdentificationError(
                f"the setting payload_of expects LOG=FILE with a log of {', '.join(logs)}; got "
                f"'{text}'"
            )
        payloads[log] = read_carried(Path(file), lib)
    return payloads


def inputs_of(methods: Iterable[str], lib: Library, **files: Path | None) -> dict[str, Any]:
    """What these methods need beyond the log, from files by the names of the inputs."""
    readers = {name: read for each in methods for name, read in METHODS[each].files.items()}
    return {key: readers[key](path, lib) for key, path in files.items() if path and key in readers}


def shown_progress(bar: Bar, method: str, robot: str, total: int | None = None) -> Progress:
    """One bar: the present step, then the iterations of the method; choices are printed above."""
    task = bar.add_task("reading the log", total=None, state="")

    def choice(made: CutoffChoice | FrictionChoice) -> None:
        if isinstance(made, FrictionChoice) or VERBOSE.get():
            show(_candidates(made))
        else:
            say(f"cut-off: {made.chosen.cutoff_hz:g} Hz, chosen by cross-validation")

    def iteration(done: int, best: float) -> None:
        text, name = f"best validation loss {best:.6g}", f"{method} on {robot}"
        bar.update(task, description=name, total=total, completed=done, state=text)

    return Progress(lambda sentence: bar.update(task, description=sentence), choice, iteration)


def _candidates(choice: CutoffChoice | FrictionChoice) -> Table:
    """Candidates with their cross-validation errors; an arrow marks the choice."""
    rows: list[tuple[str, ...]] = []
    for c in choice.candidates:
        mark = "→ " if c is choice.chosen else ""
        errors = f"{c.score:.3f}", f"{c.excess:.3f} ± {c.excess_error:.3f}"
        if isinstance(c, CutoffCandidate):
            velocity = "from q" if c.derivative == "position" else c.derivative
            rows.append((f"{mark}{c.cutoff_hz:g} Hz", velocity, *errors, f"{100 * c.white:.0f} %"))
        else:
            rows.append((f"{mark}{c.name}: {c.terms}", *errors, f"{c.aic:.1f}", f"{c.parameters}"))
    if isinstance(choice, FrictionChoice):
        head = ("friction model", "error", "above the best", "AIC", "unknowns")
        title = "Friction model: cross-validation error over noise"
    else:
        head = ("cut-off", "velocity", "error", "above the best", "independent rows")
        title = "Cut-off: cross-validation error on the unfiltered torque"
    return Table(head, tuple(rows), title=title)
