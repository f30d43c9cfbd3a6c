"""A log of a robot with a free base → its equations, those that train and those that test.

Units, signs and conventions of wrenches agree with the robot, or the log is refused:

    r = w_b(π_URDF) − Σ_c J_b,cᵀ w_c,   w_c under other names, in other axes, halves or units

The base needs no joint torque, so its six equations show in which convention a wrench fits.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from runtime.common.texts import number_of
from runtime.errors import IdentificationError
from runtime.estimators.methods import methods_from_statistics
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import FrictionPrior, NoiseFloor
from runtime.identification.drive.symmetry import with_mirrored_links
from runtime.identification.free_base import drives as row_noise
from runtime.identification.free_base import rows as equations
from runtime.identification.problem_setup import known_friction
from runtime.identification.settings import AUTO, Settings, cutoff_of, friction_of, require_default
from runtime.library import Array, Integers, Library
from runtime.library.free_base import FREEDOM
from runtime.library.manifest import file_units
from runtime.library.parameters import links, mass
from runtime.recording import Friction, Recording, Split, consistency
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
        require_clock(log)
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
    require_prior_of_rows(settings.prior, has_drives)

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
        require_joint_units(lib, motion.rows(instants), name)
    parts = parts_of(motion, shares, trim_s, None if drives is None else cutoff_hz)
    train, test = motion.rows(parts[0]), motion.rows(parts[-1])
    trained, tested = (equations.rows_of(lib, part, rows, drives) for part in (train, test))
    for name, instants in train.each():
        if drives is None:
            require_forces_on_robot(lib, trained, instants, name)
        require_contact_conventions(lib, train.rows(instants), name)
        require_torque_sign(lib, train.rows(instants), name)
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


_FASTEST = 300.0
"""RMS acceleration of the base, m/s², from which its unit or its noise is wrong: 30 times g."""


def require_prior_of_rows(prior: PriorFile | None, has_drives: bool) -> None:
    """Refuse entries of a prior that the equations of a log do not contain."""
    if prior is None:
        return
    tables: dict[str, object] = {"noise": prior.noise}
    if not has_drives:
        tables |= {"armature": prior.armature, "friction": prior.friction}
    stated = [f"[{key}]" for key, value in tables.items() if value is not None]
    if stated:
        raise IdentificationError(
            f"the prior states {', '.join(stated)}, and the equations of this log of a free base "
            "do not contain it; remove this table from the prior"
            + ("" if prior.noise is not None else ", or estimate friction with --friction")
        )


def require_clock(recording: FreeBaseRecording) -> None:
    """Refuse a time that is not in seconds, by velocities and positions of joints or base.

    A log without them is refused where its rate is too low to differentiate.
    """
    t, name = recording.t, recording.name
    if recording.dq is not None:
        measured = Recording(t, recording.q, dq=recording.dq)
    elif recording.twist is not None:
        velocity = np.einsum("nij,nj->ni", recording.rotation, recording.twist[:, :3])
        measured = Recording(t, recording.position, dq=velocity)
    else:
        rate = 1.0 / float(np.median(np.diff(t)))
        if rate < consistency.LEAST_RATE:
            raise IdentificationError(
                f"{name} has no velocities, and its rate of {rate:.3g} Hz is too low to "
                "differentiate the positions; give t in s"
            )
        return
    if len(t) <= 2 * consistency.STRIDE:
        return
    slopes = consistency.slopes_of(measured)
    if pair := consistency.unit_of_slopes(slopes, consistency.UNITS_OF_TIME):
        unit, wrong = pair
        raise IdentificationError(
            f"{name}: time looks like {unit}, positions change by {slopes[wrong[0]]:.3g} times "
            "the integral of the velocities; give t in s"
        )


def require_joint_units(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse joint positions far outside the limits, velocities in degrees, positions in mm."""
    fastest = float(np.sqrt(np.mean(np.sum(np.square(motion.ddq[:, :3]), axis=1))))
    if fastest > _FASTEST:
        raise IdentificationError(
            f"{name}: the base accelerates by {fastest:.3g} m/s² (RMS), expected at most "
            f"{_FASTEST:g}; give positions in m and t in s, or a low-pass with --cutoff"
        )
    q, dq = motion.q[:, FREEDOM:], motion.dq[:, FREEDOM:]
    if sentence := consistency.sentence_on_limits(q, lib):
        raise IdentificationError(
            f"{name}: {sentence}; give q in this unit, and the names of its columns by joints"
        )
    degree, slopes = consistency.DEGREE, consistency.slopes_of(Recording(motion.t, q, dq=dq))
    looks = {"degrees per second": 1 / degree, "radians for q in degrees": degree}
    if pair := consistency.unit_of_slopes(slopes, looks):
        unit, wrong = pair
        raise IdentificationError(
            f"{name}: the velocity of joint '{lib.joint_names[wrong[0]]}' looks like {unit}, "
            "expected the derivative of q; convert q to rad and dq to rad/s"
        )


def require_forces_on_robot(
    lib: Library, rows: equations.FreeBaseRows, instants: Integers, name: str
) -> None:
    """Refuse opposite wrenches, such as forces on the ground, by the equations of the base."""
    alone = not any(row in rows.names for row in lib.joint_names)
    complete = rows.samples.equations == len(rows.names) >= FREEDOM
    if not (alone or complete):
        return
    kept = slice(None) if alone else slice(FREEDOM)
    some = rows.samples.rows(instants)
    if equations.is_opposite(some.rigid(lib, lib.pi0)[:, kept], some.tau[:, kept]):
        raise IdentificationError(
            f"{name}: the contact wrenches are opposite to those that hold the URDF, expected "
            "forces on the robot; change their sign, or give quaternions of base_pose as x y z w"
        )


