"""Several logs on the command line: their runs and payloads, the joint fit and its agreement."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Column, Table

from runtime.cli.log_options import AUTO
from runtime.cli.prepared_log import LogOptions, read_prepared_log, usable_columns
from runtime.common.terminal import console, say
from runtime.errors import IdentificationError
from runtime.estimators.methods import chosen_method
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.library import Library

if TYPE_CHECKING:
    from runtime.identification.several_logs.identify import LogAgreement

Logs = Annotated[
    list[str],
    typer.Argument(
        metavar="LOG...",
        help="One or several logs: CSV, NPZ, Parquet, HDF5, MCAP or ROS bags, folders with a "
        "recipe, or names of known data sets such as panda_gaz.",
    ),
]
PayloadOf = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LOG=FILE",
        help="Known payload of one of several logs: the payload.json that the command payload "
        "wrote; repeatable.",
    ),
]


def runs_of(logs: Sequence[str], run: str | None) -> list[tuple[str, str | None]]:
    """Logs with their runs; `--run 1,2,3` of one log gives three."""
    if len(logs) == 1 and run is not None and "," in run:
        return [(logs[0], each.strip()) for each in run.split(",")]
    return [(log, run) for log in logs]


def _require_joinable(count: int, options: LogOptions) -> None:
    """Refuse one log, and options that read or choose on one log alone."""
    if count < 2:
        raise IdentificationError(
            "--payload-of needs several logs, got one; give also the logs without this payload"
        )
    if options.stream:
        raise IdentificationError(
            "several logs are read as a whole, but --stream is given; leave it out"
        )
    if (options.friction or "").split(",")[0] == AUTO:
        raise IdentificationError(
            "a friction model is chosen on one log, but several are given; give --friction COLUMNS"
        )
    if options.regressor == AUTO:
        raise IdentificationError(
            "--regressor auto checks the accelerations of one log, but several are given; give "
            "--regressor acceleration, momentum or energy"
        )


def identify_several(
    runs: Sequence[tuple[str, str | None]],
    lib: Library,
    settings: Settings,
    payload_of: Sequence[str],
    options: LogOptions,
    delay: str | None = None,
) -> "tuple[Identification, LogAgreement]":
    """Identify one set of parameters from several logs, and compare the logs."""
    from runtime.cli.several_drives import with_drives
    from runtime.identification.several_logs.identify import identify_logs
    from runtime.identification.several_logs.joint_fit import NamedLog

    _require_joinable(len(runs), options)
    carried = _carried(payload_of, [log for log, _ in runs], lib)
    method = chosen_method(settings.method, settings.preset, settings.prior)
    usable = usable_columns([method])  # of the first log; the others get its friction model
    data = [
        read_prepared_log(
            lib,
            log,
            replace(options, run=run, stream=False),
            () if k else usable,
            settings.robust,
        )
        for k, (log, run) in enumerate(runs)
    ]
    if any(each.recording.gains is not None for each in data):
        raise IdentificationError(
            "the gains of motor currents are estimated from one log, but several are given; run "
            "identify or gains on one of them, and write its gains into the recipe"
        )
    data = with_drives(data, lib, options, delay)
    names = _names(runs)
    delays: list[dict[str, Any]] = []
    if delay is not None:
        from runtime.cli.several_delays import delay_notes, with_delays

        data, delays = with_delays(names, data, lib, settings, delay)
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
    notes = [
        f"{name}: {note}" for name, each in zip(names, data, strict=True) for note in each.notes
    ]
    if delays:
        notes += delay_notes(delays)
        agreement = replace(agreement, delays=tuple(delays))
    return replace(result, notes=(*notes, *result.notes)), agreement


def print_agreement(agreement: "LogAgreement") -> None:
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


def _carried(payload_of: Sequence[str], logs: Sequence[str], lib: Library) -> dict[str, Any]:
    from runtime.identification.several_logs.joint_fit import read_carried

    payloads = {}
    for text in payload_of:
        log, mark, file = text.rpartition("=")
        if not mark or log not in logs:
            raise IdentificationError(
                f"--payload-of expects LOG=FILE with a log of {', '.join(logs)}; got '{text}'"
            )
        payloads[log] = read_carried(Path(file), lib)
    return payloads


def _names(runs: Sequence[tuple[str, str | None]]) -> list[str]:
    """Short names of the logs, all different."""
    same = len({log for log, _ in runs}) == 1
    names: list[str] = []
    for log, run in runs:
        name = f"run {run}" if same and run else Path(log).stem
        while name in names:
            name += "'"
        names.append(name)
    return names
