"""`symgen report`."""

from pathlib import Path
from typing import Annotated

import typer

from runtime.cli.common import command_line, say
from runtime.errors import IdentificationError


def report_command(
    results: Annotated[
        Path,
        typer.Argument(metavar="RESULTS", help="Folder of identify, of compare or of reproduce."),
    ],
    out: Annotated[Path | None, typer.Option(help="The page; default RESULTS/report.html.")] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="All tables of the experiments as Markdown.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for all figures of the experiments as PNG.")
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
) -> None:
    r"""Write the results of a folder as one HTML page.

    \b
    symgen report results/first-map
    symgen report results/experiments --markdown tables.md --figures figures
    """
    # matplotlib is slow to import
    from runtime.outputs.report import write_report
    from runtime.outputs.report.experiments import is_experiments, write_experiments

    page = out or results / "report.html"
    if is_experiments(results):
        place = Path("README.md") if readme else into
        written = write_experiments(
            results,
            page,
            tables_to=markdown,
            figures_to=figures,
            readme=place,
            command=command_line(),
        )
    elif markdown or figures or into or readme:
        raise IdentificationError(
            "--markdown, --figures, --into and --readme need the folder of experiments, and "
            f"'{results}' holds none; give the folder that reproduce wrote"
        )
    else:
        written = (write_report(results, page),)
    for path in written:
        say(f"report: {path}" if path == page else f"wrote:  {path}")
