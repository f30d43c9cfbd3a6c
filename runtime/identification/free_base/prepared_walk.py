"""A log of a robot with a free base → its equations, those that train and those that test."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.common.texts import number_of
from runtime.errors import IdentificationError
from runtime.estimators.methods import methods_from_statistics
from runtime.estimators.problem import FrictionPrior, NoiseFloor
from runtime.identification.drive.symmetry import with_mirrored_links
from runtime.identification.free_base import drives as row_noise
from runtime.identification.free_base import plausibility
from runtime.identification.free_base import rows as equations
from runtime.identification.problem_setup import known_friction
from runtime.identification.settings import AUTO, Settings, cutoff_of, friction_of, require_default
from runtime.library import Integers, Library
from runtime.library.manifest import file_units
from runtime.recording import Friction, Split
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion, joined, motion_of

ROWS_PER_PERIOD = 5.0  # rows per period of the cut-off of a log with drives
NOT_TAKEN = (
    *("preparation", "rate", "regressor", "encoder_bias", "validation", "test", "lam0"),
    *("inputs", "certify", "gain_sigma"),
)
"""Fields of `Settings` without a meaning for the rows of a free base."""


def settings_of_walks(
    logs: Sequence[FreeBaseRecording], lib: Library, settings: Settings
) -> Settings:
    """Settings with ties of mirrored links; refuse what walks cannot use."""
    if not lib.manifest.floating:
        raise IdentificationError(
            f"the base of '{lib.name}' is fixed, so a log with the motion of a base does not fit; "
            "build the robot with --floating, or give a log of joints alone"
        )
    prior = with_mirrored_links(settings.prior, lib, tuple(settings.symmetric), settings.tie)
    settings = replace(settings, prior=prior)
    require_default(settings, NOT_TAKEN, "a robot with a free base")
    if settings.cutoff == AUTO:
        raise IdentificationError(
            "the cut-off of a robot with a free base is not chosen from the log, whose filter ends "
            "at every change of a contact; give --cutoff HZ, or leave it out"
        )
    for log in logs:
        plausibility.require_clock(log)
        if log.is_commanded != logs[0].is_commanded:
            raise IdentificationError(
                "some of the logs hold commanded torques and some measured ones, whose friction "
                "and delay differ; identify each kind alone"
            )
    share = (settings.split or Split()).joined()[1]
    if not 0.1 <= share <= 0.95:
        raise IdentificationError(
            f"--split needs a training share of 0.1 to 0.95 of the log, got {share:g}"
        )
    method = settings.estimator
    if method.needs_samples(settings.preset):
        raise IdentificationError(
            f"the method {method.name} takes motion and torques sample by sample, and the rows of "
            "a free base are equations of which unknown wrenches were eliminated; use one of "
            f"{', '.join(methods_from_statistics())}"
        )
    return settings


@dataclass(frozen=True, slots=True, eq=False)
class PreparedWalk:
    """Motion of one log or several, and instants of its parts, with sentences on them."""

    logs: Sequence[FreeBaseRecording]
    lib: Library
    settings: Settings
    cutoff_hz: float | None  # of the low-pass
    rows: str  # base, joints or all
    motion: FreeBaseMotion
    drives: equations.Drives | None
    friction: Friction  # columns of the drives
    known_friction: FrictionPrior | None  # prior of their coefficients, (n, k)
    sensors: dict[str, float]  # σ of the errors of sensors, whose coefficients are first
    parts: tuple[Integers, ...]  # instants of training, of validation unless it is joined, of test
    instants: Integers  # of all parts
    tested: equations.FreeBaseRows
    notes: tuple[str, ...]

    @property
    def of_drives(self) -> slice:
        """Places of the friction coefficients, joint by joint, behind those of the sensors."""
        first = len(self.sensors)
        return slice(first, first + self.lib.n_joints * len(self.friction.columns))

    def rows_of(self, motion: FreeBaseMotion) -> equations.FreeBaseRows:
        """Equations of some instants."""
        return equations.rows_of(self.lib, motion, self.rows, self.drives)

    def units_of(self, names: Sequence[str]) -> tuple[str, ...]:
        """Units of rows; none of equations that mix them."""
        units = [*["N"] * 3, *["N*m"] * 3, *file_units(self.lib.manifest)]
        of_rows = dict(zip(self.lib.row_names, units, strict=True))
        return tuple(of_rows.get(name, "") for name in names)


def usual_rows(logs: Sequence[FreeBaseRecording]) -> str:
    """Rows of logs for which none are named."""
    return "base" if any(log.tau is None for log in logs) else "all"


def prepared_walk(
    logs: Sequence[FreeBaseRecording], lib: Library, settings: Settings, trim_s: float, joins: bool
) -> PreparedWalk:
    """Motion of logs that agree with the robot; joined, the validation part trains."""
    settings = settings_of_walks(logs, lib, settings)
    split, is_commanded = settings.split or Split(), logs[0].is_commanded
    shares = split.joined()[1:] if joins else split.validation
    rows = settings.rows or usual_rows(logs)
    cutoff_hz, drives, notes = cutoff_of(settings.cutoff), None, list[str]()
    if is_commanded:
        states = [equations.with_contact_states(log, lib) for log in logs]
        logs = [log for log, _ in states]
        notes = [
            f"{log.name}: {note}" if len(logs) > 1 else note
            for log, said in states
            for note in said
        ]
    terms = friction_of(logs[0].joints, settings)
    if terms is None and settings.prior is not None:
        terms = settings.prior.friction_model
    if terms is None:
        terms = Friction(row_noise.COLUMNS if is_commanded else ())
    has_drives = is_commanded or bool(terms.columns) or settings.delay is not None
    plausibility.require_prior_of_rows(settings.prior, has_drives)

    def motion_at(late: float, columns: Friction | None) -> FreeBaseMotion:
        return joined([motion_of(log, lib.joint_names, cutoff_hz, late, columns) for log in logs])

    if has_drives:
        if any(log.tau is None for log in logs) or (rows == "base" and not is_commanded):
            raise IdentificationError(
                "friction and delay belong to the torques of joints, which the rows of the base do "
                "not contain; use --settings rows=all with a log that has tau"
            )
        trim_s = max(trim_s, row_noise.LATEST_S, 0.0 if cutoff_hz is None else 1.0 / cutoff_hz)

        def train_at(late: float, columns: Friction) -> FreeBaseMotion:
            motion = motion_at(late, columns)
            return motion.rows(parts_of(motion, shares, trim_s)[0])

        delay_s = _stated_delay(settings.delay, is_commanded)
        if terms.columns[:1] == (AUTO,):
            more = terms.columns[1:] or (row_noise.COLUMNS[2:] if is_commanded else ())
            usual = replace(terms, columns=(*row_noise.COLUMNS[:2], *more))
            first = row_noise.drives_of(lib, rows, usual, delay_s, train_at, settings.prior)
            choice = row_noise.friction_by_choice(lib, rows, first, train_at)
            terms, notes = choice.chosen.terms, [*notes, choice.sentence]
        drives = row_noise.drives_of(lib, rows, terms, delay_s, train_at, settings.prior)
    late, columns = (0.0, None) if drives is None else (drives.delay_s, drives.terms)
    motion = motion_at(late, columns)
    for name, instants in motion.each():
        plausibility.require_joint_units(lib, motion.rows(instants), name)
    parts = parts_of(motion, shares, trim_s, None if drives is None else cutoff_hz)
    train, test = motion.rows(parts[0]), motion.rows(parts[-1])
    trained, tested = (equations.rows_of(lib, part, rows, drives) for part in (train, test))
    for name, instants in train.each():
        if drives is None:
            plausibility.require_forces_on_robot(lib, trained, instants, name)
        plausibility.require_contact_conventions(lib, train.rows(instants), name)
        plausibility.require_torque_sign(lib, train.rows(instants), name)
    return PreparedWalk(
        *(logs, lib, settings, cutoff_hz, rows, motion, drives, terms),
        known_friction(lib, settings, terms.columns, terms) if terms.columns else None,
        dict(equations.sensor_errors(motion.contacts, motion.logs)),
        *(parts, np.sort(np.concatenate(parts)), tested, tuple(notes)),
    )


def _stated_delay(delay: float | str | None, is_commanded: bool) -> float | None:
    """Delay of the torques [s]; None where it is estimated."""
    if delay is None:
        return None if is_commanded else 0.0
    if delay == AUTO:
        return None
    seconds = number_of(str(delay))
    first, last = row_noise.EARLIEST_S, row_noise.LATEST_S
    if seconds is None or not first <= seconds <= last:
        raise IdentificationError(
            f"--delay needs {AUTO} or a number of {first:g} to {last:g} s here, got '{delay}'"
        )
    return seconds


def parts_of(
    motion: FreeBaseMotion, shares: Sequence[float], trim_s: float, cutoff_hz: float | None = None
) -> tuple[Integers, ...]:
    """Instants of the parts of every log that end at some shares, without `trim_s` [s] at its ends.

    With a cut-off they are `ROWS_PER_PERIOD`: more rows of a low-pass contain nothing new.
    """
    parts: list[list[Integers]] = [[] for _ in (*shares, 1.0)]
    for name, rows in motion.each():
        t = motion.t[rows]
        inside = rows[(t >= t[0] + trim_s) & (t <= t[-1] - trim_s)]
        borders = t[0] + np.array(shares) * (t[-1] - t[0])
        number = np.searchsorted(borders, motion.t[inside], side="right")
        step = 1
        if cutoff_hz is not None:
            period = 1.0 / (cutoff_hz * float(np.median(np.diff(t))))
            # Stamps are rounded, so that 20 rows may be 19.9999.
            step = max(1, int(round(period, 3) / ROWS_PER_PERIOD))
        for k, part in enumerate(parts):
            part.append(inside[number == k][::step])
            if not part[-1].size:
                raise IdentificationError(
                    f"{name}: no row is left for training or test; record for longer"
                )
    return tuple(map(np.concatenate, parts))


def notes_on(
    data: PreparedWalk, trained: equations.FreeBaseRows, noise: NoiseFloor | None
) -> tuple[str, ...]:
    """Sentences on the rows: how many, with which noise and offsets, and what was not read."""
    notes = list(data.notes)
    if noise is not None:
        independent = trained.samples.tau.size / noise.inflation
        notes.append(
            f"{independent:.0f} independent equations for {len(data.lib.base_columns)} base "
            "parameters: most of the result is the prior, and the residual of the URDF counts as "
            "noise, without its mean and errors of sensors"
        )
    if trained.offsets.size:
        force, moment = equations.OFFSET_SIGMA[[0, -1]]
        notes.append(
            f"intervals contain constant offsets of the contact sensors of {force:g} N and "
            f"{1e3 * moment:g} mN·m (σ): an offset of a force changes the total mass by as much; "
            "state the standard deviation of those of vertical forces in N by contact_force_z_sigma"
        )
    fewest, left = np.sort(trained.basis.any(axis=1).sum(axis=1))[[0, -1]]
    if fewest < len(trained.names):
        counts = f"{left}" if fewest == left else f"{fewest} to {left}"
        notes.append(
            f"contact wrenches are not measured completely: {counts} of {len(trained.names)} "
            "equations per instant are left"
        )
    if unread := dict.fromkeys(name for log in data.logs for name in log.unread):
        notes.append(
            f"arrays that are not read: {', '.join(unread)}; expected names are listed in "
            "docs/howto/free-base.md"
        )
    return tuple(notes)
