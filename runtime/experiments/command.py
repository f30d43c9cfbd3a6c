"""`symgen reproduce`."""

from dataclasses import dataclass
from pathlib import Path

import typer
from rich.progress import TaskID, TextColumn, TimeRemainingColumn

from runtime.cli.common import RobotChoices, counting, open_robot
from runtime.common.commands import INTERRUPTED
from runtime.common.settings import argument_field, method_field, output_field
from runtime.common.tables import Table
from runtime.common.terminal import command_line, say, show
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
from runtime.library import Library

EVERYTHING, LISTED = "all", "list"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReproduceSettings(RobotChoices):
    """Settings of `symgen reproduce`."""

    options = "trials out fresh"
    what: str = argument_field(
        metavar="ID|all|list",
        help="Id of a table or figure; all for every one; list for their ids and states.",
    )
    trials: int = method_field(
        DEFAULT_TRIALS, help="Number of Monte Carlo trials; default that of the document.", min=1
    )
    out: Path = output_field(
        Path("results/experiments"),
        metavar="FOLDER",
        help="Folder of the results, with one folder per study.",
    )
    seed: int | None = method_field(
        help="Seed of the trials; the designed motions stay the same. Default 0.", min=0
    )
    scheduler: str | None = method_field(
        metavar="tcp://HOST:PORT", help="Compute on the workers of this dask cluster instead."
    )
    fresh: bool = method_field(False, help="Delete the trials in the folder and compute all again.")


def reproduce_command(given: ReproduceSettings) -> None:
    r"""Reproduce the tables and figures of the document.

    \b
    symgen reproduce list
    symgen reproduce table-5.2 --trials 20
    symgen reproduce all

    The numbers stand beside those of the document and those of our best method. Several ids share
    a study. Trials that are in the folder are not computed again, so an interrupted run continues
    with the same command. Written per study: trials.parquet, series.npz, and result.json with
    settings, hash, versions and seeds; report makes a page of them.
    """
    if given.what == LISTED:
        _list(open_robot(given.robot, given.yes), Request(given.out, given.trials, given.seed))
        return
    studies = list(STUDIES.values()) if given.what == EVERYTHING else [study_of(given.what)]
    lib = open_robot(given.robot, given.yes)
    with counting(TextColumn("left"), TimeRemainingColumn()) as progress:
        tasks: dict[str, TaskID] = {}

        def reported(name: str, done: int, total: int) -> None:
            if name not in tasks:
                tasks[name] = progress.add_task(STUDIES[name].title, total=total)
            progress.update(tasks[name], completed=done)

        wanted = given.values("out", "trials", "seed", "scheduler", "fresh")
        request = Request(**wanted, command=command_line(), progress=reported, notify=say)
        try:
            results = [reproduce(lib, study, request) for study in studies]
        except KeyboardInterrupt:
            progress.stop()
            say("interrupted; complete chunks are kept, and the same command continues from them")
            raise typer.Exit(INTERRUPTED) from None
    for study, facts in zip(studies, results, strict=True):
        place = given.out / study.name / RESULT
        say(f"{study.title}: {place} (config {facts['config_hash'][:12]})")


def _list(lib: Library, request: Request) -> None:
    rows = []
    states = {name: str(state_of(lib, study, request)) for name, study in STUDIES.items()}
    for name, study in IDS.items():
        title = next(view.title for view in study.views if view.id == name)
        rows.append((name, title, study.name, states[study.name]))
    show(Table(("id", "title", "study", "state"), tuple(rows)))
