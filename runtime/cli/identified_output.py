"""What `symgen identify` writes and prints of a result, and the table of its drives."""

import re
import shlex
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from runtime.cli.identify_settings import IdentifySettings
from runtime.common.tables import Table
from runtime.common.terminal import VERBOSE, command_line, program, say, show
from runtime.estimators.contradictions import FOLLOWS
from runtime.estimators.optimizers import Status
from runtime.identification.identified import Identification
from runtime.identification.posterior_file import spring_lines
from runtime.identification.result_file import write_result
from runtime.identification.result_record import ResultRecord
from runtime.identification.result_tables import error_table, share_table, tested_on
from runtime.identification.statistics_file import statistics_of, write_statistics
from runtime.outputs.model_files.export import write_urdf
from runtime.outputs.report.report import left_out_table, write_report

LEFT_OUT = "Leave one log out: torque error of each log"
STATISTICS = "statistics.npz"
"""Name of the file of the setting save_statistics."""

UNFINISHED = frozenset(
    end.value for end in (Status.INTERRUPTED, Status.MAX_ITERATIONS, Status.DIVERGED)
)
"""Ends of a method that the summary states."""


def finish(result: Identification, folder: Path, given: IdentifySettings, inspect: str) -> None:
    """Write all files of a result, then print it: a pipe that closes costs no file.

    inspect: command that inspects the log.
    """
    record = write_result(result, folder, command_line())
    files = _written(result, folder, given)
    for line in (*_summary(result, record, inspect, given.robot), *files):
        say(line)
    if VERBOSE.get():
        _print_details(result, record)


def command_after(doubt: str, inspect: str, record: ResultRecord, robot: str) -> str:
    """Command that follows a doubt, as it is typed; "" without one."""
    columns = () if record.friction is None else record.friction.columns
    again = command_line() + (" " if "--overwrite" in sys.argv else " --overwrite ")
    built = f"python -m symgen build --robot {shlex.quote(robot)} --name {record.robot}_tilted "
    commands = {  # after a space follows what was found
        r"--(?:delay|friction|cutoff) auto|--settings encoder_bias=true": again,
        r"columns of --friction": f"{again}--friction {','.join((*columns, 'offset'))}",
        r"\buse map\b": f"{again}--method map",
        r"--gravity=\S+": built,
        r"\bruntime gains\b": inspect.replace(" inspect ", " gains ", 1),
        r"\brecord\b": f"{program()} excite --robot {shlex.quote(robot)}",
        r"\binspect\b|(in|of) a recipe": "" if inspect in doubt else inspect,
    }
    for pattern, command in commands.items():
        if match := re.search(pattern, doubt):
            return command + match[0] if command.endswith(" ") else command
    return ""


def _summary(
    result: Identification, record: ResultRecord, inspect: str, robot: str
) -> Iterator[str]:
    """What a result comes to: at most one doubt, errors, share of friction, bodies, one advice."""
    known, shares = result.uncertainty, record.torque_error_percent
    if record.doubts:
        doubt = record.doubts[0].replace("python -m runtime inspect LOG", inspect)
        yield f"{'note' if doubt.endswith(FOLLOWS) else 'warning'}: {doubt}"
        if command := command_after(doubt, inspect, record, robot):
            yield f"run: {command}"
    if result.status in UNFINISHED:
        yield f"status: {result.status}"
    before, after = shares.before_overall or 0.0, shares.after_overall or 0.0
    yield f"torque error on {tested_on(record)} data: {before:.3f} → {after:.3f} %"
    if (between := shares.urdf_friction_overall) is not None:
        part = (before - between) / (before - after) if before > between > after else None
        share = "" if part is None else f", {100 * part:.0f} % of the decrease"
        yield f"friction: the URDF with friction fitted has {between:.3f} %{share}"
    smallest = float(result.relative_eigenvalues.min())
    verdict = "physically consistent" if result.is_consistent else "NOT physically consistent"
    count = f"all {len(record.links)} " if result.is_consistent else ""
    yield f"links: {count}{verdict}, smallest relative eigenvalue {smallest:.1e}"
    if record.sessions is not None:
        yield f"repeatability: {record.sessions.repeatability.sentence}"
    yield from delay_lines(record)
    if known is not None:
        yield (
            f"data: they determine {known.determined} of {len(known.beta_sigma)} independent "
            "combinations of parameters better than the prior does"
            + (
                f"; intervals assume torque gains known to {100 * known.gain_sigma:.2g} % (σ)"
                if known.gain_sigma
                else ""
            )
        )
        if not record.doubts:
            yield f"advice: {known.first_advice()}"


