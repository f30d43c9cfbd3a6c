"""Drives of several logs: ends of commanded torques, dry friction of the first, a delay per log."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from runtime.estimators.regression.dry_friction_choice import with_dry_friction
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.identification.drive.estimate import identify_drive
from runtime.identification.drive.requested import delayed
from runtime.identification.drive.result import DriveRequest
from runtime.identification.prepared_log import PreparedLog
from runtime.identification.settings import AUTO, PER_JOINT, Settings
from runtime.identification.watch import SILENT, Watch
from runtime.library import Library
from runtime.recording.commanded_torque import without_ends
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.recipes.recipe import COMMANDED


def with_drives(data: Sequence[PreparedLog], lib: Library, settings: Settings) -> list[PreparedLog]:
    """The logs as one log of a commanded torque is prepared."""
    ready = [_without_ends(each) for each in data]
    first = ready[0]
    recipe, terms = first.recording.recipe, first.friction
    stated = settings.friction is not None or settings.coulomb_speed is not None
    is_named = stated or (recipe is not None and recipe.friction is not None)
    if is_named or terms is None or first.preparation is None or not _is_commanded(first):
        return ready
    seen = before_test(first.recording, first.split)
    late = settings.delay in {AUTO, PER_JOINT}
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
    names: Sequence[str],
    data: Sequence[PreparedLog],
    lib: Library,
    settings: Settings,
    watch: Watch = SILENT,
) -> tuple[list[PreparedLog], list[dict[str, Any]]]:
    """The logs without the delays of their torques; name, value and σ [s] of each.

    An unknown delay is estimated from every log alone, with the friction model of the first.
    """
    delay = settings.delay
    if delay not in {AUTO, PER_JOINT}:
        moved = [replace(each, preparation=delayed(each, delay, False)) for each in data]
        return moved, []
    request = DriveRequest(delay=True, per_joint=delay == PER_JOINT, bias=False)
    logs, facts = [], []
    for name, each in zip(names, data, strict=True):
        preparation = delayed(each, delay, False)  # refuses poses at rest
        alone = replace(
            each.settings(settings, preparation),
            friction=data[0].friction,
            refit=False,
            certify=False,
        )
        watch.step(f"estimating the delay of {name}")
        drive = identify_drive(each.recording, lib, alone, request).drive
        if drive is None or not drive.delay.size:
            facts.append({"name": name, "value": None, "sigma": None})
            logs.append(each)
            continue
        late = [float(x) for x in sign_of_delay(each.recording) * drive.delay]
        usual = each.preparation or each.recording.preparation
        shift = late[0] if len(late) == 1 else tuple(late)
        ready = replace(usual, torque_delay_s=shift)
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
