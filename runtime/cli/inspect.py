"""`symgen inspect`: a log in, a table, sentences, a recipe and an exit code out."""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from runtime.cli.common import Robot, command_line, console, say
from runtime.cli.log_options import Log, Run
from runtime.errors import RecordingError
from runtime.files import replacing
from runtime.inspection import ERROR, INFO, WARNING, Inspection, inspect_log, recipe_text
from runtime.library import load

_COLOURS = {ERROR: "red", WARNING: "yellow", INFO: "dim"}


def inspect_command(
    log: Log,
    robot: Robot = "fr3",
    recipe: Annotated[
        str | None, typer.Option(help="TOML to read the log with; default is what identify takes.")
    ] = None,
    run: Run = None,
    recipe_out: Annotated[
        Path | None,
        typer.Option(
            help="Write the proposed recipe here. Without --recipe the files alone are asked, "
            "whatever recipe lies beside them."
        ),
    ] = None,
    log_rate: Annotated[
        float | None, typer.Option(help="Rate of a log without a clock, Hz.", min=1e-3)
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw clock, motion and torque: .png, .pdf or .svg.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Everything as JSON.")] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit code 1 for information, too.")
    ] = False,
) -> None:
    r"""Check a log and propose a recipe that reads it.

    Units, order and signs of the joints, clock, rest, saturation, corrupt rows, sign and unit of
    the torque, delay between q and τ, gravity, tools, and torques that no sensor has measured:
    each finding is one sentence with its numbers. Nothing is changed; --recipe-out writes what is
    proposed, for you to read and for identify to take.

    \b
    symgen inspect log.csv --robot my
    symgen inspect raw/ --robot my --recipe-out recipe.toml
    symgen identify raw/ --robot my --recipe recipe.toml
    Exit code: 0 nothing to do, 1 warnings or errors, 2 not readable.
    """
    lib = load(robot)
    bare = recipe_out is not None and recipe is None
    options: dict[str, Any] = {"bare": bare, "rate_hz": log_rate, "propose": recipe_out is not None}
    with console.status("asking the log"):
        found = inspect_log(log, lib, recipe, run, **options)
    if recipe_out is not None:
        _write_recipe(recipe_out, recipe_text(found).encode())
    if plot is not None:
        from runtime.outputs.report.log_figure import draw_log  # matplotlib is slow to import

        draw_log(found.recording, plot, found.rest)
    if as_json:
        print(json.dumps(_facts(found), indent=1, ensure_ascii=False, allow_nan=False))
    else:
        _show(found)
        for what, path in (("recipe", recipe_out), ("plot", plot)):
            if path is not None:
                say(f"{what}: {path}")
    todo = found.findings if strict else found.of_level(ERROR, WARNING)
    raise typer.Exit(int(bool(todo)))


def _write_recipe(path: Path, text: bytes) -> None:
    """Write the proposal, unless a recipe that says something else is there.

    Raises:
        RecordingError: it is; by hand or by `gains` it may hold what no log tells.
    """
    if path.is_file() and path.read_bytes() != text:
        raise RecordingError(
            f"'{path}' is there already and differs from what is proposed now; give --recipe-out "
            "another name and compare them, or remove the old one"
        )
    with replacing(path) as file:
        file.write(text)


def _show(found: Inspection) -> None:
    recording = found.recording
    rate = f", {recording.rate_hz:.4g} Hz" if len(recording) > 1 else ""
    title = f"{recording.name}: {len(recording)} rows, {recording.duration:.4g} s{rate}"
    table = Table("joint", title=title)
    for head in ("q from", "to", "RMS dq", "RMS τ", "max |τ|"):
        table.add_column(head, justify="right")
    names = recording.joint_names or [str(j + 1) for j in range(recording.n_joints)]
    for j, name in enumerate(names):
        cells = [f"{recording.q[:, j].min():.4g}", f"{recording.q[:, j].max():.4g}"]
        for values, largest in (
            (recording.dq, False),
            (recording.tau, False),
            (recording.tau, True),
        ):
            if values is None:
                cells.append("-")
            else:
                column = values[:, j]
                size = np.abs(column).max() if largest else np.sqrt(np.mean(column**2))
                cells.append(f"{size:.3g}")
        table.add_row(name, *cells)
    console.print(table)
    for finding in found.findings:
        colour = _COLOURS[finding.level]
        console.print(f"[{colour}]{finding.level}[/] {finding.kind}: ", end="", highlight=False)
        say(finding.sentence)
    count = {level: len(found.of_level(level)) for level in (ERROR, WARNING)}
    say(f"{count[ERROR]} error(s), {count[WARNING]} warning(s)")


def _facts(found: Inspection) -> dict[str, Any]:
    recording = found.recording
    return {
        "command": command_line(),
        "robot": found.robot,
        "log": recording.name,
        "rows": len(recording),
        "joints": recording.n_joints,
        "duration_s": recording.duration,
        "rate_hz": recording.rate_hz if len(recording) > 1 else None,
        "files": dict(recording.source),
        "history": list(recording.history),
        "findings": [
            {
                "kind": f.kind,
                "level": f.level,
                "trap": f.trap or None,
                "sentence": f.sentence,
                "evidence": f.evidence,
            }
            for f in found.findings
        ],
        "recipe": recipe_text(found),
    }
