"""A log of a robot with a free base → its equations, those that train and those that test."""

from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.methods import Method, methods_from_statistics
from runtime.identification.free_base.drives import (
    COLUMNS,
    EARLIEST_S,
    LATEST_S,
    RowNoise,
    drives_of,
    friction_by_choice,
)
from runtime.identification.free_base.plausibility import (
    require_clock,
    require_contact_conventions,
    require_forces_on_robot,
    require_joint_units,
    require_prior_of_rows,
    require_torque_sign,
)
from runtime.identification.free_base.rows import (
    OFFSET_SIGMA,
    Drives,
    FreeBaseRows,
    rows_of,
    sensor_errors,
    with_contact_states,
)
from runtime.identification.settings import AUTO, Settings, cutoff_of, friction_of, require_default
from runtime.library import Integers, Library
from runtime.recording import Friction, Split
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion, motion_of

ROWS_PER_PERIOD = 5.0
"""Rows per period of the cut-off of a log with drives."""
NOT_TAKEN = (
    *("preparation", "rate", "regressor", "encoder_bias", "validation", "test", "lam0"),
    *("inputs", "certify", "gain_sigma"),
)
"""Fields of `Settings` without a meaning for the rows of a free base."""


def require_settings(settings: Settings, method: Method, recording: FreeBaseRecording) -> None:
    """Refuse what the rows of a free base cannot use."""
    require_default(settings, NOT_TAKEN, "a robot with a free base")
    if settings.cutoff == AUTO:
        raise IdentificationError(
            "the cut-off of a robot with a free base is not chosen from the log, whose filter ends "
            "at every change of a contact; give --cutoff HZ, or leave it out"
        )
    if method.needs_samples(settings.preset):
        raise IdentificationError(
            f"the method {method.name} takes motion and torques sample by sample, and the rows of "
            "a free base are equations of which unknown wrenches were eliminated; use one of "
            f"{', '.join(methods_from_statistics())}"
        )
    if sensor_errors(recording.contacts) and not method.is_most_probable:
        raise IdentificationError(
            "the log states standard deviations of errors of its contact sensors, which are a "
            f"prior, and the method {method.name} takes none; use map, or leave "
            "contact_force_z_sigma, contact_force_z_sharing and contact_force_z_crosstalk out"
        )


@dataclass(frozen=True, slots=True, eq=False)
class PreparedWalk:
    """Motion and equations of both parts, with sentences on the way to them."""

    rows: str  # base, joints or all
    motion: FreeBaseMotion
    drives: Drives | None
    train: FreeBaseMotion
    test: FreeBaseMotion
    trained: FreeBaseRows
    tested: FreeBaseRows
    notes: tuple[str, ...]


def usual_rows(recording: FreeBaseRecording) -> str:
    """Rows of a log for which none are named."""
    return "base" if recording.tau is None else "all"


