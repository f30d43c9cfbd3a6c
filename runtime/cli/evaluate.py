"""`symgen evaluate`."""

from dataclasses import dataclass
from pathlib import Path

from runtime.cli.free_base import print_errors
from runtime.cli.log_options import LaterLogChoices, open_result
from runtime.common.files import json_text
from runtime.common.settings import output_field
from runtime.common.terminal import say, say_notes, show
from runtime.identification.evaluation import evaluate, position_table
from runtime.identification.free_base.result import free_base_errors
from runtime.identification.result_tables import error_table
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
    done = evaluate(
        given.result,
        given.log,
        lib,
        recipe=given.recipe,
        run=given.run,
        cutoff=given.cutoff,
        rate=given.rate,
    )
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
