"""`python -m runtime evaluate` and `locate`."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from runtime import metrics
from runtime.cli.common import Robot, console, say, torque_table
from runtime.datasets import locate
from runtime.library import load
from runtime.objective import samples_of
from runtime.plausibility import require_plausible
from runtime.preprocessing import prepare
from runtime.recording import read_recording
from runtime.results import error_facts
from runtime.saved import read_result, require_robot

Result = Annotated[Path, typer.Argument(help="Folder that identify wrote.")]


def evaluate_command(
    result: Result,
    log: Annotated[str, typer.Argument(metavar="LOG", help="A recording, as for identify.")],
    robot: Robot = "fr3",
    recipe: Annotated[str | None, typer.Option(help="How to read the log.")] = None,
    run: Annotated[str | None, typer.Option(help="Which run of the recipe.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The figures as JSON.")] = False,
) -> None:
    r"""Torque errors of an identified model on another recording, before and after.

    \b
    python -m runtime evaluate results/first-map second.csv --robot my
    """
    saved = read_result(result)
    lib = load(robot)
    require_robot(saved, lib, result)
    recording = read_recording(log, recipe, run, lib.joint_names)
    require_plausible(recording, lib)
    terms = saved.friction
    prepared = prepare(recording, None, terms, lib=lib)
    samples = samples_of(prepared, lib)
    before = samples.rigid(lib, lib.pi0)
    after = samples.rigid(lib, saved.pi)
    if terms.columns:
        after = after + samples.friction(saved.phi)
    if saved.net:
        after = after + saved.net.torque(samples.columns)
    errors = [metrics.torque_error(samples.tau, tau) for tau in (before, after)]
    figures: dict[str, Any] = {
        "robot": lib.name,
        "method": saved.method,
        "joints": list(saved.joints),
        "units": list(saved.units),
        **error_facts(*errors),
    }
    if as_json:
        print(json.dumps(figures, indent=1))
    else:
        console.print(torque_table(figures))


def locate_command(
    name: Annotated[str, typer.Argument(help="Name of a known data set, such as panda_gaz.")],
) -> None:
    """Where a known data set lies; downloads it when it is not here."""
    say(str(locate(name)))
