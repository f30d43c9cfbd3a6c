"""`symgen compare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.cli import log_options
from runtime.cli.common import ResultFolder, counting, listed, open_robot, require_page, state
from runtime.common.settings import argument_field, method_field, model_field, output_field
from runtime.common.terminal import VERBOSE, command_line, completing, say, say_notes, show
from runtime.errors import IdentificationError
from runtime.estimators.methods import METHODS, methods_from_statistics
from runtime.identification.comparison import run
from runtime.identification.comparison.output import LEGEND, write_comparison
from runtime.identification.comparison.two_results import compare_results
from runtime.identification.identify import assembly_of_logs
from runtime.identification.long_logs import require_streamable
from runtime.identification.problem_setup import Assembly
from runtime.identification.result_tables import method_table
from runtime.identification.saved_result import read_result
from runtime.identification.settings import AUTO, Settings
from runtime.outputs.report.comparison import results_page
from runtime.outputs.report.page import write_page
from runtime.outputs.report.report import write_report
from runtime.recording import Recording
from runtime.recording.streamed import StreamedRecording

_WRITTEN = ResultFolder(("compare.json", "compare.md", "report.html"), "rows")


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareSettings(log_options.FitChoices):
    """Settings of `symgen compare`."""

    options = "robot methods out recipe run friction cutoff overwrite"
    logs: list[str] = argument_field(
        metavar="LOG...",
        autocompletion=log_options.bundled_logs,
        help="One or several logs, as for identify, or the folders of two results.",
    )
    methods: str | None = method_field(
        metavar="A,B,…",
        autocompletion=completing(METHODS),
        help=f"Methods with commas, of {', '.join(METHODS)}; default all.",
    )
    out: Path | None = output_field(
        metavar="FOLDER", help="Folder of the result; default results/LOG-compare."
    )
    truth: Path | None = model_field(
        metavar="FILE",
        help="JSON with the true parameters pi; default LOG.truth.json, which simulate writes.",
    )


def compare_command(given: CompareSettings) -> None:
    r"""Compare all identification methods on logs, or two results with each other.

    \b
    symgen compare fr3_simulated
    symgen compare log.csv --methods map,pc-ols,ols --friction auto --cutoff 10
    symgen compare log.csv --settings controller=log.loop.toml --friction viscous,coulomb
    symgen compare a.csv b.csv --robot my
    symgen compare results/monday-map results/friday-map

    All methods have the same training, validation and test parts, the same weights and the same
    cut-off. The table shows their errors, consistency and time, and sentences by rule say which
    of them to use. A method that needs more than the log offers, or that fails, is a row with the
    reason. Of a streamed log only methods that need no single samples are compared, of several
    logs unless --methods names others.

    Written to the folder --out: compare.json, compare.md and report.html. Ctrl-C keeps the rows
    that are complete.

    Of two results of one robot, report.html and the terminal show settings and torque errors side
    by side, and every mass, base parameter and friction coefficient with its difference in standard
    deviations; --verbose prints all tables.
    """
    if any((Path(place) / "result.json").is_file() for place in given.logs):
        _compare_results(given)
        return
    lib = open_robot(given.robot, given.yes, takes_free_base=True)
    walks = log_options.walks_of(given, lib, OF_WALK)
    runs = log_options.runs_of(given.logs, given.run)
    several = f"{len(runs)}-" if len(runs) > 1 else ""
    folder = given.out or Path("results") / f"{Path(given.logs[0]).stem}-{several}compare"
    _WRITTEN.require(folder, given, given.overwrite)
    names = listed(given.methods, tuple(METHODS), "--methods") if given.methods else None
    place = given.truth or run.beside(given.logs[0])
    known = run.read_truth(place, lib) if place else None
    known_methods = set(names or ()) <= set(methods_from_statistics())
    needs_whole = given.controller or given.friction == AUTO or not known_methods
    streams = False if given.stream is None and needs_whole else given.stream
    others = ", ".join(name for name in METHODS if name not in methods_from_statistics())
    log = walks or log_options.opened_logs(given, lib, streams, need=f", which {others} need")
    names = names or (tuple(METHODS) if isinstance(log, Recording) else methods_from_statistics())
    if isinstance(log, StreamedRecording):
        for name in names:
            require_streamable(name)
    inputs = log_options.inputs_of(names, lib, controller=given.controller) or None
    wanted = Settings(**given.shared(), inputs=inputs, refit=False)
    with counting(state()) as bar:
        shown = log_options.shown_progress(bar, "compare", lib.name)
        assembly, notes = assembly_of_logs(log, lib, wanted, names, shown)
    if assembly.source_note:
        notes.append(assembly.source_note)
    same = ("recipe", "run", "friction", "coulomb_speed", "cutoff", "rate", "split", "regressor")
    settings = given.values(*same, "seed") | {
        "methods": list(names),
        "stream": streams,
        "loop": None if given.controller is None else given.controller.name,
        "truth": None if place is None else place.name,
    }
    comparison = _with_progress(assembly, names, known)
    _WRITTEN.begin(folder, given)
    _finish(write_comparison(comparison, folder, command_line(), settings, tuple(notes)), folder)


OF_WALK = (  # parameters of the command that apply to a robot with a free base
    *("logs", "robot", "yes", "rows", "cutoff", "split", "out", "overwrite", "friction"),
    *("coulomb_speed", "methods", "truth", "seed"),
)


def _compare_results(given: CompareSettings) -> None:
    if wrong := given.stated_beyond({"logs", "out", "overwrite"}):
        raise IdentificationError(
            f"two results are compared as they are, and {', '.join(wrong)} would change a fit; "
            "leave it out, or give a log in place of the results"
        )
    if len(given.logs) != 2:
        raise IdentificationError(
            f"expected the folders of two results, got {len(given.logs)}; give two, or logs alone"
        )
    names = Path(given.logs[0]).resolve().name, Path(given.logs[1]).resolve().name
    folder = given.out or Path("results") / f"{'-'.join(names)}-compare"
    names = names if names[0] != names[1] else (given.logs[0], given.logs[1])
    first, second = (read_result(Path(place), with_learned=True) for place in given.logs)
    both = compare_results(first, second, names)
    page = folder / "report.html"
    require_page(page, given.overwrite)
    write_page(results_page(both, first.record.robot, names), page)
    for table in (both.setup, both.errors, *(both.values if VERBOSE.get() else both.values[:1])):
        show(table)
    for sentence in both.sentences:
        say(sentence)
    say_notes(both.notes)
    say(f"report: {page}")


def _with_progress(
    assembly: Assembly, names: tuple[str, ...], truth: run.TrueParameters | None
) -> run.Comparison:
    with counting(state()) as progress:
        task = progress.add_task("comparing", total=len(names), state="")

        def started(method: str) -> None:
            progress.update(task, description=method, completed=names.index(method), state="")

        def reported(iteration: int, best: float) -> None:
            progress.update(task, state=f"iteration {iteration}, best validation loss {best:.6g}")

        return run.compare(assembly, names, truth=truth, started=started, progress=reported)


def _finish(facts: dict[str, Any], folder: Path) -> None:
    title = f"{facts['robot']}, {facts['recording']['name']}: every method"
    show(method_table(facts["rows"], title))
    say(f"{LEGEND}\n")
    for row in facts["rows"]:
        say(f"{row['method']}: {row['status']}")
    say("")
    for sentence in facts["advice"]["sentences"]:
        say(f"advice: {sentence}")
    say_notes(facts["notes"])
    say(f"table:  {folder / 'compare.md'}")
    say(f"report: {write_report(folder)}")
