"""`symgen identify` of a log that does not fit into memory."""

from dataclasses import replace
from typing import Any

import numpy as np

from runtime.cli.prepared_log import PreparedLog
from runtime.common.terminal import console, say
from runtime.errors import IdentificationError
from runtime.estimators.methods import chosen_method
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording import StreamedRecording


def is_streamable(method: str | None, preset: str | None) -> bool:
    """Whether a method works on streamed rows."""
    from runtime.identification.long_logs.identify import require_streamable

    try:
        require_streamable(chosen_method(method, preset, None), preset)
    except IdentificationError:
        return False
    return True


def streamed_result(
    log: StreamedRecording,
    data: PreparedLog,
    lib: Library,
    settings: Settings,
    delay: str | None = None,
) -> Identification:
    """Identify from a log that is read piece by piece."""
    from runtime.identification.long_logs.identify import identify_streamed

    facts: list[dict[str, Any]] = []
    if delay is not None:
        from runtime.cli.several_delays import with_delays

        (data,), facts = with_delays((log.name,), (data,), lib, settings, delay)
    say(f"streaming {log.rows} rows of {log.name}; --no-stream reads the log as a whole")
    with console.status("streaming") as status:
        result = identify_streamed(
            log,
            lib,
            settings,
            preparation=data.preparation,
            splitting=data.splitting,
            friction_columns=data.friction,
            progress=status.update,
        )
    return _with_delay(result, facts[0], len(data.recording)) if facts else result


def _with_delay(result: Identification, facts: dict[str, Any], rows: int) -> Identification:
    """The result with the delay of the first rows."""
    from runtime.cli.several_delays import delay_notes
    from runtime.identification.drive.estimate import BIAS_PRIOR
    from runtime.identification.drive.result import DriveFit

    note = f"{delay_notes((facts,))[0]}, from the first {rows} rows"
    unknown = np.full(result.lib.n_joints, np.nan)
    width = result.phi.shape[1]
    known = facts["value"] is not None
    drive = DriveFit(
        delay=np.atleast_1d(facts["value"]) if known else np.zeros(0),
        delay_sigma=np.atleast_1d(facts["sigma"]) if known else np.zeros(0),
        bias=unknown,
        bias_sigma=unknown,
        bias_prior=BIAS_PRIOR,
        phi_sigma=np.full(result.phi.shape, np.nan),
        phi_covariance=np.full((len(unknown), width, width), np.nan),
    )
    return replace(result, drive=drive, notes=(note, *result.notes))
