"""What `symgen identify` writes and prints of a result."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runtime.cli.common import share_table, torque_table
from runtime.cli.drive import print_drives
from runtime.cli.several_logs import print_agreement
from runtime.common.terminal import command_line, console, say
from runtime.identification.friction_intervals import spring_lines
from runtime.identification.identified import Identification
from runtime.identification.result_file import write_result
from runtime.identification.result_warnings import still_joints

if TYPE_CHECKING:
    from runtime.identification.several_logs.identify import LogAgreement

STATISTICS = "statistics.npz"
"""Name of the file of `--save-statistics`."""


class Outputs(NamedTuple):
    """Files that options switch on or off.

    Attributes:
        report: value of --report.
        statistics: value of --save-statistics.
    """

    report: bool
    statistics: bool


def finish(
    result: Identification,
    folder: Path,
    outputs: Outputs,
    agreement: "LogAgreement | None" = None,
) -> None:
    """Write and print a result."""
    facts = write_result(result, folder, command_line(), agreement.facts() if agreement else None)
    first = still_joints(result)
    for warning in first:
        say(f"warning: {warning}")
    console.print(torque_table(facts))
    shares = share_table(facts)
    if shares is not None:
        console.print(shares)
    print_drives(facts)
    _print_springs(facts)
    if agreement is not None:
        print_agreement(agreement)
    if result.uncertainty is not None:
        unknowns = len(result.uncertainty.beta_sigma)
        say(
            f"data: they determine {result.uncertainty.determined} of {unknowns} independent "
            "combinations of parameters better than the prior does"
        )
    say(f"status: {result.status}")
    verdict = "physically consistent" if result.is_consistent else "NOT physically consistent"
    smallest = float(result.relative_eigenvalues.min())
    say(f"links: all {len(facts['links'])} {verdict}, smallest relative eigenvalue {smallest:.1e}"
        if result.is_consistent
        else f"links: {verdict}, smallest relative eigenvalue {smallest:.1e}")  # fmt: skip
    say(
        f"gap to the convex optimum (PC-OLS on the same rows and weights): {100 * result.gap:.3f} %"
    )
    if result.uncertainty is not None:
        say(f"advice: {result.uncertainty.advice()}")
    say(f"time of the method: {result.seconds:.3f} s")
    for warning in facts["warnings"][len(first) :]:
        say(f"note: {warning}")
    if result.is_consistent:
        say(f"URDF:   {folder / 'identified.urdf'} ({_exported(result, folder)})")
    else:
        (folder / "identified.urdf").unlink(missing_ok=True)  # of a result that this one replaces
        say("URDF:   not written, because the model is not physically consistent")
    if outputs.report:
        from runtime.outputs.report import write_report  # its template engine is slow to import

        say(f"report: {write_report(folder)}")
    else:
        (folder / "report.html").unlink(missing_ok=True)  # of a result that this one replaces
    if outputs.statistics:
        from runtime.identification.statistics_file import statistics_of, write_statistics

        write_statistics(statistics_of(result, folder.resolve().name), folder / STATISTICS)
        say(f"statistics: {folder / STATISTICS}")
    else:
        (folder / STATISTICS).unlink(missing_ok=True)  # of a result that this one replaces


def _print_springs(facts: Mapping[str, Any]) -> None:
    for line in spring_lines(facts["friction"]):
        say(line)


def _exported(result: Identification, folder: Path) -> str:
    from runtime.outputs.model_files import write_urdf

    path = folder / "identified.urdf"
    return write_urdf(result.lib, result.pi, path, result.friction, result.usual_phi)
