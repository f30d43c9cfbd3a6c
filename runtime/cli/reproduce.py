"""`symgen reproduce`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import TextColumn, TimeRemainingColumn
from rich.table import Table

from runtime.cli.common import INTERRUPTED, Robot, command_line, console, say
from runtime.cli.progress import counting
from runtime.experiments import (
    DEFAULT_TRIALS,
    IDS,
    RESULT,
    STUDIES,
    Request,
    reproduce,
    state_of,
    study_of,
)
from runtime.library import Library, load

EVERYTHING, LISTED = "all", "list"


def reproduce_command(
    what: Annotated[
        str,
        typer.Argument(metavar="ID|all|list", help="A table or figure, all of them, or a list."),
    ],
    robot: Robot = "fr3",
    trials: Annotated[
        int, typer.Option(help="Monte Carlo trials, as the document has them.", min=1)
    ] = DEFAULT_TRIALS,
    out: Annotated[Path, typer.Option(help="Folder; every study has one of its own in it.")] = Path(
        "results/experiments"
    ),
    seed: Annotated[
        int | None,
        typer.Option(help="Of the trials; the designed motions stay. Default 0.", min=0),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a dask scheduler, as tcp://host:8786: chunks go there."),
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Throw the trials away that are there, and start anew.")
    ] = False,
) -> None:
    r"""Reproduce the tables and figures of the document.

    \b
    symgen reproduce list
    symgen reproduce table-5.2 --trials 20
    symgen reproduce all

    Several ids share a study; what is computed already is taken from the folder, and a run that
    was interrupted or killed goes on where it ended. Written per study: trials.parquet,
    series.npz and result.json with config, hash, versions and seeds.
    """
    if what == LISTED:
        _list(load(robot), Request(out, trials, seed))
        return
    studies = list(STUDIES.values()) if what == EVERYTHING else [study_of(what)]
    lib = load(robot)
    with counting(TextColumn("left"), TimeRemainingColumn()) as progress:
        tasks: dict[str, int] = {}

        def reported(name: str, done: int, total: int) -> None:
            if name not in tasks:
                tasks[name] = progress.add_task(STUDIES[name].title, total=total)
            progress.update(tasks[name], completed=done)  # type: ignore[arg-type]

        request = Request(
            out=out,
            trials=trials,
            seed=seed,
            scheduler=scheduler,
            fresh=fresh,
            command=command_line(),
            progress=reported,
            notify=say,
        )
        try:
            found = [reproduce(lib, study, request) for study in studies]
        except KeyboardInterrupt:
            progress.stop()
            say("interrupted; finished chunks are kept, the same command goes on from them")
            raise typer.Exit(INTERRUPTED) from None
    for study, facts in zip(studies, found, strict=True):
        place = out / study.name / RESULT
        say(f"{study.title}: {place} (config {facts['config_hash'][:12]})")


def _list(lib: Library, request: Request) -> None:
    table = Table("id", "title", "study", "state")
    states = {name: str(state_of(lib, study, request)) for name, study in STUDIES.items()}
    for name, study in IDS.items():
        title = next(view.title for view in study.views if view.id == name)
        table.add_row(name, title, study.name, states[study.name])
    console.print(table)
