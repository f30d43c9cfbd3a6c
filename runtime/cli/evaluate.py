"""`symgen evaluate` and `symgen friction`: a result and another log of its robot."""

from dataclasses import dataclass
from pathlib import Path

from runtime.cli.common import Overwrite
from runtime.cli.free_base import print_errors
from runtime.cli.identify import urdf_line
from runtime.cli.log_options import LaterLogChoices, Parts, open_result, split_of
from runtime.common.files import json_text, require_unused
from runtime.common.settings import FILE, output_field
from runtime.common.tables import Table
from runtime.common.terminal import command_line, say, say_notes, show
from runtime.identification.evaluation import evaluate, position_table
from runtime.identification.free_base.result import free_base_errors
from runtime.identification.identified import torque_errors
from runtime.identification.kept_links import FrictionOfLog, identify_friction
from runtime.identification.prepared_log import preparation_of
from runtime.identification.result_file import write_result
from runtime.identification.result_record import error_parts
from runtime.identification.result_tables import error_table, tested_on
from runtime.identification.saved_result import SavedResult
from runtime.identification.settings import Settings
from runtime.outputs.report.report import write_report
from runtime.recording import Preparation
from runtime.recording.free_base import read_free_base


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateSettings(LaterLogChoices):
    """Settings of `symgen evaluate`."""

    options = "robot recipe run cutoff as_json"
    as_json: bool = output_field(False, "--json", help="Print JSON instead.")


def evaluate_command(given: EvaluateSettings) -> None:
    r"""Evaluate an identified model on another log.

    \b
    symgen evaluate results/fr3_simulated-map fr3_simulated
    symgen evaluate results/first-map second.csv --cutoff 20 --settings rate=100

    Printed per joint: the torque error of the URDF and of the identified model, in percent of the
    RMS torque and in N·m or N. Errors of two logs compare only where both have the same cut-off: a
    wider band holds more torque noise. The mass matrix M(q), rotors included, is audited over the
    joint limits: positive definite by proof or by search.

    Of a log with a control law, the model also predicts the positions, from the commands and the
    first row alone.

    A log whose recipe names no filter is prepared in the same way as the log of identify.
    """
    saved, lib, notes = open_result(given, given.result, learned=True, free_base=True)
    if saved.record.is_free:  # rows of a free base, low-passed as the log of identify
        band = saved.preparation.cutoff_hz if given.cutoff is None else given.cutoff
        names, of_rows = free_base_errors(read_free_base(Path(given.log)), lib, saved, band)
        if given.as_json:
            facts = {"robot": lib.name, "rows": list(names), "rms": of_rows, "notes": list(notes)}
            print(json_text(facts, allow_nan=True), end="")
            return
        print_errors(f"{lib.name}: errors on {Path(given.log).name}", names, *of_rows.values())
        say_notes(notes)
        return
    done = evaluate(given.result, given.log, lib, **given.values("recipe", "run", "cutoff", "rate"))
    if given.as_json:
        print(json_text(done.to_facts(), allow_nan=True), end="")
        return
    errors = done.torque_error_percent, done.torque_rms
    part = "test" if done.is_test else "fitted"
    title = f"{saved.record.robot}, {saved.record.method}: torque error on {part} data"
    show(error_table(saved.record.joints, saved.record.units, *errors, title))
    if done.position_errors is not None:
        show(position_table(saved.record.joints, done.position_errors))
    say(f"{done.mass_matrix.sentence()}.")
    say_notes(done.notes)


_WRITTEN = ("result.json", "predictions.npz", "identified.urdf", "report.html", FILE)
# Files of a result that do not hold for other friction.
_STALE = ("posterior.npz", "statistics.npz")


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionSettings(LaterLogChoices):
    """Settings of `symgen friction`."""

    options = "robot out recipe run cutoff overwrite"
    out: Path | None = output_field(
        metavar="FOLDER", help="Folder of the result; default results/LOG-friction."
    )
    split: Parts = None
    overwrite: Overwrite = False


def friction_command(given: FrictionSettings) -> None:
    r"""Identify friction anew and keep the links of an earlier result.

    \b
    symgen friction results/fr3_simulated-map fr3_simulated
    symgen friction results/first today.csv
    symgen friction results/first today.csv --cutoff 10 --out results/today

    Friction changes with temperature, wear and instruments, the links do not. The columns are those
    of the result, and its coefficients count as their prior: what the log does not excite stays.

    Written to the folder --out: result.json, identified.urdf and report.html, which all commands
    read that take a folder of identify; intervals of the links stay those of RESULT. A log whose
    recipe names no filter is prepared in the same way as the log of identify. Errors are those of
    the test part by a fit that has not used it; the friction is then fitted to all rows.
    """
    folder = given.out or Path("results") / f"{Path(given.log).stem}-friction"
    require_unused((folder / name for name in (*_WRITTEN, *_STALE)), given.overwrite)
    saved, lib, notes = open_result(given, given.result)
    recording = saved.log_of(given.log, lib, given.recipe, given.run)
    preparation = preparation_of(recording, given.cutoff, given.rate)
    if preparation is None and recording.preparation == Preparation():
        preparation = saved.preparation.at_rate(recording.rate_hz)
    settings = Settings(preparation=preparation, split=split_of(given.split))
    renewed = identify_friction(recording, lib, saved, settings)
    record = write_result(renewed.result, folder, command_line())
    given.write(folder)
    for name in _STALE:
        (folder / name).unlink(missing_ok=True)
    errors = error_parts(renewed.earlier, torque_errors(renewed.result)[1])
    title = f"{record.robot}, {record.method}: torque error on {tested_on(record)} data"
    note = "before: friction of the earlier result"
    table = error_table(*record.rows_of_errors, *errors, title, note)
    for each in (table, _coefficients(renewed, saved)):
        show(each)
    say_notes((*notes, *record.warnings))
    say(urdf_line(renewed.result, folder))
    say(f"report: {write_report(folder)}")


def _coefficients(renewed: FrictionOfLog, saved: SavedResult) -> Table:
    rows: list[tuple[str, ...]] = []
    names = renewed.result.train.column_names
    for k, joint in enumerate(saved.record.joints):
        for c, name in enumerate(names):
            values, sigma = (saved.phi[k, c], renewed.result.phi[k, c]), renewed.sigma[k, c]
            if any(values):
                shown = f"{sigma:.2g}" if sigma else "kept"
                rows.append((joint, name, *(f"{x:.4g}" for x in values), shown))
    head = ("joint", "column", "before", "now", "σ")
    return Table(head, tuple(rows), title="friction coefficients, SI units")
