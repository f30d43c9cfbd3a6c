"""`symgen report`."""

import webbrowser
from dataclasses import dataclass
from pathlib import Path

from runtime.cli.common import Overwrite, require_page
from runtime.common.files import require_unused
from runtime.common.settings import Choices, argument_field, output_field
from runtime.common.terminal import command_line, say
from runtime.errors import IdentificationError
from runtime.outputs.report.report import REPORT_KINDS, write_report
from runtime.outputs.report.trends import write_trends


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportSettings(Choices):
    """Settings of `symgen report`."""

    options = "out open overwrite"
    results: Path = argument_field(
        metavar="RESULTS",
        help="Folder written by identify, compare or reproduce, or a history of watch.",
    )
    out: Path | None = output_field(
        metavar="FILE", help="HTML page; default report.html in the folder."
    )
    markdown: Path | None = output_field(
        metavar="FILE", help="Write all tables of reproduce as Markdown, too."
    )
    figures: Path | None = output_field(
        metavar="FOLDER", help="Write all figures of reproduce as PNG, too."
    )
    into: Path | None = output_field(
        metavar="FILE.md",
        help="Write the tables between the markers <!-- reproduce --> of this Markdown file, "
        "with three pictures in the folder images beside it.",
    )
    readme: bool = output_field(False, help="The same as --settings into=README.md.")
    open: bool = output_field(False, help="Show the page in the web browser.")
    overwrite: Overwrite = False


def report_command(given: ReportSettings) -> None:
    r"""Write the results of a folder as one HTML page.

    \b
    symgen report results/fr3_simulated-map --open
    symgen report results/experiments --settings markdown=tables.md --settings figures=figures
    symgen report results/history.jsonl

    The page needs no network: its tables sort and its figures zoom. identify and compare write it
    themselves. Of a history it shows the trends over time and temperature.
    """
    is_history = given.results.is_file()
    kind = next((each for each in REPORT_KINDS.records() if each.accepts(given.results)), None)
    page = given.out or (
        given.results.with_suffix(".html") if is_history else given.results / "report.html"
    )
    if given.out is None:
        require_page(page, given.overwrite)
    else:
        require_unused([given.out], given.overwrite)
    if is_history and not (given.markdown or given.figures or given.into or given.readme):
        written: tuple[Path, ...] = (write_trends(given.results, page),)
    elif kind is not None:
        place = Path("README.md") if given.readme else given.into
        require_unused(
            [given.markdown] if given.markdown else [], given.overwrite, "the setting markdown"
        )
        if given.figures is not None:
            require_unused(
                kind.pictures(given.results, given.figures), given.overwrite, "the setting figures"
            )
        into = {"tables_to": given.markdown, "figures_to": given.figures, "readme": place}
        written = kind.write(given.results, page, **into, command=command_line())
    elif given.markdown or given.figures or given.into or given.readme:
        raise IdentificationError(
            "the settings markdown, figures, into and readme need a folder written by reproduce, "
            f"got '{given.results}'; leave them out"
        )
    else:
        written = (write_report(given.results, page),)
    for path in written:
        say(f"report: {path}" if path == page else f"wrote:  {path}")
    if given.open:
        webbrowser.open(page.resolve().as_uri())
