"""A log of a robot with a free base → its equations, those that train and those that test."""

from collections.abc import Sequence
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
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion, joined, motion_of

ROWS_PER_PERIOD = 5.0
"""Rows per period of the cut-off of a log with drives."""
NOT_TAKEN = (
    *("preparation", "rate", "regressor", "encoder_bias", "validation", "test", "lam0"),
    *("inputs", "certify", "gain_sigma"),
)
"""Fields of `Settings` without a meaning for the rows of a free base."""


def require_settings(settings: Settings, method: Method, logs: Sequence[FreeBaseRecording]) -> None:
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
    if sensor_errors(logs[0].contacts) and not method.is_most_probable:
        raise IdentificationError(
            "the log states standard deviations of errors of its contact sensors, which are a "
            f"prior, and the method {method.name} takes none; use map, or leave "
            "contact_force_z_sigma, contact_force_z_sharing and contact_force_z_crosstalk out"
        )


@dataclass(frozen=True, slots=True, eq=False)
class PreparedWalk:
    """Motion of one log or several, and instants of its parts, with sentences on them."""

    rows: str  # base, joints or all
    motion: FreeBaseMotion
    drives: Drives | None
    parts: tuple[Integers, ...]  # instants of training and test
    tested: FreeBaseRows
    notes: tuple[str, ...]

    @property
    def sensors(self) -> dict[str, float]:
        """σ of the errors of sensors, whose coefficients are first."""
        return dict(sensor_errors(self.motion.contacts, self.motion.logs))

    @property
    def instants(self) -> Integers:
        """Instants of all parts."""
        return np.sort(np.concatenate(self.parts))

    def rows_of(self, lib: Library, motion: FreeBaseMotion) -> FreeBaseRows:
        """Equations of some instants."""
        return rows_of(lib, motion, self.rows, self.drives)


def usual_rows(logs: Sequence[FreeBaseRecording]) -> str:
    """Rows of logs for which none are named."""
    return "base" if any(log.tau is None for log in logs) else "all"


def prepared_walk(
    logs: Sequence[FreeBaseRecording], lib: Library, settings: Settings, trim_s: float
) -> PreparedWalk:
    """Equations of logs that agree with the robot."""
    for log in logs:
        require_clock(log)
    share = (settings.split or Split()).joined()[1]
    if not 0.1 <= share <= 0.95:
        raise IdentificationError(
            f"--split needs a training share of 0.1 to 0.95 of the log, got {share:g}"
        )
    rows = settings.rows or usual_rows(logs)
    is_commanded = logs[0].is_commanded
    if any(log.is_commanded != is_commanded for log in logs):
        raise IdentificationError(
            "some of the logs hold commanded torques and some measured ones, whose friction and "
            "delay differ; identify each kind alone"
        )
    cutoff_hz, drives, notes = cutoff_of(settings.cutoff), None, list[str]()
    if is_commanded:
        states = [with_contact_states(log, lib) for log in logs]
        logs = [log for log, _ in states]
        notes = [f"{log.name}: {note}" if len(logs) > 1 else note
                 for log, said in states for note in said]  # fmt: skip
    terms = friction_of(logs[0].joints, settings)
    if terms is None and settings.prior is not None:
        terms = settings.prior.friction_model
    if terms is None:
        terms = Friction(COLUMNS if is_commanded else ())
    has_drives = is_commanded or bool(terms.columns) or settings.delay is not None
    require_prior_of_rows(settings.prior, has_drives)

    def motion_at(late: float, columns: Friction | None) -> FreeBaseMotion:
        return joined([motion_of(log, lib.joint_names, cutoff_hz, late, columns) for log in logs])

    if has_drives:
        if any(log.tau is None for log in logs) or (rows == "base" and not is_commanded):
            raise IdentificationError(
                "friction and delay belong to the torques of joints, which the rows of the base do "
                "not contain; use --settings rows=all with a log that has tau"
            )
        trim_s = max(trim_s, LATEST_S, 0.0 if cutoff_hz is None else 1.0 / cutoff_hz)

        def train_at(late: float, columns: Friction) -> FreeBaseMotion:
            motion = motion_at(late, columns)
            return motion.rows(parts_of(motion, share, trim_s)[0])

        delay_s = _stated_delay(settings.delay, is_commanded)
        if terms.columns[:1] == (AUTO,):
            more = terms.columns[1:] or (COLUMNS[2:] if is_commanded else ())
            usual = replace(terms, columns=(*COLUMNS[:2], *more))
            first = drives_of(lib, rows, usual, delay_s, train_at, settings.prior)
            choice = friction_by_choice(lib, rows, first, train_at)
            terms, notes = choice.chosen.terms, [*notes, choice.sentence]
        drives = drives_of(lib, rows, terms, delay_s, train_at, settings.prior)
    late, columns = (0.0, None) if drives is None else (drives.delay_s, drives.terms)
    motion = motion_at(late, columns)
    for name, instants in motion.each():
        require_joint_units(lib, motion.rows(instants), name)
    parts = parts_of(motion, share, trim_s, None if drives is None else cutoff_hz)
    train, test = (motion.rows(part) for part in parts)
    trained, tested = (rows_of(lib, part, rows, drives) for part in (train, test))
    for name, instants in train.each():
        if drives is None:
            require_forces_on_robot(lib, trained, instants, name)
        require_contact_conventions(lib, train.rows(instants), name)
        require_torque_sign(lib, train.rows(instants), name)
    return PreparedWalk(rows, motion, drives, parts, tested, tuple(notes))


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


def parts_of(
    motion: FreeBaseMotion, share: float, trim_s: float, cutoff_hz: float | None = None
) -> tuple[Integers, ...]:
    """Instants of training and test of every log, without `trim_s` [s] at either end.

    With a cut-off they are `ROWS_PER_PERIOD`: more rows of a low-pass contain nothing new.
    """
    parts: list[list[Integers]] = [[], []]
    for name, rows in motion.each():
        t = motion.t[rows]
        inside = rows[(t >= t[0] + trim_s) & (t <= t[-1] - trim_s)]
        border = t[0] + share * (t[-1] - t[0])
        step = 1
        if cutoff_hz is not None:
            period = 1.0 / (cutoff_hz * float(np.median(np.diff(t))))
            step = max(1, int(period / ROWS_PER_PERIOD))
        is_first = motion.t[inside] < border
        if is_first.all() or not is_first.any():
            raise IdentificationError(
                f"{name}: no row is left for training or test; record for longer"
            )
        parts[0].append(inside[is_first][::step])
        parts[1].append(inside[~is_first][::step])
    first, second = map(np.concatenate, parts)
    return first, second


def notes_on(
    lib: Library,
    logs: Sequence[FreeBaseRecording],
    data: PreparedWalk,
    trained: FreeBaseRows,
    noise: RowNoise | None,
) -> tuple[str, ...]:
    """Sentences on the rows: how many, with which noise and offsets, and what was not read."""
    notes = list(data.notes)
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
    if unread := dict.fromkeys(name for log in logs for name in log.unread):
        notes.append(
            f"arrays that are not read: {', '.join(unread)}; expected names are listed in "
            "docs/howto/free-base.md"
        )
    return tuple(notes)
