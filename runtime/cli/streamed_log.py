"""`symgen identify` of a log that does not fit into memory."""

from runtime.cli.common import console, say
from runtime.cli.prepared_log import PreparedLog
from runtime.errors import IdentificationError
from runtime.estimators.methods import chosen_method
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording import StreamedRecording


def is_streamable(method: str | None, preset: str | None) -> bool:
    """Whether a method works on streamed rows.

    Args:
        method: value of --method.
        preset: value of --preset.

    Returns:
        True if it needs compressed statistics only.
    """
    from runtime.identification.long_logs import require_streamable

    try:
        require_streamable(chosen_method(method, preset, None), preset)
    except IdentificationError:
        return False
    return True


def streamed_result(
    log: StreamedRecording, data: PreparedLog, lib: Library, settings: Settings
) -> Identification:
    """Identify from a log that is read piece by piece.

    Args:
        log: the streamed rows.
        data: preparation, split and friction of the log.
        lib: library of the robot.
        settings: of the identification.

    Returns:
        The result.
    """
    from runtime.identification.long_logs import identify_streamed

    say(f"streaming {log.rows} rows of {log.name}; --no-stream reads the log as a whole")
    with console.status("streaming") as status:
        return identify_streamed(
            log,
            lib,
            settings,
            preparation=data.preparation,
            splitting=data.splitting,
            friction_columns=data.friction,
            progress=status.update,
        )
