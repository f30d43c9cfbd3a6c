"""What `symgen identify` writes and prints of a result."""

from dataclasses import dataclass, replace
from pathlib import Path

from runtime.cli.drive import print_drives
from runtime.common.terminal import command_line, say, show
from runtime.identification.identified import Identification
from runtime.identification.result_file import write_result
from runtime.identification.result_record import SessionsPart
from runtime.identification.result_tables import error_table, share_table, tested_on
from runtime.identification.result_warnings import still_joints
from runtime.identification.statistics_file import statistics_of, write_statistics
from runtime.outputs.model_files.export import write_urdf
from runtime.outputs.report.report import write_report
from runtime.outputs.report.several_logs import left_out_table

STATISTICS = "statistics.npz"
"""Name of the file of `--save-statistics`."""


@dataclass(frozen=True, slots=True)
class Outputs:
    """Files that options switch on or off.

    Attributes:
        report: value of --report.
        statistics: value of --save-statistics.
    """

    report: bool
    statistics: bool


def finish(result: Identification, folder: Path, outputs: Outputs) -> None:
    """Write all files of a result, then print it: a pipe that closes costs no file."""
    record = write_result(result, folder, command_line())
    files = _written(result, folder, outputs)
    first = still_joints(result)
    for warning in first:
        say(f"warning: {warning}")
    title = f"{record.robot}, {record.method}: torque error on {tested_on(record)} data"
    errors = (record.torque_error_percent, record.torque_rms)
    for table in (error_table(*record.rows_of_errors, *errors, title), share_table(record)):
        if table is not None:
            show(table)
    print_drives(record)
    if record.sessions is not None:
        print_sessions(record.sessions)
    if result.uncertainty is not None:
        unknowns = len(result.uncertainty.beta_sigma)
        say(
            f"data: they determine {result.uncertainty.determined} of {unknowns} independent "
            "combinations of parameters better than the prior does"
        )
    say(f"status: {result.status}")
    verdict = "physically consistent" if result.is_consistent else "NOT physically consistent"
    smallest = float(result.relative_eigenvalues.min())
    say(f"links: all {len(record.links)} {verdict}, smallest relative eigenvalue {smallest:.1e}"
        if result.is_consistent
        else f"links: {verdict}, smallest relative eigenvalue {smallest:.1e}")  # fmt: skip
    say(
        f"gap to the convex optimum (PC-OLS on the same rows and weights): {100 * result.gap:.3f} %"
    )
    if result.uncertainty is not None:
        say(f"advice: {result.uncertainty.advice()}")
    say(f"time of the method: {result.seconds:.3f} s")
    for warning in record.warnings[len(first) :]:
        say(f"note: {warning}")
    for line in files:
        say(line)


def _written(result: Identification, folder: Path, outputs: Outputs) -> list[str]:
    """Write the files beside result.json; a line for each. Those of an earlier result go."""
    lines = []
    if result.is_consistent:
        lines.append(f"URDF:   {folder / 'identified.urdf'} ({_exported(result, folder)})")
    else:
        (folder / "identified.urdf").unlink(missing_ok=True)
        lines.append("URDF:   not written, because the model is not physically consistent")
    if outputs.report:
        lines.append(f"report: {write_report(folder)}")
    else:
        (folder / "report.html").unlink(missing_ok=True)
    if outputs.statistics:
        write_statistics(statistics_of(result, folder.resolve().name), folder / STATISTICS)
        lines.append(f"statistics: {folder / STATISTICS}")
    else:
        (folder / STATISTICS).unlink(missing_ok=True)
    return lines


def _exported(result: Identification, folder: Path) -> str:

    path = folder / "identified.urdf"
    return write_urdf(result.lib, result.pi, path, result.friction, result.usual_phi)


def print_sessions(logs: SessionsPart) -> None:
    """Print the leave-one-log-out errors and the repeatability."""
    title = "Leave one log out: torque error of each log"
    show(replace(left_out_table(logs), title=title))
    say(f"repeatability: {logs.repeatability.sentence}")
