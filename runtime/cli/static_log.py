"""Logs of poses at rest among those that commands read."""

from runtime.cli.prepared_log import LogOptions, PreparedLog, friction_of
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction import OFFSET
from runtime.recording.static_poses import static_poses


def log_at_rest(
    recording: Recording, options: LogOptions, parts: Split | None
) -> PreparedLog | None:
    """Rows of a log of poses that were reached from both sides."""
    filters = (options.cutoff, options.rate, options.regressor)
    if recording.has_unknown_gains or any(each is not None for each in filters):
        return None
    rows = static_poses(recording)
    if rows is None:
        return None
    wanted = friction_of(recording, options.friction, None)
    has_offset = wanted is not None and OFFSET.name in wanted.columns
    note = (
        f"the log contains {len(rows)} poses at rest that were reached from both sides: the fit "
        "takes the mean of each pair, in which Coulomb friction cancels, and determines the "
        "gravity torque alone; give --cutoff to identify from its motion"
    )
    terms = Friction((OFFSET.name,) if has_offset else ())
    return PreparedLog(rows, Preparation(), parts, terms, (note,), is_at_rest=True)
