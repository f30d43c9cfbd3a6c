"""`identify --delay` of several logs: one delay per log, estimated from each log alone."""

import dataclasses
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from runtime.cli.drive import delayed
from runtime.cli.log_options import AUTO, PER_JOINT
from runtime.cli.prepared_log import PreparedLog
from runtime.common.terminal import console
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.identification.drive.result import DriveRequest
from runtime.identification.settings import Settings
from runtime.library import Library


def with_delays(
    names: Sequence[str], data: Sequence[PreparedLog], lib: Library, settings: Settings, delay: str
) -> tuple[list[PreparedLog], list[dict[str, Any]]]:
    """The logs without the delays of their torques."""
    if delay not in {AUTO, PER_JOINT}:
        moved = [replace(each, preparation=delayed(each, delay, False)) for each in data]
        return moved, []
    from runtime.identification.drive.estimate import identify_drive

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
