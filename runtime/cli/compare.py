"""`symgen compare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.cli.common import ResultFolder, counting, listed, open_robot, require_page, state
from runtime.cli.log_options import FitChoices, Log, inputs_of, split_of
from runtime.cli.shown_progress import shown_progress
from runtime.common.settings import argument_field, method_field, model_field, output_field
from runtime.common.terminal import VERBOSE, command_line, completing, say, say_notes, show
from runtime.errors import IdentificationError
from runtime.estimators.methods import METHODS, methods_from_statistics
from runtime.identification.comparison.output import LEGEND, write_comparison
from runtime.identification.comparison.run import (
    Comparison,
    TrueParameters,
    beside,
    compare,
    read_truth,
)
from runtime.identification.comparison.two_results import compare_results
from runtime.identification.long_logs import assemble_streamed, require_streamable
from runtime.identification.prepared_log import prepared_log, usable_columns
from runtime.identification.problem_setup import Assembly, assemble
from runtime.identification.result_tables import method_table
from runtime.identification.saved_result import read_result
from runtime.identification.settings import AUTO, Settings
from runtime.outputs.report.comparison import results_page
from runtime.outputs.report.page import write_page
from runtime.outputs.report.report import write_report
from runtime.recording.streamed import open_log

_WRITTEN = ResultFolder(("compare.json", "compare.md", "report.html"), "rows")


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareSettings(FitChoices):
    """Settings of `symgen compare`."""

    options = "robot methods out recipe run friction cutoff overwrite"
    log: Log
    other: Path | None = argument_field(
        None,
        metavar="RESULT",
        help="Folder of a second result. LOG is then the folder of the first one.",
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
    r"""Compare all identification methods on one log, or two results with each other.

    \b
    symgen compare fr3_simulated
    symgen compare log.csv --methods map,pc-ols,ols --friction auto --cutoff 10
    symgen compare log.csv --settings controller=log.loop.toml --friction viscous,coulomb
    symgen compare results/monday-map results/friday-map

    All methods have the same training, validation and test parts, the same weights and the same
    cut-off. The table shows their errors, consistency and time, and sentences by rule say which
    of them to use. A method that needs more than the log offers, or that fails, is a row with the
    reason. Of a streamed log only methods that need no single samples are compared.

    Written to the folder --out: compare.json, compare.md and report.html. Ctrl-C keeps the rows
    that are complete.

    Of two results of one robot, report.html and the terminal show settings and torque errors side
    by side, and every mass, base parameter and friction coefficient with its difference in standard
    deviations; --verbose prints all tables.
    """
    if given.other is not None:
        _compare_results(given, given.other)
        return
    lib = open_robot(given.robot, given.yes)
    folder = given.out or Path("results") / f"{Path(given.log).stem}-compare"
    _WRITTEN.require(folder, given, given.overwrite)
    names = listed(given.methods, tuple(METHODS), "--methods") if given.methods else None
    place = given.truth or beside(given.log)
    known = read_truth(place, lib) if place else None
    known_methods = set(names or ()) <= set(methods_from_statistics())
    needs_whole = given.controller or given.friction == AUTO or not known_methods
    streams = False if given.stream is None and needs_whole else given.stream
    wanted = Settings(
        friction=given.friction,
        coulomb_speed=given.coulomb_speed,
        cutoff=given.cutoff,
        rate=given.rate,
        regressor=given.regressor,
        split=split_of(given.split),
        refit=False,
    )
    usable = usable_columns(names or tuple(METHODS))
    with counting(state()) as bar:
        opened = open_log(given.log, given.recipe, given.run, lib.joint_names, streams)
        data = prepared_log(opened, lib, wanted, usable, shown_progress(bar, "compare", lib.name))
    options: dict[str, Any] = {
        "preparation": data.preparation,
        "split": data.split,
        "friction": data.friction,
        "seed": given.seed,
    }
    notes = data.notes
    if data.streamed is None:
        names = names or tuple(METHODS)
        inputs = inputs_of(names, lib, controller=given.controller)
        assembly = assemble(data.recording, lib, inputs=inputs, **options)
    else:
        names = names or methods_from_statistics()
        for name in names:
            require_streamable(name)
        others = ", ".join(name for name in METHODS if name not in methods_from_statistics())
        say(
            f"streaming {data.streamed.rows} rows of {data.streamed.name}; --settings stream=false "
            f"reads them as a whole, which {others} need"
        )
        assembly = assemble_streamed(data.streamed, lib, **options)
        notes = (*notes, assembly.source_note)
    same = ("recipe", "run", "friction", "coulomb_speed", "cutoff", "rate", "split", "regressor")
    settings = {name: getattr(given, name) for name in (*same, "seed")} | {
        "methods": list(names),
        "stream": streams,
        "loop": None if given.controller is None else given.controller.name,
        "truth": None if place is None else place.name,
    }
    comparison = _with_progress(assembly, names, known)
    _WRITTEN.begin(folder, given)
    _finish(write_comparison(comparison, folder, command_line(), settings, notes), folder)


def _compare_results(given: CompareSettings, other: Path) -> None:
    taken = {"log", "other", "out", "overwrite"}
    if wrong := given.stated_beyond(taken):
        raise IdentificationError(
            f"two results are compared as they are, and {', '.join(wrong)} would change a fit; "
            "leave it out, or give a log in place of the results"
        )
    places = Path(given.log), other
    names = places[0].resolve().name, other.resolve().name
    names = names if names[0] != names[1] else (str(places[0]), str(other))
    first, second = (read_result(place, with_learned=True) for place in places)
    both = compare_results(first, second, names)
    folder = (
        given.out or Path("results") / f"{places[0].resolve().name}-{other.resolve().name}-compare"
    )
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
    assembly: Assembly, names: tuple[str, ...], truth: TrueParameters | None
) -> Comparison:
    with counting(state()) as progress:
        task = progress.add_task("comparing", total=len(names), state="")

        def started(method: str) -> None:
            done = names.index(method)
            progress.update(task, description=method, completed=done, state="")

        def reported(iteration: int, best: float) -> None:
            progress.update(task, state=f"iteration {iteration}, best validation loss {best:.6g}")

        return compare(assembly, names, truth=truth, started=started, progress=reported)


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
