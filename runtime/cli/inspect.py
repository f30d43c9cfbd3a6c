"""`symgen inspect LOG`: findings about a log, and a recipe that reads it."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from runtime.cli.common import Overwrite, RobotChoices, open_robot, write_recipe
from runtime.cli.log_options import Log, Run
from runtime.common.files import json_text, require_unused
from runtime.common.settings import data_field, output_field
from runtime.common.tables import Table
from runtime.common.terminal import command_line, console, say, show
from runtime.errors import RecordingError
from runtime.inspection import ERROR, INFO, WARNING, Inspection, inspect_log, recipe_text
from runtime.inspection.inspection import skeleton_text
from runtime.library import Array
from runtime.outputs.report import canvas
from runtime.recording import Recording

GAP = 10.0  # time step of a gap, in median time steps
_STYLES = {ERROR: "red", WARNING: "yellow", INFO: "dim"}


@dataclass(frozen=True, slots=True, kw_only=True)
class InspectSettings(RobotChoices):
    """Settings of `symgen inspect`."""

    options = "robot recipe run recipe_out plot overwrite as_json strict"
    log: Log
    recipe: str | None = data_field(
        metavar="FILE", help="TOML that describes the log; default the one that identify would use."
    )
    run: Run = None
    recipe_out: Path | None = output_field(
        metavar="FILE",
        help="Write the proposed recipe. Without --recipe it is derived from the log files "
        "alone, and a recipe in their folder is ignored.",
    )
    log_rate: float | None = data_field(
        help="Rate at which a log without time stamps was recorded, Hz.", min=1e-3
    )
    plot: Path | None = output_field(
        metavar="FILE", help="Draw clock, motion and torque; .png, .pdf or .svg."
    )
    overwrite: Overwrite = False
    as_json: bool = output_field(False, "--json", help="Print JSON instead.")
    strict: bool = output_field(
        False, help="Exit code 1 also for findings of the level information."
    )


def inspect_command(given: InspectSettings) -> None:
    r"""Check a log and propose a recipe that reads it.

    \b
    symgen inspect fr3_simulated
    symgen inspect log.csv --robot my
    symgen inspect raw/ --robot my --recipe-out recipe.toml
    symgen identify raw/ --robot my --recipe recipe.toml

    Checked are units, order and signs of the joints, time stamps, phases of rest, saturation,
    corrupt rows, sign and unit of the torque, delay between q and τ, direction of gravity, an
    unmodelled tool, and torques that are computed instead of measured. Each finding is one
    sentence with its numbers. The log is not changed; --recipe-out writes a recipe for identify.

    Exit code: 0 no findings, 1 warnings or errors, 2 the log cannot be read.
    """
    lib = open_robot(given.robot, given.yes)
    require_unused([given.plot] if given.plot else [], given.overwrite, "--plot")
    bare = given.recipe_out is not None and given.recipe is None
    options: dict[str, Any] = {"bare": bare, "rate_hz": given.log_rate}
    options["propose"] = given.recipe_out is not None
    with console.status("inspecting the log"):
        try:
            inspection = inspect_log(given.log, lib, given.recipe, given.run, **options)
        except RecordingError as error:
            if given.recipe or not (given.recipe_out or "in a recipe" in str(error)):
                raise
            if given.recipe_out is None:
                raise RecordingError(
                    f"{error}; --recipe-out recipe.toml writes one that lists the columns of the "
                    "log, to be filled in"
                ) from None
            write_recipe(
                given.recipe_out, skeleton_text(given.log, lib.joint_names), given.overwrite
            )
            raise RecordingError(
                f"{error}; '{given.recipe_out}' lists the columns of the log, to be filled in"
            ) from None
    if given.recipe_out is not None:
        write_recipe(given.recipe_out, recipe_text(inspection), given.overwrite)
    if given.plot is not None:
        draw_log(inspection.recording, given.plot, inspection.rest)
    if given.as_json:
        print(json_text(_facts(inspection)), end="")
    else:
        _show(inspection)
        for what, path in (("recipe", given.recipe_out), ("plot", given.plot)):
            if path is not None:
                say(f"{what}: {path}")
    todo = inspection.findings if given.strict else inspection.of_level(ERROR, WARNING)
    raise typer.Exit(int(bool(todo)))


def draw_log(recording: Recording, path: Path, rest: Sequence[tuple[float, float]] = ()) -> None:
    """Figure of a recording, a panel per signal, with rests (from, to) [s] and gaps shaded."""
    signals = {"q [rad or m]": recording.q, "dq": recording.dq, "τ [N·m or N]": recording.tau}
    panels = {title: values for title, values in signals.items() if values is not None}
    t, steps = recording.t, np.diff(recording.t)
    names = recording.joint_names or tuple(str(j + 1) for j in range(recording.n_joints))
    with canvas.picture(path, (10.0, 1.8 * (len(panels) + 1)), dpi=120) as figure:
        axes = figure.subplots(len(panels) + 1, 1, sharex=True, squeeze=False)[:, 0]
        if len(steps):
            curve = canvas.thinned(t[1:], 1e3 * steps, canvas.POINTS)
            axes[0].plot(*curve, color=canvas.BLUE, linewidth=0.6)
            median, most = 1e3 * float(np.median(steps)), 1e3 * float(steps.max())
            if most > GAP * median:
                axes[0].set_yscale("log")
                axes[0].yaxis.set_major_formatter(lambda value, _: f"{value:g}")
                axes[0].yaxis.set_minor_formatter(lambda *_: "")
            else:
                axes[0].set_ylim(0.0, 1.1 * max(most, 1.5 * median))
        axes[0].set_title("time step [ms]")
        for axis, (title, values) in zip(axes[1:], panels.items(), strict=True):
            for j, name in enumerate(names):
                colour = canvas.CYCLE[j % len(canvas.CYCLE)]
                axis.plot(*canvas.thinned(t, values[:, j], canvas.POINTS), color=colour, label=name)
            axis.set_title(title)
        gaps = np.flatnonzero(steps > GAP * np.median(steps)) if len(steps) else steps[:0]
        for axis in axes:
            for start, end in rest:
                axis.axvspan(start, end, color=canvas.GREY, alpha=0.3, linewidth=0)
            for i in gaps:
                axis.axvspan(
                    t[int(i)], t[int(i) + 1], color=canvas.VERMILION, alpha=0.3, linewidth=0
                )
        axes[-1].set_xlabel("time [s]; grey: rest, red: gaps")
        axes[1].legend(loc="upper right", ncols=len(names), fontsize=6)


def _show(inspection: Inspection) -> None:
    recording = inspection.recording
    rate = f", {recording.rate_hz:.4g} Hz" if len(recording) > 1 else ""
    title = f"{recording.name}: {len(recording)} rows, {recording.duration:.4g} s{rate}"
    names = recording.joint_names or [str(j + 1) for j in range(recording.n_joints)]
    ends = recording.q.min(axis=0), recording.q.max(axis=0)
    columns = [[f"{x:.4g}" for x in end] for end in ends]
    for values, size in ((recording.dq, _rms), (recording.tau, _rms), (recording.tau, _largest)):
        columns.append(["-"] * len(names) if values is None else [f"{x:.3g}" for x in size(values)])
    rows = tuple(zip(names, *columns, strict=True))
    show(Table(("joint", "q from", "to", "RMS dq", "RMS τ", "max |τ|"), rows, title=title))
    for finding in inspection.findings:
        if finding.kind == "columns_by_content":
            show(_columns_table(finding.evidence["table"]))
        style = _STYLES[finding.level]
        console.print(f"[{style}]{finding.level}[/] {finding.kind}: ", end="", highlight=False)
        say(finding.sentence)
    count = {level: len(inspection.of_level(level)) for level in (ERROR, WARNING)}
    say(f"{count[ERROR]} error(s), {count[WARNING]} warning(s)")


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _largest(values: Array) -> Array:
    return np.asarray(np.abs(values).max(axis=0))


def _columns_table(rows: list[dict[str, Any]]) -> Table:
    """Columns of a file without header: numbers, signal and reason."""
    lines = []
    for row in rows:
        first, last = row["columns"][0], row["columns"][-1]
        span = str(first) if first == last else f"{first}–{last}"
        lines.append((span, row["signal"] or "not used", row["reason"]))
    title = "columns by content, counted from 0"
    return Table(("columns", "signal", "reason"), tuple(lines), title=title)


def _facts(inspection: Inspection) -> dict[str, Any]:
    recording = inspection.recording
    return {
        "command": command_line(),
        "robot": inspection.robot,
        "log": recording.name,
        "rows": len(recording),
        "joints": recording.n_joints,
        "duration_s": recording.duration,
        "rate_hz": recording.rate_hz if len(recording) > 1 else None,
        "files": dict(recording.source),
        "history": list(recording.history),
        "findings": [asdict(each) for each in inspection.findings],
        "recipe": recipe_text(inspection),
    }
