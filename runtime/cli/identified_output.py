"""What `symgen identify` writes and prints of a result."""

from dataclasses import dataclass
from pathlib import Path

from rich.table import Column, Table

from runtime.cli.common import share_tables, tested_on, torque_table
from runtime.cli.drive import print_drives
from runtime.common.terminal import command_line, console, say
from runtime.identification.identified import Identification
from runtime.identification.result_file import write_result
from runtime.identification.result_warnings import still_joints
from runtime.identification.several_logs.agreement import LogAgreement
from runtime.identification.statistics_file import statistics_of, write_statistics
from runtime.outputs.model_files.export import write_urdf
from runtime.outputs.report.report import write_report

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
    percent, rms = record.torque_error_percent, record.torque_rms
    for table in (torque_table(record, percent, rms, tested_on(record)), *share_tables(record)):
        console.print(table)
    print_drives(record)
    if result.agreement is not None:
        print_agreement(result.agreement)
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


def print_agreement(agreement: LogAgreement) -> None:
    """Print the leave-one-log-out errors and the repeatability."""
    table = Table(
        Column("log", overflow="fold"), title="Leave one log out: torque error of each log, %"
    )
    for head in ("payload kg", "URDF", "fit of the others", "with its offset", "fit of this log"):
        table.add_column(head, justify="right")
    for log, mass in zip(agreement.left_out, agreement.carried, strict=True):
        errors = (log.before.overall, log.after.overall, log.with_offset.overall, log.alone)
        table.add_row(log.name, f"{mass:.3g}", *(f"{error:.3f}" for error in errors))
    console.print(table)
    say(f"repeatability: {agreement.sentence()}")
