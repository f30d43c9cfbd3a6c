"""Identification of a robot from its logs: the road of the command `identify` and of Python.

    log(s) ─▶ cut-off, regressor, friction model ─▶ rows ─▶ fit ─▶ errors ─▶ fit to all rows

`prepared_log` makes the choices; a log in memory, a streamed log and several logs give their rows
to the same fit (`single_log.identify_assembled`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.methods import chosen_method
from runtime.identification.drive.feedback import BIAS_PRIOR
from runtime.identification.drive.requested import (
    columns_of,
    delayed,
    drive_request,
    with_mirrored_links,
)
from runtime.identification.drive.result import DriveFit
from runtime.identification.drive.symmetry import identify_drives, with_sides
from runtime.identification.identified import Identification
from runtime.identification.long_logs.identify import identify_streamed, require_streamable
from runtime.identification.prepared_log import (
    PreparedLog,
    prepared_log,
    usable_columns,
    without_memory,
)
from runtime.identification.problem_setup import settings_for
from runtime.identification.settings import AUTO, SettingKeywords, Settings, settings_from
from runtime.identification.several_logs.drives import delay_notes, with_delays, with_drives
from runtime.identification.several_logs.identify import identify_logs
from runtime.identification.several_logs.joint_fit import NamedLog
from runtime.identification.single_log import identify_recording
from runtime.identification.watch import SILENT, Watch
from runtime.library import Library, require_library
from runtime.recording import Recording, Split, StreamedRecording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.row_marks import COUNT, row_marks, same_rows
from runtime.recording.unit_conversion import scaled

__all__ = ["identify"]

ONE_LOG = {
    "several": (
        "--controller belongs to one log, but several are given; leave it out",
        "--encoder-bias and --symmetric belong to one log, but several are given; identify each "
        "alone",
    ),
    "streamed": (
        "the closed loop of --controller is simulated over all samples, but the log is streamed; "
        "leave out --controller, or give --no-stream",
        "--encoder-bias and --symmetric need the whole log in memory, but it is streamed; give "
        "--no-stream",
    ),
}
"""Logs → sentences that refuse a controller, and encoder biases with mirrored joints."""

SEVERAL_STREAMED = "several logs are read as a whole, but --stream is given; leave it out"
Source = Recording | StreamedRecording | NamedLog
"""A log: in memory, in its file, or with its name and known payload."""


@one_blas_thread
def identify(
    log: Source | Sequence[Source],
    lib: Library,
    settings: Settings | str | None = None,
    *,
    progress: Callable[[int, float], None] | None = None,
    watch: Watch = SILENT,
    **keywords: Unpack[SettingKeywords],
) -> Identification:
    """Identify π, and friction, of a robot from a log or from several logs, as the command does.

        argmin_{π, φ}  Σ ‖τ − Y π − F φ‖²_W + prior(π)       every body with positive mass

    What the settings leave open is chosen by the data before the test part: the friction model by
    cross-validation, a cut-off or a regressor where the settings say "auto". Errors are those of
    the test part by a fit that has not used it; the parameters are then fitted to all rows. A bare
    fit chooses nothing and is not repeated:

        runtime.identify(log, lib, preparation=Preparation(), friction=(), refit=False)

    Several logs give one set of parameters with a torque offset per joint and log.

    Args:
        log: as `read_recording` or `open_log` return it, or several of them.
        lib: library of the robot.
        settings: what is done; a string is the name of a method, None the defaults.
        progress: called by methods that iterate, with iteration and best validation loss.
        watch: shown the steps and choices as well.
        **keywords: single fields of `Settings`, which replace those of `settings`.

    Returns:
        Parameters in SI units with their errors, certificates and prepared data.

    Raises:
        RuntimeFault: the data or settings do not make an identification problem.
    """
    require_library(lib)
    if not isinstance(log, Recording | StreamedRecording | NamedLog | Sequence) or not all(
        isinstance(each, Recording | StreamedRecording | NamedLog)
        for each in (log if isinstance(log, Sequence) else ())
    ):
        raise IdentificationError(
            f"expected a log, as runtime.read_recording gives it, or several, got {log!r:.60}"
        )
    chosen = settings_from(settings, keywords)
    prior = with_mirrored_links(chosen.prior, lib, tuple(chosen.symmetric), chosen.tie)
    chosen = settings_for(lib, replace(chosen, prior=prior))
    seen = watch if progress is None else _Iterations(progress)
    if isinstance(log, (Recording, StreamedRecording)):
        return _of_one(log, lib, chosen, seen)
    return _of_several(_named([log] if isinstance(log, NamedLog) else log), lib, chosen, seen)


def with_row_marks(
    result: Identification, log: Source | Sequence[Source], split: Split | None
) -> Identification:
    """The result with marks of the rows that were fitted, by which other commands know them.

    A log that is left in its file has none.
    """
    every = [log] if isinstance(log, (Recording, StreamedRecording, NamedLog)) else log
    logs = [each.recording if isinstance(each, NamedLog) else each for each in every]
    marks = [
        row_marks(
            independent_joints(
                each if result.trained is not None else before_test(each, split), result.lib
            )
        )
        for each in logs
        if isinstance(each, Recording)
    ]
    if len(marks) < len(logs):
        return result
    return replace(result, row_marks=np.unique(np.concatenate(marks))[:COUNT])


@dataclass(frozen=True)
class _Iterations(Watch):
    """A callable that is shown the iterations alone."""

    call: Callable[[int, float], None]

    def iteration(self, done: int, best: float) -> None:
        self.call(done, best)


def _of_one(
    log: Recording | StreamedRecording, lib: Library, settings: Settings, watch: Watch
) -> Identification:
    """The result of a log in memory or in its file."""
    method = chosen_method(settings.method, settings.preset, settings.prior)
    if isinstance(log, StreamedRecording):
        require_streamable(method, settings.preset)
        _require_one_log("streamed", settings)
    usable = usable_columns([method])
    if settings.delay is not None or settings.encoder_bias:
        # The result states Coulomb friction per drive.
        usable = without_memory(usable)
    data = prepared_log(log, lib, settings, usable, watch)
    if data.streamed is not None:
        result = _streamed(data.streamed, data, lib, settings, watch)
        return replace(result, notes=(*data.notes, *result.notes))
    preparation = delayed(data, settings.delay, bool(settings.encoder_bias))
    request = drive_request(data, settings, method)
    bare = replace(data.settings(settings, preparation), friction=columns_of(data, settings))
    to_fit = data.recording, lib, bare
    if request is None:
        result = identify_recording(*to_fit, progress=watch.iteration)
    else:
        result = identify_drives(*to_fit, request, progress=watch.iteration)
    if settings.symmetric:
        result = with_sides(result, tuple(settings.symmetric))
    return replace(result, notes=(*data.notes, *result.notes))


def _streamed(
    log: StreamedRecording, data: PreparedLog, lib: Library, settings: Settings, watch: Watch
) -> Identification:
    """The result of a log in its file; a delay is estimated from its first rows."""
    delays: list[dict[str, Any]] = []
    if settings.delay is not None:
        (data,), delays = with_delays((log.name,), (data,), lib, settings, watch)
    bare = data.settings(settings, data.preparation)
    result = identify_streamed(log, lib, bare, progress=watch.step)
    return _with_delay(result, delays[0], len(data.recording)) if delays else result


def _with_delay(result: Identification, facts: dict[str, Any], rows: int) -> Identification:
    """The result with the delay of the first rows."""
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


def _of_several(
    named: Sequence[NamedLog], lib: Library, settings: Settings, watch: Watch
) -> Identification:
    """One set of parameters from several logs, and the comparison of the logs.

    Friction model, regressor and gains of currents come from the first log, a cut-off from each.
    """
    _require_one_log("several", settings)
    method = chosen_method(settings.method, settings.preset, settings.prior)
    first = prepared_log(
        named[0].recording, lib, _of(named[0], settings), usable_columns([method]), watch
    )
    rest = settings
    if settings.regressor == AUTO:
        steps = first.preparation or first.recording.preparation
        rest = replace(rest, regressor=steps.regressor)
        if steps.regressor != "acceleration":  # chosen together with its cut-off
            rest = replace(rest, cutoff=steps.cutoff_hz)
    if first.friction is not None:
        rest = replace(rest, friction=first.friction, coulomb_speed=None)
    gains, data = first.recording.gains, [first]
    for each in named[1:]:
        log = each.recording if gains is None else scaled(each.recording, gains)
        data.append(prepared_log(log, lib, _of(each, rest), (), watch))
    data = with_drives(data, lib, settings)
    names = [each.name for each in named]
    delays: list[dict[str, Any]] = []
    if settings.delay is not None:
        data, delays = with_delays(names, data, lib, settings, watch)
    ready = [
        replace(log, recording=each.recording, preparation=each.preparation)
        for log, each in zip(named, data, strict=True)
    ]
    watch.step(f"fitting {len(named)} logs")
    bare = replace(data[0].settings(settings, None), inputs=None)
    result = identify_logs(ready, lib, bare)
    notes = [f"{name}: {note}" for name, log in zip(names, data, strict=True) for note in log.notes]
    if delays and result.agreement is not None:
        notes += delay_notes(delays)
        result = replace(result, agreement=replace(result.agreement, delays=tuple(delays)))
    shared = same_rows([(each.name, each.recording) for each in named])
    if shared and result.agreement is not None:
        agreement = replace(result.agreement, shared=shared)
        result = replace(result, agreement=agreement)
        notes.insert(0, f"{agreement.sharing()}; give each log once")
    return replace(result, notes=(*notes, *result.notes))


def _named(logs: Sequence[Source]) -> list[NamedLog]:
    """The logs with names that differ."""
    named: list[NamedLog] = []
    for log in logs:
        if isinstance(log, StreamedRecording):
            raise IdentificationError(SEVERAL_STREAMED)
        each = log if isinstance(log, NamedLog) else NamedLog(log.name, log)
        name = each.name
        while name in {other.name for other in named}:
            name += "'"
        named.append(replace(each, name=name))
    if len(named) < 2:
        raise IdentificationError(
            "--payload-of needs several logs, got one; give also the logs without this payload"
        )
    return named


def _of(log: NamedLog, settings: Settings) -> Settings:
    """Settings with the preparation of one of several logs, where it states one."""
    return settings if log.preparation is None else replace(settings, preparation=log.preparation)


def _require_one_log(logs: str, settings: Settings) -> None:
    """Refuse settings that need the samples of one whole log."""
    given = settings.inputs, settings.encoder_bias or settings.symmetric
    for value, sentence in zip(given, ONE_LOG[logs], strict=True):
        if value:
            raise IdentificationError(sentence)
