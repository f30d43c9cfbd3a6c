"""Several logs on the command line: their runs and payloads, the joint fit and its agreement.

Of commanded torques both ends are left out, and dry friction is chosen on the first log. The delay
of --delay is one per log, estimated from each log alone.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Column, Table

from runtime.cli.drive import delayed
from runtime.cli.log_options import AUTO, PER_JOINT
from runtime.cli.prepared_log import LogOptions, PreparedLog, read_prepared_log, usable_columns
from runtime.common.terminal import console, say
from runtime.errors import IdentificationError
from runtime.estimators.methods import chosen_method
from runtime.estimators.regression.dry_friction_choice import with_dry_friction
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.identification.drive.estimate import identify_drive
from runtime.identification.drive.result import DriveRequest
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.identification.several_logs.identify import LogAgreement, identify_logs
from runtime.identification.several_logs.joint_fit import NamedLog, read_carried
from runtime.library import Library
from runtime.recording.commanded_torque import COMMANDED, without_ends
from runtime.recording.preprocessing import before_test

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
) -> tuple[Identification, LogAgreement]:
    """Identify one set of parameters from several logs, and compare the logs."""
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


def _carried(payload_of: Sequence[str], logs: Sequence[str], lib: Library) -> dict[str, Any]:

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


def with_drives(
    data: Sequence[PreparedLog], lib: Library, options: LogOptions, delay: str | None
) -> list[PreparedLog]:
    """The logs as one log of a commanded torque is prepared."""
    ready = [_without_ends(each) for each in data]
    first, named = ready[0], options.friction or options.coulomb_speed
    recipe, terms = first.recording.recipe, first.friction
    is_named = named is not None or (recipe is not None and recipe.friction is not None)
    if is_named or terms is None or first.preparation is None or not _is_commanded(first):
        return ready
    seen = before_test(first.recording, first.splitting)
    late = delay in {AUTO, PER_JOINT}
    terms, sentence = with_dry_friction(seen, lib, first.preparation, terms, late)
    notes = (*first.notes, sentence) if sentence else first.notes
    return [replace(first, friction=terms, notes=notes), *ready[1:]]


def _is_commanded(log: PreparedLog) -> bool:
    """Whether the log has a motion with a commanded torque, as it was read."""
    recording = log.recording
    is_read = recording.columns is None and not log.is_at_rest
    return recording.torque_source == COMMANDED and is_read


def _without_ends(log: PreparedLog) -> PreparedLog:
    """The log without both ends of a commanded torque."""
    if not _is_commanded(log):
        return log
    usual = log.preparation or log.recording.preparation
    return replace(log, preparation=without_ends(log.recording, usual))


def with_delays(
    names: Sequence[str], data: Sequence[PreparedLog], lib: Library, settings: Settings, delay: str
) -> tuple[list[PreparedLog], list[dict[str, Any]]]:
    """The logs without the delays of their torques."""
    if delay not in {AUTO, PER_JOINT}:
        moved = [replace(each, preparation=delayed(each, delay, False)) for each in data]
        return moved, []

    request = DriveRequest(delay=True, per_joint=delay == PER_JOINT, bias=False)
    logs, facts = [], []
    for name, each in zip(names, data, strict=True):
        delayed(each, delay, False)  # refuses poses at rest
        alone = dataclasses.replace(
            settings,
            preparation=each.preparation,
            splitting=each.splitting,
            friction_columns=data[0].friction,
            refit=False,
            certify=False,
        )
        with console.status(f"estimating the delay of {name}"):
            drive = identify_drive(each.recording, lib, alone, request).drive
        if drive is None or not drive.delay.size:
            facts.append({"name": name, "value": None, "sigma": None})
            logs.append(each)
            continue
        late = [float(x) for x in sign_of_delay(each.recording) * drive.delay]
        usual = each.preparation or each.recording.preparation
        shift = late[0] if len(late) == 1 else tuple(late)
        ready = dataclasses.replace(usual, torque_delay_s=shift)
        logs.append(replace(each, preparation=ready))
        value, sigma = drive.delay.tolist(), drive.delay_sigma.tolist()
        one = len(value) == 1
        facts.append(
            {"name": name, "value": value[0] if one else value, "sigma": sigma[0] if one else sigma}
        )
    return logs, facts


def delay_notes(facts: Sequence[dict[str, Any]]) -> list[str]:
    """One sentence per log on its delay."""
    notes = []
    for each in facts:
        value, sigma = each["value"], each["sigma"]
        if value is None:
            notes.append(
                f"{each['name']}: the log does not determine a delay, and none was taken; record a "
                "faster motion"
            )
        elif isinstance(value, list):
            late = ", ".join(f"{1e3 * x:.1f}" for x in value)
            notes.append(f"{each['name']}: delays of the torques of the joints {late} ms")
        else:
            notes.append(
                f"{each['name']}: delay of the torque {1e3 * value:.2f} ± {1e3 * sigma:.2g} ms"
            )
    return notes
