"""`symgen report`."""

from pathlib import Path
from typing import Annotated

import typer

from runtime.cli.common import Overwrite, require_page
from runtime.common.files import require_unused
from runtime.common.terminal import command_line, say
from runtime.errors import IdentificationError
from runtime.outputs.report.report import REPORT_KINDS, write_report
from runtime.outputs.report.trends import write_trends


def report_command(
    results: Annotated[
        Path,
        typer.Argument(
            metavar="RESULTS",
            help="Folder written by identify, compare or reproduce, or a history of watch.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="HTML page; default report.html in the folder."),
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write all tables of reproduce as Markdown, too."),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Write all figures of reproduce as PNG, too."),
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.md",
            help="Write the tables between the markers <!-- reproduce --> of this Markdown file, "
            "with three pictures in the folder images beside it.",
        ),
    ] = None,
    readme: Annotated[bool, typer.Option("--readme", help="The same as --into README.md.")] = False,
    overwrite: Overwrite = False,
) -> None:
    r"""Write the results of a folder as one HTML page.

    \b
    symgen report results/first-map
    symgen report results/experiments --markdown tables.md --figures figures
    symgen report results/history.jsonl

    The page needs no network: its tables sort and its figures zoom. identify and compare write it
    themselves. Of a history it shows the trends over time and temperature.
    """
    is_history = results.is_file()
    kind = next((each for each in REPORT_KINDS.records() if each.accepts(results)), None)
    page = out or (results.with_suffix(".html") if is_history else results / "report.html")
    if out is None:
        require_page(page, overwrite)
    else:
        require_unused([out], overwrite)
    if is_history and not (markdown or figures or into or readme):
        written: tuple[Path, ...] = (write_trends(results, page),)
    elif kind is not None:
        place = Path("README.md") if readme else into
        require_unused([markdown] if markdown else [], overwrite, "--markdown")
        if figures is not None:
            require_unused(kind.pictures(results, figures), overwrite, "--figures")
        written = kind.write(
            results,
            page,
            tables_to=markdown,
            figures_to=figures,
            readme=place,
            command=command_line(),
        )
    elif markdown or figures or into or readme:
        raise IdentificationError(
            "--markdown, --figures, --into and --readme need a folder written by reproduce, got "
            f"'{results}'; leave these options out"
        )
    else:
        written = (write_report(results, page),)
    for path in written:
        say(f"report: {path}" if path == page else f"wrote:  {path}")
