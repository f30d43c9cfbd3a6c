"""Several logs of a commanded torque: both ends left out, dry friction chosen on the first."""

from collections.abc import Sequence
from dataclasses import replace

from runtime.cli.log_options import AUTO, PER_JOINT
from runtime.cli.prepared_log import LogOptions, PreparedLog
from runtime.estimators.regression.dry_friction_choice import with_dry_friction
from runtime.library import Library
from runtime.recording.commanded_torque import COMMANDED, without_ends
from runtime.recording.preprocessing import before_test


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