def prepared_walk(
    recording: FreeBaseRecording, lib: Library, settings: Settings, trim_s: float
) -> PreparedWalk:
    """Equations of a log that agree with the robot."""
    require_clock(recording)
    share = (settings.split or Split()).joined()[1]
    if not 0.1 <= share <= 0.95:
        raise IdentificationError(
            f"--split needs a training share of 0.1 to 0.95 of the log, got {share:g}"
        )
    rows = settings.rows or usual_rows(recording)
    cutoff_hz, drives, notes = cutoff_of(settings.cutoff), None, tuple[str, ...]()
    if recording.is_commanded:
        recording, notes = with_contact_states(recording, lib)
    terms = friction_of(recording.joints, settings)
    if terms is None and settings.prior is not None:
        terms = settings.prior.friction_model
    if terms is None:
        terms = Friction(COLUMNS if recording.is_commanded else ())
    has_drives = recording.is_commanded or bool(terms.columns) or settings.delay is not None
    require_prior_of_rows(settings.prior, has_drives)
    if has_drives:
        if recording.tau is None or (rows == "base" and not recording.is_commanded):
            raise IdentificationError(
                "friction and delay belong to the torques of joints, which the rows of the base do "
                "not contain; use --settings rows=all with a log that has tau"
            )
        trim_s = max(trim_s, LATEST_S, 0.0 if cutoff_hz is None else 1.0 / cutoff_hz)

        def trained_part(motion: FreeBaseMotion) -> Integers:
            return parts_of(motion, share, trim_s)[0]

        delay_s = _stated_delay(settings.delay, recording.is_commanded)
        prior = settings.prior

        def drives_by(terms: Friction) -> Drives:
            return drives_of(recording, lib, rows, terms, delay_s, cutoff_hz, trained_part, prior)

        if terms.columns[:1] == (AUTO,):
            more = terms.columns[1:] or (COLUMNS[2:] if recording.is_commanded else ())
            first = drives_by(replace(terms, columns=(*COLUMNS[:2], *more)))
            choice = friction_by_choice(recording, lib, rows, first, cutoff_hz, trained_part)
            terms, notes = choice.chosen.terms, (*notes, choice.sentence)
        drives = drives_by(terms)
    late, columns = (0.0, None) if drives is None else (drives.delay_s, drives.terms)
    motion = motion_of(recording, lib.joint_names, cutoff_hz, late, columns)
    require_joint_units(lib, motion, recording.name)
    first_part, second_part = parts_of(motion, share, trim_s)
    if drives is not None and cutoff_hz is not None:
        # More rows than these of a low-pass contain nothing new.
        period = 1.0 / (cutoff_hz * float(np.median(np.diff(motion.t))))
        step = max(1, int(period / ROWS_PER_PERIOD))
        first_part, second_part = first_part[::step], second_part[::step]
    train, test = motion.rows(first_part), motion.rows(second_part)
    trained, tested = (rows_of(lib, part, rows, drives) for part in (train, test))
    if drives is None:
        require_forces_on_robot(lib, trained, recording.name)
    require_contact_conventions(lib, train, recording.name)
    require_torque_sign(lib, train, recording.name)
    return PreparedWalk(rows, motion, drives, train, test, trained, tested, notes)


def _stated_delay(delay: float | str | None, is_commanded: bool) -> float | None:
    """Delay of the torques [s]; None where it is estimated."""
    if delay is None:
        return None if is_commanded else 0.0
    if delay == AUTO:
        return None
    try:
        seconds = float(delay)
    except ValueError:
        seconds = float("nan")
    if not EARLIEST_S <= seconds <= LATEST_S:
        raise IdentificationError(
            f"--delay needs {AUTO} or a number of {EARLIEST_S:g} to {LATEST_S:g} s here, got "
            f"'{delay}'"
        )
    return seconds


def parts_of(motion: FreeBaseMotion, share: float, trim_s: float) -> tuple[Integers, Integers]:
    """Instants of the training and of the test, without `trim_s` [s] at either end."""
    first, last = motion.t[0] + trim_s, motion.t[-1] - trim_s
    inside = np.flatnonzero((motion.t >= first) & (motion.t <= last))
    border = motion.t[0] + share * (motion.t[-1] - motion.t[0])
    first, second = inside[motion.t[inside] < border], inside[motion.t[inside] >= border]
    if min(len(first), len(second)) < 1:
        raise IdentificationError("no row is left for training or test; record for longer")
    return first, second


def notes_on(
    lib: Library, recording: FreeBaseRecording, data: PreparedWalk, noise: RowNoise | None
) -> tuple[str, ...]:
    """Sentences on the rows: how many, with which noise and offsets, and what was not read."""
    trained, notes = data.trained, list(data.notes)
    if noise is not None:
        independent = trained.samples.tau.size / noise.floor.inflation
        notes.append(
            f"{independent:.0f} independent equations for {len(lib.base_columns)} base parameters: "
            "most of the result is the prior, and the residual of the URDF counts as noise, "
            "without its mean and errors of sensors"
        )
    if trained.offsets.size:
        force, moment = OFFSET_SIGMA[[0, -1]]
        notes.append(
            f"intervals contain constant offsets of the contact sensors of {force:g} N and "
            f"{1e3 * moment:g} mN·m (σ): an offset of a force changes the total mass by as much; "
            "state the standard deviation of those of vertical forces in N by contact_force_z_sigma"
        )
    fewest, left = np.sort(trained.left)[[0, -1]]
    if fewest < len(trained.names):
        counts = f"{left}" if fewest == left else f"{fewest} to {left}"
        notes.append(
            f"contact wrenches are not measured completely: {counts} of {len(trained.names)} "
            "equations per instant are left"
        )
    if recording.unread:
        notes.append(
            f"arrays that are not read: {', '.join(recording.unread)}; expected names are listed "
            "in docs/howto/free-base.md"
        )
    return tuple(notes)
