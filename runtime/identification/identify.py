"""Identification of a robot from its logs: the road of the command `identify` and of Python.

log(s) ─▶ cut-off, regressor, friction model ─▶ rows ─▶ fit ─▶ errors ─▶ fit to all rows
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Unpack, overload

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.identification.drive.estimate import (
    drive_request,
    identify_drive,
    with_drives,
    without_drives,
)
from runtime.identification.drive.result import DriveFit
from runtime.identification.drive.symmetry import identify_tied, with_mirrored_links, with_sides
from runtime.identification.free_base.identify import assembly_of_walks, identify_free_base
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.identification.identified import Identification
from runtime.identification.long_logs import require_streamable
from runtime.identification.prepared_log import PreparedLog, prepared_log, usable_columns
from runtime.identification.problem_setup import Assembly, settings_for
from runtime.identification.settings import (
    AUTO,
    PER_JOINT,
    SILENT,
    Progress,
    SettingKeywords,
    Settings,
    progress_of,
    settings_from,
)
from runtime.identification.several_logs import NamedLog, distinct
from runtime.identification.single_log import FittedSource, assembly_of, identify_recording
from runtime.library import Library, require_library
from runtime.recording import Friction, Recording, Split
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.row_marks import row_marks
from runtime.recording.settings import has_memory
from runtime.recording.streamed import StreamedRecording

__all__ = ["identify"]

SEVERAL_STREAMED = (
    "several logs are read as a whole, but --settings stream=true is given; leave it out"
)
Source = Recording | StreamedRecording | NamedLog  # in memory, in a file, with name and payload
AnyLog = Source | Sequence[Source] | FreeBaseRecording | Sequence[FreeBaseRecording]
"""One log or several."""

ShownProgress = Callable[[int, float], None] | Progress | None


@overload
def identify(
    log: FreeBaseRecording | Sequence[FreeBaseRecording],
    lib: Library,
    settings: Settings | str | None = None,
    *,
    progress: ShownProgress = None,
    **keywords: Unpack[SettingKeywords],
) -> FreeBaseIdentification: ...


@overload
def identify(
    log: Source | Sequence[Source],
    lib: Library,
    settings: Settings | str | None = None,
    *,
    progress: ShownProgress = None,
    **keywords: Unpack[SettingKeywords],
) -> Identification: ...


@one_blas_thread
def identify(
    log: AnyLog,
    lib: Library,
    settings: Settings | str | None = None,
    *,
    progress: ShownProgress = None,
    **keywords: Unpack[SettingKeywords],
) -> Identification | FreeBaseIdentification:
    """Identify π, and friction, of a robot from a log or from several logs, as the command does.

        argmin_{π, φ}  Σ ‖τ − Y π − F φ‖²_W + prior(π)       every body with positive mass

    What the settings leave open is chosen by the data before the test part: the friction model by
    cross-validation, a cut-off or a regressor where the settings say "auto". Errors are those of
    the test part by a fit that has not used it; the parameters are then fitted to all rows. A bare
    fit chooses nothing and is not repeated:

        runtime.identify(log, lib, preparation=Preparation(), friction=(), refit=False)

    Several logs give one set of parameters with a torque offset per joint and log.

    Args:
        log: as `read_recording` or `open_log` return it, or several of them; that of a robot with
            a free base as `read_free_base` returns it.
        lib: library of the robot.
        settings: what is done; a string is the name of a method, None the defaults.
        progress: called by methods that iterate, with iteration and best validation loss; a
            `Progress` is shown the steps and choices as well.
        **keywords: single fields of `Settings`, which replace those of `settings`.

    Returns:
        Parameters in SI units with their errors, certificates and prepared data.

    Raises:
        RuntimeFault: the data or settings do not make an identification problem.
    """
    require_library(lib)
    chosen = settings_from(settings, keywords)
    if walks := _walks(log):
        return identify_free_base(walks, lib, settings_for(lib, chosen))
    _require_logs(log, lib, chosen)
    pairs = tuple(chosen.symmetric)
    prior = with_mirrored_links(chosen.prior, lib, pairs, chosen.tie)
    chosen = settings_for(lib, replace(chosen, prior=prior))
    shown = progress_of(progress)
    method = chosen.estimator
    named = _named(log)
    if isinstance(named[0].recording, StreamedRecording):
        require_streamable(method.name, chosen.preset)
    data = _prepared_logs(named, lib, chosen, usable_columns([method.name]), shown)
    several, is_streamed = len(named) > 1, data[0].streamed is not None
    # The drives of one log in memory are estimated together with the links, others before.
    request = drive_request(data[0], chosen)
    if several or request is not None:
        data = with_drives(data, lib, chosen)
    is_together = not (several or is_streamed)
    request = request if is_together else None
    names, notes = [each.name for each in named], _notes(named, data)
    data, delays, of_delays = without_drives(names, data, lib, chosen, shown, is_together)
    notes += of_delays
    first = data[0]
    source = _source(named, data)
    if several:
        shown.step(f"fitting {len(named)} logs")
    bare = first.settings(chosen, None if several else first.preparation)
    columns = method.default_columns
    stated = chosen.friction is not None or chosen.coulomb_speed is not None
    if columns and not stated and not first.is_at_rest:
        bare = replace(bare, friction=Friction(columns))

    def fit(each: Settings) -> Identification:
        if request is not None:
            return identify_drive(first.recording, lib, each, request, progress=shown)
        return identify_recording(source, lib, each, progress=shown)

    is_tied = chosen.tie and (request is not None or delays)
    result = identify_tied(fit, bare, pairs) if is_tied else fit(bare)
    if delays and (is_streamed or chosen.encoder_bias):
        result = replace(result, drive=DriveFit.of_all(delays))
    if result.agreement is not None and chosen.delay in {AUTO, PER_JOINT}:
        parts = zip(result.agreement.names, delays, strict=True)
        known = tuple(each.delay_of_log(name) for name, each in parts)
        result = replace(result, agreement=result.agreement.replace(delay_s=known))
    if pairs:
        result = with_sides(result, pairs)
    result = replace(result, notes=(*notes, *result.notes))
    # Trials of a study, without certificates or a second fit, are not recognised in other logs.
    is_trial = not (chosen.certify or chosen.refit)
    return result if is_trial else _with_row_marks(result, named, chosen.split)


def _require_logs(log: Any, lib: Library, settings: Settings) -> None:
    each = log if isinstance(log, Sequence) else [log]
    if not all(isinstance(one, Source) for one in each):
        raise IdentificationError(
            f"expected a log, as runtime.read_recording gives it, or several, got {log!r:.60}"
        )
    if lib.manifest.floating:
        raise IdentificationError(
            f"the base of '{lib.name}' is free, and the log is one of joints alone; give one with "
            "the motion of the base (read_free_base), or build the robot without --floating"
        )
    if settings.rows is not None:
        raise IdentificationError(
            f"the setting rows belongs to robots with a free base, and that of '{lib.name}' is "
            "fixed; leave it out, or build the robot with --floating"
        )


def _with_row_marks(
    result: Identification, named: Sequence[NamedLog], split: Split | None
) -> Identification:
    """The result with marks of the fitted rows, for other commands; none of a log in its file."""
    logs = [each.recording for each in named if isinstance(each.recording, Recording)]
    if len(logs) < len(named):
        return result
    if result.trained is None:
        logs = [before_test(each, split) for each in logs]
    marks = row_marks(*(independent_joints(each, result.lib) for each in logs))
    return replace(result, row_marks=marks)


def assembly_of_logs(
    log: AnyLog, lib: Library, settings: Settings, methods: Sequence[str], shown: Progress = SILENT
) -> tuple[Assembly, list[str]]:
    """The problem of a log or of several that some methods share; sentences on what was chosen."""
    if walks := _walks(log):
        return assembly_of_walks(walks, lib, settings)
    _require_logs(log, lib, settings)
    named = _named(log)
    data = _prepared_logs(named, lib, settings, usable_columns(methods), shown)
    bare = data[0].settings(settings, None if len(named) > 1 else data[0].preparation)
    return assembly_of(_source(named, data), lib, bare, shown, False), _notes(named, data)


def _source(named: Sequence[NamedLog], data: Sequence[PreparedLog]) -> FittedSource:
    """What is fitted: a log, or several with their preparations."""
    if len(named) == 1:
        return data[0].streamed or data[0].recording
    return [
        replace(log, recording=each.recording, preparation=each.preparation)
        for log, each in zip(named, data, strict=True)
    ]


def _notes(named: Sequence[NamedLog], data: Sequence[PreparedLog]) -> list[str]:
    several = len(named) > 1
    return [
        f"{log.name}: {note}" if several else note
        for log, each in zip(named, data, strict=True)
        for note in each.notes
    ]


def _prepared_logs(
    named: list[NamedLog], lib: Library, settings: Settings, usable: Sequence[str], shown: Progress
) -> list[PreparedLog]:
    """The logs with what is chosen from them.

    Friction model, regressor and gains of currents come from the first log, a cut-off from each.
    """
    if len(named) == 1 and (settings.delay is not None or settings.encoder_bias):
        # The result states Coulomb friction per drive, without memory.
        usable = [name for name in usable if not has_memory([name])]
    first = prepared_log(named[0].recording, lib, _of(named[0], settings), usable, shown)
    rest = settings
    if settings.regressor == AUTO:
        rest = replace(rest, regressor=first.steps.regressor)
        if first.steps.regressor != "acceleration":  # chosen together with its cut-off
            rest = replace(rest, cutoff=first.steps.cutoff_hz)
    if first.friction is not None:
        rest = replace(rest, friction=first.friction, coulomb_speed=None)
    data, gains = [first], first.recording.gains
    for each in named[1:]:
        data.append(prepared_log(each.recording, lib, _of(each, rest), (), shown, gains))
    return data


def _named(log: Any) -> list[NamedLog]:
    """The logs with names that differ."""
    if isinstance(log, (Recording, StreamedRecording)):
        return [NamedLog(log.name, log)]  # type: ignore[arg-type]
    named: list[NamedLog] = []
    for one in [log] if isinstance(log, NamedLog) else log:
        if isinstance(one, StreamedRecording):
            raise IdentificationError(SEVERAL_STREAMED)
        named.append(one if isinstance(one, NamedLog) else NamedLog(one.name, one))
    named = distinct(named)
    if len(named) < 2:
        raise IdentificationError(
            "the setting payload_of needs several logs, got one; give also the logs without "
            "this payload"
        )
    return named


def _walks(log: Any) -> list[FreeBaseRecording]:
    """The logs of a robot with a free base, with names that differ; empty for other logs."""
    each = log if isinstance(log, Sequence) else [log]
    return distinct(each) if all(isinstance(x, FreeBaseRecording) for x in each) else []


def _of(log: NamedLog, settings: Settings) -> Settings:
    """Settings with the preparation of one of several logs, where it states one."""
    return settings if log.preparation is None else replace(settings, preparation=log.preparation)
