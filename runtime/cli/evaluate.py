"""`symgen evaluate`."""

import json
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from runtime.cli.common import Yes, open_robot, torque_table
from runtime.cli.free_base import print_errors
from runtime.cli.log_options import Recipe, Run
from runtime.common.terminal import console, say
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.free_base.evaluate import free_base_errors
from runtime.identification.identified import torque_of
from runtime.identification.mass_audit import audit_mass
from runtime.identification.prepared_log import preparation_of
from runtime.identification.result_file import error_parts
from runtime.identification.saved_result import SavedResult, read_result, require_model
from runtime.library import Library
from runtime.outputs.model_files.joint_friction import joint_friction
from runtime.recording import Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.free_base import read_free_base
from runtime.recording.preprocessing import is_filtered, prepare
from runtime.recording.row_marks import SAME

ALIKE = "the log is prepared as the log of identify; --cutoff and --rate change that"
RAW = (
    "the model was identified from a low-passed log, but this log is not filtered; give the same "
    "--cutoff and --rate as identify"
)

SEEN = (
    "the model was fitted to {:.0f} % of the rows of this log: these are errors of the fit, not of "
    "a test; give a log that identify has not read"
)
UNLIKE = 100.0
"""Torque error above which the model is worse than no model, %."""
WORSE = (
    "an error of {:.0f} % is larger than the torque itself: order, sign or unit of the joints, the "
    "payload or the robot of this log differ from those of identify; run: symgen inspect {}"
)

_FILTER = ("filter", "cutoff_hz", "window_s", "order")
"""Fields of a preparation that decide which band the torque has."""

Result = Annotated[Path, typer.Argument(metavar="RESULT", help="Folder written by identify.")]
RobotOfResult = Annotated[
    str | None, typer.Option(help="Name or folder of the robot; default that of the result.")
]
CutoffOfResult = Annotated[
    float | None,
    typer.Option(
        metavar="HZ",
        help="Cut-off of the zero-phase low-pass of q, dq and tau, Hz; default from the recipe, "
        "else that of identify.",
    ),
]
RateOfResult = Annotated[
    float | None,
    typer.Option(
        metavar="HZ",
        help="Rate of rows to which the log is decimated, Hz; default from the recipe, else that "
        "of identify.",
    ),
]


def evaluate_command(
    result: Result,
    log: Annotated[str, typer.Argument(metavar="LOG", help="Another log of the same robot.")],
    robot: RobotOfResult = None,
    yes: Yes = False,
    recipe: Recipe = None,
    run: Run = None,
    cutoff: CutoffOfResult = None,
    rate: RateOfResult = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead.")] = False,
) -> None:
    r"""Evaluate an identified model on another log.

    Printed per joint: the torque error of the URDF and of the identified model, in percent of the
    RMS torque and in N·m or N. Errors of two logs compare only where both have the same cut-off: a
    wider band holds more torque noise. The mass matrix M(q), rotors included, is audited over the
    joint limits: positive definite by proof or by search.

    \b
    symgen evaluate results/first-map second.csv
    symgen evaluate results/first-map second.csv --cutoff 20 --rate 100

    A log whose recipe names no filter is prepared in the same way as the log of identify.
    """
    saved = read_result(result, with_learned=True)
    lib = open_robot(robot or saved.robot, yes, takes_free_base=saved.is_free)
    notes = list(require_model(saved, lib, result))
    if saved.is_free:
        _walking(saved, lib, log, cutoff, notes, as_json)
        return
    recording = saved.log_of(log, lib, recipe, run)
    require_plausible(recording, lib)
    terms = saved.friction
    preparation = preparation_of(recording, cutoff, rate)
    if preparation is None and recording.preparation == Preparation() != saved.preparation:
        preparation = saved.preparation
        notes.append(ALIKE)
    prepared = prepare(recording, preparation, terms, lib=lib)
    samples = samples_of(prepared, lib)
    after = torque_of(lib, samples, saved.pi, saved.phi, saved.learned)
    both = (samples.rigid(lib, lib.pi0), after)
    errors = [metrics.torque_error(samples.tau, tau) for tau in both]
    if is_filtered(saved.history) and not is_filtered(prepared.history):
        notes.append(RAW)
    else:
        notes += _other_filter(saved, prepared)
    percent, rms = error_parts(*errors)
    fitted = saved.fitted_share(recording)
    if fitted > SAME:
        notes.insert(0, SEEN.format(100 * fitted))
    if percent.after_overall is not None and percent.after_overall > UNLIKE:
        notes.insert(0, WORSE.format(percent.after_overall, log))
    rotor = joint_friction(lib, terms, saved.phi).filled("armature")
    audit = audit_mass(lib, saved.pi, rotor)
    figures: dict[str, Any] = {
        "robot": lib.name,
        "method": saved.method,
        "joints": list(saved.joints),
        "units": list(saved.units),
        "torque_error_percent": msgspec.to_builtins(percent),
        "torque_rms": msgspec.to_builtins(rms),
        "mass_matrix": audit.to_facts(),
        "fitted_share": fitted,
        "notes": notes,
    }
    if as_json:
        print(json.dumps(figures, indent=1))
    else:
        console.print(torque_table(saved, percent, rms, "fitted" if fitted > SAME else "test"))
        say(f"{audit.sentence()}.")
        for note in notes:
            say(f"note: {note}")


def _walking(
    saved: SavedResult,
    lib: Library,
    log: str,
    cutoff: float | None,
    notes: list[str],
    as_json: bool,
) -> None:
    """Print the errors of the rows of a free base, low-passed as the log of identify."""
    band = saved.preparation.cutoff_hz if cutoff is None else cutoff
    errors = free_base_errors(read_free_base(Path(log)), lib, saved, band)
    columns = {key: getattr(errors, key).tolist() for key in ("size", "before", "after")}
    if as_json:
        facts = {"robot": lib.name, "rows": list(errors.names), "rms": columns, "notes": notes}
        print(json.dumps(facts, indent=1))
        return
    print_errors(f"{lib.name}: errors on {Path(log).name}", errors.names, *columns.values())
    for note in notes:
        say(f"note: {note}")


def _other_filter(saved: SavedResult, prepared: Recording) -> list[str]:
    """Sentence on filters of identify and evaluate that differ; none where they agree."""
    then, now = saved.preparation, prepared.prepared or Preparation()
    unknown = then.filter == "none" and is_filtered(saved.history)  # results of earlier versions
    if unknown or all(getattr(then, key) == getattr(now, key) for key in _FILTER):
        return []
    return [
        f"the model was identified with {_filter_of(then)}, this log is evaluated with "
        f"{_filter_of(now)}: the errors do not compare; give --cutoff and --rate of identify"
    ]


def _filter_of(preparation: Preparation) -> str:
    if preparation.filter == "none":
        return "no filter"
    if preparation.filter == "butterworth":
        return f"a low-pass at {preparation.cutoff_hz:g} Hz of order {preparation.order}"
    kind = "a mean" if preparation.filter == "average" else "a Savitzky–Golay filter"
    return f"{kind} over {preparation.window_s:g} s"
