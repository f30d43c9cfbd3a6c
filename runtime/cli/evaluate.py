"""`python -m runtime evaluate` and `locate`."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from runtime.cli.common import console, preparation_of, say, torque_table
from runtime.cli.options import Rate
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.identified import torque_of
from runtime.identification.result_file import error_facts
from runtime.identification.saved_result import read_result, require_model
from runtime.library import load
from runtime.recording import Preparation, read_recording
from runtime.recording.datasets import locate
from runtime.recording.plausibility import require_plausible
from runtime.recording.preprocessing import is_filtered, prepare

ALIKE = "the log is prepared as that of identify was; --cutoff and --rate replace it"
RAW = (
    "the model was identified from a low-passed log, this one is raw: "
    "give --cutoff and --rate as there"
)

Result = Annotated[Path, typer.Argument(help="Folder that identify wrote.")]


def evaluate_command(
    result: Result,
    log: Annotated[str, typer.Argument(metavar="LOG", help="A recording, as for identify.")],
    robot: Annotated[
        str | None, typer.Option(help="Name or folder of the robot; default: the result's.")
    ] = None,
    recipe: Annotated[str | None, typer.Option(help="How to read the log.")] = None,
    run: Annotated[str | None, typer.Option(help="Which run of the recipe.")] = None,
    cutoff: Annotated[
        float | None,
        typer.Option(
            help="Low-pass q, dq, tau at this frequency, Hz: that of identify; default from the "
            "recipe."
        ),
    ] = None,
    rate: Rate = None,
    as_json: Annotated[bool, typer.Option("--json", help="The figures as JSON.")] = False,
) -> None:
    r"""Evaluate an identified model on another log.

    Percentages compare in one band only: a wider one has more of the noise of the torque.

    \b
    python -m runtime evaluate results/first-map second.csv
    python -m runtime evaluate results/first-map second.csv --cutoff 20 --rate 100

    A log without a preparation of its own is prepared as that of identify was: a model of
    low-passed torque cannot predict the noise that is left in a raw one.
    """
    saved = read_result(result)
    lib = load(robot or saved.robot)
    notes = list(require_model(saved, lib, result))
    recording = read_recording(log, recipe, run, lib.joint_names)
    require_plausible(recording, lib)
    terms = saved.friction
    preparation = preparation_of(recording, cutoff, rate)
    if preparation is None and recording.preparation == Preparation() != saved.preparation:
        preparation = saved.preparation
        notes.append(ALIKE)
    prepared = prepare(recording, preparation, terms, lib=lib)
    samples = samples_of(prepared, lib)
    after = torque_of(lib, samples, saved.pi, saved.phi, saved.net)
    both = (samples.rigid(lib, lib.pi0), after)
    errors = [metrics.torque_error(samples.tau, tau) for tau in both]
    if is_filtered(saved.history) and not is_filtered(prepared.history):
        notes.append(RAW)
    figures: dict[str, Any] = {
        "robot": lib.name,
        "method": saved.method,
        "joints": list(saved.joints),
        "units": list(saved.units),
        **error_facts(*errors),
        "notes": notes,
    }
    if as_json:
        print(json.dumps(figures, indent=1))
    else:
        console.print(torque_table(figures))
        for note in notes:
            say(f"note: {note}")


def locate_command(
    name: Annotated[str, typer.Argument(help="Name of a known data set, such as panda_gaz.")],
) -> None:
    """Print the folder of a known data set.

    A data set that is not on this machine is downloaded first.
    """
    say(str(locate(name)))
