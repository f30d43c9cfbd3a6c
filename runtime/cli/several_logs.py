"""Several logs on the command line: which they are, what they carried, what they say together."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Column, Table

from runtime.cli.common import console, say
from runtime.cli.options import AUTO, Asked, read_data
from runtime.errors import IdentificationError
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.identification.several_logs import (
    LogAgreement,
    NamedLog,
    identify_logs,
    read_carried,
)
from runtime.library import Library

Logs = Annotated[
    list[str],
    typer.Argument(
        metavar="LOG...",
        help="CSV, NPZ, Parquet, MCAP, a ROS bag, a folder with a recipe, or a known data set such "
        "as panda_gaz; several are fitted together.",
    ),
]
PayloadOf = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LOG=FILE",
        help="A known payload that one of several logs carried: what the command payload wrote. "
        "Repeatable.",
    ),
]


def runs_of(logs: Sequence[str], run: str | None) -> list[tuple[str, str | None]]:
    """The logs with their runs; `--run 1,2,3` makes three of one."""
    if len(logs) == 1 and run is not None and "," in run:
        return [(logs[0], each.strip()) for each in run.split(",")]
    return [(log, run) for log in logs]


def identify_several(
    runs: Sequence[tuple[str, str | None]],
    lib: Library,
    settings: Settings,
    payload_of: Sequence[str],
    asked: Asked,
) -> tuple[Identification, LogAgreement]:
    """Identify one set of parameters from several logs, and compare the logs.

    Args:
        runs: logs, each with its run or None.
        lib: library of the robot.
        settings: as for `identify_logs`, without splitting and friction columns.
        payload_of: LOG=FILE of the known payloads.
        asked: options on how a log is read and prepared.

    Returns:
        The joint identification, and how well the logs agree.

    Raises:
        RuntimeFault: a log or an option is none.
    """
    if len(runs) < 2:
        raise IdentificationError("--payload-of belongs to a fit of several logs; name them all")
    if asked.stream:
        raise IdentificationError("several logs are read as a whole; leave out --stream")
    if (asked.friction or "").split(",")[0] == AUTO:
        raise IdentificationError(
            "a friction model is chosen on one log; name the columns with --friction"
        )
    if asked.regressor == AUTO:
        raise IdentificationError(
            "accelerations are judged log by log, but all logs are fitted alike; name the "
            "regressor with --regressor"
        )
    carried = _carried(payload_of, [log for log, _ in runs], lib)
    data = [read_data(lib, log, replace(asked, run=run, stream=False)) for log, run in runs]
    names = _names(runs)
    named = [
        NamedLog(name, each.recording, each.preparation, carried.get(log))
        for name, each, (log, _) in zip(names, data, runs, strict=True)
    ]
    with console.status(f"fitting {len(runs)} logs"):
        result, agreement = identify_logs(
            named,
            lib,
            settings,
            splitting=data[0].splitting,
            friction_columns=data[0].friction,
        )
    told = [
        f"{name}: {note}" for name, each in zip(names, data, strict=True) for note in each.notes
    ]
    return replace(result, notes=(*told, *result.notes)), agreement


def print_agreement(agreement: LogAgreement) -> None:
    """Leave-one-log-out and repeatability, as a table and a line."""
    table = Table(
        Column("log", overflow="fold"), title="Each log as the others predict it: torque error, %"
    )
    for head in ("payload kg", "URDF", "the others", "with its own offset", "its own fit"):
        table.add_column(head, justify="right")
    for log, mass in zip(agreement.left_out, agreement.carried, strict=True):
        errors = (log.before.overall, log.after.overall, log.with_offset.overall, log.alone)
        table.add_row(log.name, f"{mass:.3g}", *(f"{error:.3f}" for error in errors))
    console.print(table)
    say(f"repeatability: {agreement.sentence()}")


def _carried(payload_of: Sequence[str], logs: Sequence[str], lib: Library) -> dict[str, Any]:
    found = {}
    for text in payload_of:
        log, mark, file = text.rpartition("=")
        if not mark or log not in logs:
            raise IdentificationError(
                f"--payload-of expects LOG=FILE with a log of {', '.join(logs)}; got '{text}'"
            )
        found[log] = read_carried(Path(file), lib)
    return found


def _names(runs: Sequence[tuple[str, str | None]]) -> list[str]:
    """Short names of the logs, none twice."""
    same = len({log for log, _ in runs}) == 1
    names: list[str] = []
    for log, run in runs:
        name = f"run {run}" if same and run else Path(log).stem
        while name in names:
            name += "'"
        names.append(name)
    return names
