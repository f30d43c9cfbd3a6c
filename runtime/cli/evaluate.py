"""`python -m runtime evaluate`, `report` and `locate`."""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from runtime import metrics
from runtime.cli.common import Robot, console, say, torque_table
from runtime.datasets import locate
from runtime.errors import RecordingError
from runtime.library import load
from runtime.library.manifest import PI_NAMES
from runtime.network import FrictionNet
from runtime.objective import samples_of
from runtime.plausibility import require_plausible
from runtime.preprocessing import prepare
from runtime.recording import Friction, read_recording
from runtime.results import error_facts

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
    facts = _read(result)
    lib = load(robot)
    if facts["joints"] != list(lib.joint_names):
        raise RecordingError(
            f"'{result}' identified {facts['robot']}, whose joints differ from those of "
            f"'{lib.name}'; name its robot with --robot"
        )
    recording = read_recording(log, recipe, run, lib.joint_names)
    require_plausible(recording, lib)
    terms = facts["friction"]
    prepared = prepare(recording, None, terms, lib=lib)
    samples = samples_of(prepared, lib)
    before = lib.inverse_dynamics(samples.q, samples.dq, samples.ddq, lib.pi0)
    after = lib.inverse_dynamics(samples.q, samples.dq, samples.ddq, facts["pi"])
    if terms.columns:
        after = after + samples.friction(facts["phi"])
    if facts["net"]:
        after = after + facts["net"].torque(samples.columns)
    errors = [metrics.torque_error(samples.tau, tau) for tau in (before, after)]
    figures: dict[str, Any] = {
        "robot": lib.name,
        "method": facts["method"],
        "joints": facts["joints"],
        "units": facts["units"],
        **error_facts(*errors),
    }
    if as_json:
        print(json.dumps(figures, indent=1))
    else:
        console.print(torque_table(figures))


def report_command(result: Result) -> None:
    """Write report.html again from result.json and predictions.npz."""
    from runtime.report import write_report  # matplotlib is slow to import

    say(f"report: {write_report(result)}")


def locate_command(
    name: Annotated[str, typer.Argument(help="Name of a known data set, such as panda_gaz.")],
) -> None:
    """Where a known data set lies; downloads it when it is not here."""
    say(str(locate(name)))


def _read(folder: Path) -> dict[str, Any]:
    """The facts that evaluate needs, with π and friction as arrays of the right shape."""
    try:
        facts = dict(json.loads((folder / "result.json").read_text(encoding="utf-8")))
        n = len(facts["joints"])
        terms = facts["friction"] or {"columns": [], "values": [[]] * n}
        read = {key: facts[key] for key in ("robot", "method", "joints", "units")}
        read["pi"] = np.array(facts["pi"], dtype=float)
        read["friction"] = Friction.from_facts(terms)
        read["phi"] = np.array(terms["values"], dtype=float)
        net = terms.get("net")
        read["net"] = net and FrictionNet(np.array(net["theta"]), np.array(net["scale"]))
        whole = len(read["units"]) == n and read["pi"].shape == (len(PI_NAMES) * n,)
        if not whole or read["phi"].shape != (n, len(read["friction"].columns)):
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, RecursionError, OverflowError):
        raise RecordingError(
            f"'{folder}' holds no valid result.json; give the folder that identify wrote"
        ) from None
    return read
