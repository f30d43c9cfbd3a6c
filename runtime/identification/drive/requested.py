"""What the settings request of the drives of logs: delay, encoder biases, mirrored links.

Of a streamed log delay and biases are those of its first rows, of several logs those of each alone.
The encoders are the same in all logs, so that the biases of K logs, each with the prior N(0, σ₀²),
have the precision Σ 1/σ_k² − (K − 1)/σ₀².
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex.constraints import Constraints
from runtime.estimators.methods import METHODS, require_method
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.regression.dry_friction_choice import with_dry_friction
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.identification.drive.estimate import NO_BIAS, identify_drive
from runtime.identification.drive.result import DriveFit, DriveRequest
from runtime.identification.drive.symmetry import mirrored_joints, mirrored_links
from runtime.identification.prepared_log import PreparedLog
from runtime.identification.progress import SILENT, Progress
from runtime.identification.settings import AUTO, PER_JOINT, Settings
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation
from runtime.recording.commanded_torque import without_ends
from runtime.recording.friction import default_terms
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.recipes.recipe import COMMANDED

LATEST = 1.0
"""Largest delay that is stated [s]."""


def drive_request(data: PreparedLog, settings: Settings, method: str) -> DriveRequest | None:
    """What is estimated of the drives; None for nothing."""
    estimated = settings.delay in {AUTO, PER_JOINT}
    commanded = data.recording.torque_source == COMMANDED
    bias = settings.encoder_bias
    wanted = bias if bias is not None else commanded and estimated
    if not (estimated or wanted or (commanded and method == "map")):
        return None
    return DriveRequest(estimated, settings.delay == PER_JOINT, wanted)


def with_mirrored_links(
    prior: PriorFile | None, lib: Library, symmetric: tuple[str, ...], is_tied: bool
) -> PriorFile | None:
    """Inertial prior, with equations that tie the links of mirrored joints where requested."""
    if not is_tied and not symmetric:
        return prior
    if not is_tied:
        mirrored_joints(lib.joint_names, symmetric)
        return prior
    if not symmetric:
        raise IdentificationError(
            "--settings tie=true needs the names of the mirrored joints, got none; give "
            "--settings symmetric=LEFT:RIGHT"
        )
    usual = prior or PriorFile(None, Constraints())
    rows = (*usual.constraints.equations, *mirrored_links(lib, symmetric))
    return replace(usual, constraints=replace(usual.constraints, equations=rows))


def columns_of(data: PreparedLog, settings: Settings) -> Friction | None:
    """Friction columns of one log; None for those of its recipe or of its commanded torque."""
    terms, stated = data.friction, settings.friction is None and settings.coulomb_speed is None
    if stated and terms == default_terms(data.recording):
        terms = None
    method = settings.method
    if terms is None and method and require_method(method).default_columns:
        terms = Friction(METHODS[method].default_columns)
    return terms


def delayed(data: PreparedLog, delay: float | str | None, has_bias: bool) -> Preparation | None:
    """Preparation with a stated delay."""
    recording, preparation = data.recording, data.preparation
    if data.is_at_rest and (delay is not None or has_bias):
        raise IdentificationError(
            "--delay and --settings encoder_bias=true need motion, but the log contains poses "
            "at rest; leave "
            "them out, or give --cutoff to identify from the motion between the poses"
        )
    if delay is None or delay in {AUTO, PER_JOINT}:
        return preparation
    try:
        seconds = float(delay)
        if not math.isfinite(seconds) or abs(seconds) > LATEST:
            raise ValueError
    except ValueError:
        raise IdentificationError(
            f"--delay needs a number of seconds within 1 s, {AUTO} or {PER_JOINT}, got '{delay}'"
        ) from None
    usual = preparation or recording.preparation
    return replace(usual, torque_delay_s=sign_of_delay(recording) * seconds or None)


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


def without_drives(
    names: Sequence[str],
    data: Sequence[PreparedLog],
    lib: Library,
    settings: Settings,
    progress: Progress = SILENT,
) -> tuple[list[PreparedLog], list[DriveFit]]:
    """The logs without the delays of their torques and the biases of their encoders, and both.

    What is unknown is estimated from every log alone, with the friction model of the first.
    """
    delay, has_bias = settings.delay, bool(settings.encoder_bias)
    request = DriveRequest(delay in {AUTO, PER_JOINT}, delay == PER_JOINT, has_bias)
    moved = [replace(each, preparation=delayed(each, delay, has_bias)) for each in data]
    if not (request.delay or request.bias):
        return moved, []
    estimated: list[DriveFit] = []
    for name, each in zip(names, moved, strict=True):
        bare = each.settings(settings, each.preparation)
        alone = replace(bare, friction=data[0].friction, refit=False, certify=False)
        progress.step(f"estimating the delay of {name}")
        drive = identify_drive(each.recording, lib, alone, request).drive
        estimated.append(replace(drive or DriveFit.unknown(lib.n_joints), phi_sigma=None))
    bias = DriveFit.of_all(estimated).bias
    return [_corrected(*pair, bias) for pair in zip(moved, estimated, strict=True)], estimated


def _corrected(log: PreparedLog, drive: DriveFit, bias: Array) -> PreparedLog:
    """The log with delay and biases removed."""
    if drive.delay.size:
        late = [float(x) for x in sign_of_delay(log.recording) * drive.delay]
        usual = log.preparation or log.recording.preparation
        shift = late[0] if len(late) == 1 else tuple(late)
        log = replace(log, preparation=replace(usual, torque_delay_s=shift))
    if not np.isfinite(bias).all():
        return log
    if log.streamed is not None:
        return replace(log, streamed=replace(log.streamed, bias=bias))
    recording = log.recording
    return replace(log, recording=recording.replace(q=recording.q + bias))


def drive_notes(
    names: Sequence[str], estimated: Sequence[DriveFit], settings: Settings, where: str = ""
) -> list[str]:
    """One sentence per log on its delay, and one on encoder biases that were not estimated."""
    notes = []
    is_sought = settings.delay in {AUTO, PER_JOINT}
    for name, each in zip(names, estimated, strict=True) if is_sought else ():
        value, sigma = 1e3 * each.delay, 1e3 * each.delay_sigma
        if not value.size:
            note = "the log does not determine a delay, and none was taken; record a faster motion"
        elif len(value) > 1:
            note = f"delays of the torques of the joints {', '.join(f'{x:.1f}' for x in value)} ms"
        else:
            note = f"delay of the torque {value[0]:.2f} ± {sigma[0]:.2g} ms"
        notes.append(f"{name}: {note}{where}")
    if settings.encoder_bias and not np.isfinite([each.bias for each in estimated]).all():
        notes.append(NO_BIAS)
    return notes