def _print_details(result: Identification, record: ResultRecord) -> None:
    """Tables, status, gap and all notes."""
    title = f"{record.robot}, {record.method}: torque error on {tested_on(record)} data"
    errors = (record.torque_error_percent, record.torque_rms)
    logs = record.sessions
    left_out = None if logs is None else replace(left_out_table(logs), title=LEFT_OUT)
    for table in (
        error_table(*record.rows_of_errors, *errors, title),
        share_table(record),
        drive_table(record),
        left_out,
    ):
        if table is not None:
            show(table)
    say(f"status: {result.status}")
    say(
        f"gap to the convex optimum (PC-OLS on the same rows and weights): {100 * result.gap:.3f} %"
    )
    if record.uncertainty is not None:
        say(f"advice: {record.uncertainty.advice}")
    say(f"time of the method: {result.seconds:.3f} s")
    for warning in record.warnings:
        say(f"note: {warning}")


def _written(result: Identification, folder: Path, given: IdentifySettings) -> list[str]:
    """Write the files beside result.json; a line for each. Those of an earlier result go."""
    lines = []
    if result.is_consistent:
        lines.append(f"URDF:   {folder / 'identified.urdf'} ({_exported(result, folder)})")
    else:
        (folder / "identified.urdf").unlink(missing_ok=True)
        lines.append("URDF:   not written, because the model is not physically consistent")
    if given.report:
        lines.append(f"report: {write_report(folder)}")
    else:
        (folder / "report.html").unlink(missing_ok=True)
    if given.save_statistics:
        write_statistics(statistics_of(result, folder.resolve().name), folder / STATISTICS)
        lines.append(f"statistics: {folder / STATISTICS}")
    else:
        (folder / STATISTICS).unlink(missing_ok=True)
    return lines


def _exported(result: Identification, folder: Path) -> str:

    path = folder / "identified.urdf"
    return write_urdf(result.lib, result.pi, path, result.friction, result.usual_phi)


def drive_table(record: ResultRecord) -> Table | None:
    """Drives of result.json, value ± standard deviation; None where none was estimated."""
    drives = record.drive or ()
    names = ("armature", "viscous", "coulomb", "offset", "encoder_bias")
    kept = [name for name in names if any(getattr(each, name) is not None for each in drives)]
    if not kept:
        return None
    rows = tuple(
        (each.joint, *(_cell(getattr(each, x), getattr(each.sigma, x)) for x in kept))
        for each in drives
    )
    head = ("joint", *(name.replace("_", " ") for name in kept))
    return Table(head, rows, title="Drives: value ± standard deviation, SI units")


def delay_lines(record: ResultRecord) -> Iterator[str]:
    """Delays of the torque, joints of unknown bias, and springs."""
    drives = record.drive or ()
    for delay in record.delays if drives else ():
        yield f"delay of the torque: {_cell(delay.value, delay.sigma, 1e3)} ms"
    unknown = [each.joint for each in drives if each.encoder_bias_verdict.startswith("not ident")]
    if unknown:
        yield f"encoder bias: not identifiable from this motion at {', '.join(unknown)}"
    yield from spring_lines(record.friction)


def _cell(value: Any, sigma: Any, factor: float = 1.0) -> str:
    if value is None:
        return "–"
    spread = "" if sigma is None else f" ± {factor * sigma:.2g}"
    return f"{factor * value:.4g}{spread}"