_CLOSER = 3.0
"""Residual in the stated convention over that in another one from which the latter is named."""
_INSTANTS = 300
_ALL = 4  # number of contacts up to which every permutation is tried; beyond it, exchanges of two
_UNITS = {"kgf": 9.81, "kN": 1e3, "mN": 1e-3}  # unit of force → N
_NEAR = 0.25
"""Relative distance of a mean vertical force from the weight of the URDF that names its unit."""


def require_contact_conventions(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse wrenches under names of other contacts, in other axes, halves or units."""
    contacts = motion.contacts
    vertical = contacts.wrench[..., equations.VERTICAL]
    if contacts.axes == "world" and contacts.links and not np.isnan(vertical).any():
        # The mean of the vertical forces is the weight of the URDF, or it has another unit.
        mean = float(vertical.sum(axis=1).mean())
        weight = float(mass(links(lib.pi0)).sum()) * float(np.linalg.norm(lib.gravity))
        for unit, factor in _UNITS.items():
            if abs(mean * factor - weight) < _NEAR * weight:
                raise IdentificationError(
                    f"{name}: the vertical forces are {mean:.3g} in the mean, and the URDF weighs "
                    f"{weight:.3g} N; the forces look like {unit}, expected N; convert them"
                )
    known = np.flatnonzero(~np.isnan(contacts.wrench).any(axis=(1, 2)))
    if not contacts.links or known.size < 2:
        return
    some = motion.rows(known[np.linspace(0, known.size - 1, _INSTANTS).astype(int)])
    needed = lib.inverse_dynamics(some.q, some.dq, some.ddq, lib.pi0)[:, :FREEDOM]
    shape = (len(some), len(contacts.links), 6, -1)
    jacobian = equations.contact_jacobian(lib, some).reshape(shape)[..., :FREEDOM]
    stated = float(np.linalg.norm(needed - _force(jacobian, some.contacts.wrench)))
    others = _other_conventions(lib, some, jacobian)
    distance = {key: float(np.linalg.norm(needed - force)) for key, force in others.items()}
    best = min(distance, key=lambda key: distance[key])
    if stated > _CLOSER * distance[best]:
        raise IdentificationError(f"{name}: the URDF shows that {best}")


def require_torque_sign(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse joint torques of the opposite sign, where every wrench was measured."""
    wrench = motion.contacts.wrench
    if motion.tau is None or np.isnan(wrench).any():
        return
    needed = lib.inverse_dynamics(motion.q, motion.dq, motion.ddq, lib.pi0)[:, FREEDOM:]
    jacobian = equations.contact_jacobian(lib, motion)[..., FREEDOM:]
    needed = needed - np.einsum("nck,nc->nk", jacobian, wrench.reshape(len(motion), -1))
    if equations.is_opposite(needed, motion.tau):
        raise IdentificationError(
            f"{name}: tau is opposite to the torques that move the URDF, expected those that the "
            "drives apply to the joints; change its sign"
        )


def _force(jacobian: Array, wrench: Array) -> Array:
    """Forces and moments on the base, (N, 6), by wrenches (N, C, 6) and Jacobians (N, C, 6, 6)."""
    return np.einsum("ncik,nci->nk", jacobian, wrench)


def _other_conventions(lib: Library, motion: FreeBaseMotion, jacobian: Array) -> dict[str, Array]:
    """Forces on the base by what a log may mean instead, by the sentence that names it."""
    contacts, wrench = motion.contacts, motion.contacts.wrench
    swapped = "contact_wrench holds the moment first, expected the force first; swap the halves"
    forces = {swapped: _force(jacobian, np.roll(wrench, 3, axis=2))}
    for unit, factor in _UNITS.items():
        sentence = f"the contact wrenches are in {unit}, expected N and N·m; convert them"
        forces[sentence] = factor * _force(jacobian, wrench)
    index = [lib.link_names.index(link) for link in contacts.links]
    turn = lib.link_poses(motion.q)[:, index, :3, :3]  # R of the contacts' links in the world
    other = "world" if contacts.axes == "link" else "link"
    halves = wrench.reshape(*wrench.shape[:2], 2, 3)
    product = "ncji,nchj->nchi" if other == "world" else "ncij,nchj->nchi"
    forces[
        f"the contact wrenches are in axes of the {other}, and the log states those of the "
        f"{contacts.axes}; write contact_axes = '{other}'"
    ] = _force(jacobian, np.einsum(product, turn, halves).reshape(wrench.shape))
    for order in _orders(len(contacts.links)):
        names = ", ".join(contacts.links[c] for c in order)
        forces[
            f"the contact wrenches stand under other names: contact_links has "
            f"{', '.join(contacts.links)}, expected {names} in this order; correct contact_links, "
            "and contact_position with it"
        ] = _force(jacobian[:, list(order)], wrench)
    return forces


def _orders(count: int) -> list[tuple[int, ...]]:
    """Permutations that are tried, the stated one left out."""
    stated = tuple(range(count))
    if count <= _ALL:
        return [order for order in permutations(stated) if order != stated]
    exchanged = ({a: b, b: a} for a, b in combinations(stated, 2))
    return [tuple(pair.get(k, k) for k in stated) for pair in exchanged]
