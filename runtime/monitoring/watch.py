"""Has a robot changed since its model was identified? Logs of other days, beside its result.

Logs are prepared as that of the result unless their recipe states a preparation. The usual change
of a healthy robot is that of logs of reference, and is assumed without them.
"""

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import RecordingError
from runtime.estimators.choice.regressor_choice import passing
from runtime.identification.posterior_file import read_posterior
from runtime.identification.result_file import NewResult, opened, write_result
from runtime.identification.saved_result import SavedResult
from runtime.identification.several_logs import distinct
from runtime.library import Library
from runtime.monitoring import drift
from runtime.monitoring.model import model_of
from runtime.monitoring.noise import read_held_out, read_test_rows
from runtime.recording import Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.free_base import FreeBaseRecording, read_free_base
from runtime.recording.preprocessing import prepare
from runtime.recording.row_marks import row_hashes, row_marks, share_of_rows

__all__ = ["watch"]

KNOWN = 0.5  # share of rows of the model or of a reference log from which a log is no later one
AnyLog = str | PathLike[str] | Recording | FreeBaseRecording  # a file, or its log as it was read


@one_blas_thread
def watch(
    result: NewResult | str | PathLike[str],
    logs: AnyLog | Sequence[AnyLog],
    lib: Library | None = None,
    *,
    references: Sequence[AnyLog] = (),
    recipe: str | None = None,
) -> list[drift.Verdict]:
    """Test whether a robot has changed since its model was identified, as the command does.

    Tested are gain, bias and drift of every torque sensor, friction and its warming, every link, a
    body on the tip, all links together, and a delay of the torque.

    Args:
        result: of `runtime.identify`, or the folder that identify wrote.
        logs: later logs of the robot, as files or as they were read.
        lib: library of the robot; None is that of the result.
        references: logs of other days of the healthy robot, three or more.
        recipe: name or file of the recipe of the logs; None finds it beside them or in the result.

    Returns:
        Per log whether the robot has changed, the part that explains most, its size and p-value.

    Raises:
        RuntimeFault: no result, another robot, or a log that tells no change from noise.
    """
    with _folder_of(result) as folder:
        saved, lib, _ = opened(folder, lib)
        if not (later := _each(logs)):
            raise RecordingError("expected a log or several, got none; give a later log")
        return watched(folder, saved, lib, later, _each(references), recipe)[0]


def watched(
    folder: Path,
    saved: SavedResult,
    lib: Library,
    logs: Sequence[AnyLog],
    references: Sequence[AnyLog] = (),
    recipe: str | None = None,
) -> tuple[list[drift.Verdict], list[Recording]]:
    """Whether each log is that of the robot of a result in its folder, and its joints as read."""
    root = read_posterior(folder, saved, lib).of_readings().root(lib)
    tested: list[drift.WatchedLog]
    if saved.record.is_free:
        walks, others = ([_walk(log, recipe) for log in each] for each in (logs, references))
        baseline = drift.free_baseline_of(lib, saved, root, walks[0], others)
        joints, healthy = ([log.joints for log in each] for each in (walks, others))
        tested = [*walks]
    else:
        model = model_of(saved, lib)
        sigma = np.sqrt(np.mean(read_held_out(folder, model).rest ** 2, axis=0))
        joints, healthy = (_joint_logs(saved, lib, each, recipe) for each in (logs, references))
        tested = [_prepared(lib, saved, log) for log in joints]
        days = [_prepared(lib, saved, log) for log in healthy]
        baseline = drift.baseline_of(lib, saved, root, sigma, read_test_rows(folder, model), days)
    marks, verdicts = [row_marks(day) for day in healthy], []
    for log, seen in zip(tested, joints, strict=True):
        hashes = row_hashes(seen)
        shares = [share_of_rows(each, hashes) for each in marks]
        is_known = max(saved.fitted_share(seen), *shares, 0.0) > KNOWN
        verdicts.append(drift.verdict_of(lib, baseline, log, is_known))
    return verdicts, joints


def _joint_logs(
    saved: SavedResult, lib: Library, logs: Sequence[AnyLog], recipe: str | None
) -> list[Recording]:
    """Logs of a fixed base with names that differ; a recipe gives all its logs one name."""
    joints: list[str | PathLike[str] | Recording] = []
    for log in logs:
        if isinstance(log, FreeBaseRecording):
            raise RecordingError(
                f"expected a log of '{lib.name}', whose base is fixed, got '{log.name}' of a robot "
                "with a free base; name the result of that robot"
            )
        joints.append(log)
    names = [each.name if isinstance(each, Recording) else Path(each).stem for each in joints]
    named = [
        saved.log_of(each, lib, recipe).replace(
            name=name if names.count(name) == 1 or isinstance(each, Recording) else str(each)
        )
        for name, each in zip(names, joints, strict=True)
    ]
    return distinct(named)


def _walk(log: AnyLog, recipe: str | None) -> FreeBaseRecording:
    if isinstance(log, Recording):
        raise RecordingError(
            f"expected a log of a robot with a free base (read_free_base), got '{log.name}' of "
            "joints alone; give its file"
        )
    if recipe is not None:
        raise RecordingError(
            "--recipe does not apply to a log of a free base, whose arrays have stated names; "
            "leave it out"
        )
    return log if isinstance(log, FreeBaseRecording) else read_free_base(Path(log))


def _prepared(lib: Library, saved: SavedResult, recording: Recording) -> Recording:
    """A log, prepared as that of the result unless its recipe states a preparation."""
    require_plausible(recording, lib)
    steps = recording.preparation
    if steps == Preparation():
        steps = passing(recording, lib, saved.preparation.at_rate(recording.rate_hz))
    steps = replace(steps, regressor="acceleration")
    return prepare(recording, steps, saved.friction, lib=lib)


def _each(logs: Any) -> list[Any]:
    each = list(logs) if isinstance(logs, list | tuple) else [logs]
    if not all(isinstance(log, str | PathLike | Recording | FreeBaseRecording) for log in each):
        raise RecordingError(
            "expected a log or several, as files or as runtime.read_recording gives them, got "
            f"{logs!r:.60}"
        )
    return each


@contextmanager
def _folder_of(result: NewResult | str | PathLike[str]) -> Iterator[Path]:
    """Folder of the files of a result; that of a result in memory lasts as long as the context."""
    if isinstance(result, str | PathLike):
        yield Path(result)
        return
    with tempfile.TemporaryDirectory(prefix="symgen-") as folder:
        write_result(result, folder)
        yield Path(folder)
