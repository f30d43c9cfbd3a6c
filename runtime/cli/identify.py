"""`symgen identify` of one log, in memory or streamed, or of several."""

import re
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from runtime.cli.common import (
    ResultFolder,
    counting,
    keep_earlier,
    open_robot,
    require_result_folder,
    state,
)
from runtime.cli.free_base import identify_free_base_log, require_fixed_base
from runtime.cli.identified_output import finish
from runtime.cli.identify_settings import IdentifySettings
from runtime.cli.log_options import prior_of, runs_of
from runtime.cli.shown_progress import ShownProgress
from runtime.common.settings import FILE
from runtime.common.terminal import program, say
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.descent.fit import PRESETS
from runtime.estimators.methods import METHODS, chosen_method
from runtime.identification.identify import SEVERAL_STREAMED, Source, identify, with_row_marks
from runtime.identification.settings import AUTO, Settings
from runtime.identification.several_logs import NamedLog, read_carried
from runtime.library import Array, Library
from runtime.recording import read_recording
from runtime.recording.streamed import StreamedRecording, is_large, open_log

_WRITTEN = ResultFolder(
    "identify",
    (
        *("result.json", "predictions.npz", "posterior.npz", "statistics.npz"),
        *("identified.urdf", "report.html", FILE),
    ),
    "method",
)


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
    if lib.manifest.floating:
        identify_free_base_log(lib, given, prior_of(given.prior, lib))
        return
    require_fixed_base(lib, given.rows)
    settings = given.fitted(lib)
    inspect = _inspection(given)
    runs = runs_of(given.logs, given.run)
    several = f"{len(runs)}-" if len(runs) > 1 or given.payload_of else ""
    chosen = chosen_method(settings.method, settings.preset, settings.prior)
    folder = given.out or Path("results") / f"{Path(given.logs[0]).stem}-{several}{chosen}"
    require_result_folder(folder, _WRITTEN, given.overwrite)
    with counting(state()) as bar, _naming(inspect):
        shown = ShownProgress(bar, chosen, lib.name, _most_iterations(chosen, given.preset))
        opened = (
            _named(runs, lib, given.recipe, given.payload_of or (), bool(given.stream))
            if several
            else _opened(given.logs[0], lib, given.recipe, given.run, given.stream, settings)
        )
        result = identify(opened, lib, settings, progress=shown)
        result = with_row_marks(result, opened, settings.split)
    keep_earlier(folder, _WRITTEN)
    given.write(folder)
    finish(result, folder, given, inspect)


def _inspection(given: IdentifySettings) -> str:
    """Command that inspects the first log and writes a recipe for it."""
    place = ("--recipe", given.recipe) if given.recipe else ()
    words = ("inspect", given.logs[0], "--robot", given.robot, *place)
    return f"{program()} {shlex.join(words)} --recipe-out proposed.toml"


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


def _most_iterations(method: str, preset: str | None) -> int | None:
    """Largest number of iterations of a method with presets; None for other methods."""
    record = PRESETS.get(str(preset or "full")) if METHODS[method].takes_preset else None
    return record.rule.max_iterations if record else None


def _opened(
    log: str,
    lib: Library,
    recipe: str | None,
    run: str | None,
    stream: bool | None,
    settings: Settings,
) -> Source:
    """The log, left in its file where it is large and nothing needs all samples at once."""
    if stream is None and (needs_samples(settings) or not is_large(log)):
        stream = False
    opened = open_log(log, recipe, run, lib.joint_names, stream)
    if isinstance(opened, StreamedRecording):
        say(
            f"streaming {opened.rows} rows of {opened.name}; --settings stream=false reads the "
            f"log as a whole"
        )
    return opened


def needs_samples(settings: Settings) -> bool:
    """Whether a method or option needs the samples of the whole log, or is better with them."""
    options = settings.inputs, settings.encoder_bias, settings.symmetric, settings.robust
    method = chosen_method(settings.method, settings.preset, settings.prior)
    needs = METHODS[method].needs_samples(settings.preset)
    return needs or any(options) or settings.friction == AUTO


def _named(
    runs: Sequence[tuple[str, str | None]],
    lib: Library,
    recipe: str | None,
    payload_of: Sequence[str],
    stream: bool,
) -> list[NamedLog]:
    """Several logs with their names and known payloads."""
    if stream:
        raise IdentificationError(SEVERAL_STREAMED)
    carried = _carried(payload_of, [log for log, _ in runs], lib)
    same = len({log for log, _ in runs}) == 1
    return [
        NamedLog(
            f"run {run}" if same and run else Path(log).stem,
            read_recording(log, recipe, run, lib.joint_names),
            carried=carried.get(log),
        )
        for log, run in runs
    ]


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
