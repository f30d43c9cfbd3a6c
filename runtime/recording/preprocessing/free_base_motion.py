"""Low-pass and derivatives of a recording with a free base.

    [ω×] = Rᵀ Ṙ,   v = Rᵀ ṗ,   [ω̇×] = skew part of Ṙᵀ Ṙ + Rᵀ R̈,   v̇ = Rᵀ p̈ − ω × v

R, p and q pass the same zero-phase low-pass as torques and wrenches, and R is turned back into a
rotation. What the log states of velocities and accelerations is filtered and taken as it is.
Torques and wrenches are filtered piece by piece, where a piece ends with a change of what is
unknown of the contacts: the force of a foot without a sensor enters the torques, and a filter
across its lift-off would bring it into rows whose equations do not contain it. Where the sensors of
the contacts have a low-pass of their own, everything else passes it first, see `lagged`.

Twist and acceleration that the log states are compared with the pose.

    twist = [Rᵀ ṗ; ω],   acceleration = [d(Rᵀ ṗ)/dt; ω̇],   all in axes of the base

Instead logs often hold ṗ or ω in axes of the world, ω first, the acceleration of the origin
v̇ + ω × v, or what an accelerometer reads, v̇ + ω × v − Rᵀ g. A statement is refused where one of
these is far closer to it than the convention, in the median of the rows.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from runtime.errors import RecordingError
from runtime.library import Array, Integers, Mask
from runtime.recording.consistency import unwrap
from runtime.recording.free_base import Contacts, FreeBaseRecording
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.preprocessing import segments
from runtime.recording.preprocessing.filters import lagged, low_pass
from runtime.recording.recording import Recording
from runtime.recording.settings import COLUMNS, Friction, JointMotion

_FAR = 0.1  # distance to the convention, relative to the statement, from which others are tried

_CLOSER = 0.3  # distance to another convention over that to the expected one that names it

_UP = np.array([0.0, 0.0, 9.81])  # what an accelerometer at rest reads, in axes of the world [m/s²]


def require_twist(given: Array, expected: Array, turn: Array, t: Array, name: str) -> None:
    """Refuse a twist (N, 6) in another convention than the expected one."""
    linear, angular = expected[:, :3], expected[:, 3:]
    reordered = "has a quaternion w, x, y, z, expected x, y, z, w; reorder its columns"
    # With M = Rᵀ for R, ω from the pose is −R ω, so that the true one is −M ω.
    inverse = "is the pose of the world in the base, expected that of the base in the world; invert"
    others = {reordered: _reordered(turn, t), inverse: -_turned(turn, angular)}
    _require(given[:, 3:], angular, others, f"{name}: base_pose")
    swapped = "holds the other half, expected velocity, then angular velocity; swap the halves"
    halves = {":3": (given[:, :3], linear, angular), "3:": (given[:, 3:], angular, linear)}
    for half, (stated, here, other) in halves.items():
        others = {_WORLD: _turned(turn, here), swapped: other}
        _require(stated, here, others, f"{name}: base_twist[:, {half}]")


def require_acceleration(
    given: Array, expected: Array, twist: Array, turn: Array, name: str
) -> None:
    """Refuse an acceleration in another convention."""
    linear, angular = expected[:, :3], expected[:, 3:]
    swapped = "holds the other half, expected v̇, then ω̇; swap the halves"
    origin = linear + np.cross(twist[:, 3:], twist[:, :3])
    others = {
        "is the acceleration of the origin, expected the derivative of the velocity in axes of "
        "the base; subtract ω × v": origin,
        "is what an accelerometer reads, expected the derivative of the velocity in axes of the "
        "base; add Rᵀ g, g = (0, 0, −9.81), and subtract ω × v": origin
        + _turned(np.swapaxes(turn, 1, 2), np.broadcast_to(_UP, origin.shape)),
        "is the acceleration of the origin in axes of the world, expected the derivative of the "
        "velocity in axes of the base; multiply it by Rᵀ and subtract ω × v": _turned(turn, origin),
        swapped: angular,
    }
    _require(given[:, :3], linear, others, f"{name}: base_acceleration[:, :3]")
    others = {_WORLD: _turned(turn, angular), swapped: linear}
    _require(given[:, 3:], angular, others, f"{name}: base_acceleration[:, 3:]")


_WORLD = "is in axes of the world, expected those of the base; multiply it by Rᵀ"


def _reordered(turn: Array, t: Array) -> Array:
    """Angular velocity of the base if its quaternions w, x, y, z were read as x, y, z, w."""
    right = Rotation.from_quat(Rotation.from_matrix(turn).as_quat()[:, [1, 2, 3, 0]]).as_matrix()
    spin = np.swapaxes(right, 1, 2) @ np.gradient(right, t, axis=0)
    return np.asarray(np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1))


def _require(given: Array, expected: Array, others: dict[str, Array], what: str) -> None:
    far, size = _distance(given, expected), _distance(given, np.zeros_like(given))
    if far <= _FAR * size:
        return
    for sentence, other in others.items():
        # It explains the statement too, which noise about zero would not be.
        if _distance(given, other) < _CLOSER * min(far, size):
            raise RecordingError(f"{what} {sentence}")


def _distance(one: Array, other: Array) -> float:
    """Median over the rows of the length of the difference."""
    return float(np.median(np.linalg.norm(one - other, axis=1)))


def _turned(turn: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", turn, vectors))


_JITTER = 0.01
"""Deviation of a time step from the median from which the log is resampled, as elsewhere."""
_GAP_S = 0.1  # longest gap that is filled
_OF_MOTION = ("position", "rotation", "q", "dq", "ddq", "twist", "acceleration")
"""Names of the signals that are differentiated; the others are forces."""
_ARRAYS = ("t", "q", "dq", "ddq", "tau", "rotation", "tau_rate", "friction", "log")
"""Arrays of a motion with one entry per instant."""
_OF_CONTACTS = ("links", "position", "axes", "offset_sigma", "sharing_sigma", "crosstalk_sigma")
"""Fields of contacts that several logs share."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeBaseMotion:
    """Prepared rows: coordinates of the kernels, base first, and what acts on the robot."""

    t: Array  # (N,) s
    q: Array  # q, dq, ddq: (N, 6 + n), see `runtime.library.free_base`
    dq: Array
    ddq: Array
    tau: Array | None  # (N, n) [N·m, N]; None where torques were not measured
    contacts: Contacts  # contacts at these instants
    rotation: Array  # (N, 3, 3) R of the base in the world
    # (N, n) derivative of the torques, behind the same low-pass; None without torques
    tau_rate: Array | None = None
    # (N, n, k) friction columns, those that are not linear behind that low-pass, too
    friction: Array | None = None
    log: Integers = field(kw_only=True)  # (N,) number of the log of every instant
    logs: tuple[str, ...] = field(kw_only=True)  # names of the logs

    def __len__(self) -> int:
        return len(self.t)

    def each(self) -> Iterator[tuple[str, Integers]]:
        """Name of every log, and its instants."""
        return ((name, np.flatnonzero(self.log == k)) for k, name in enumerate(self.logs))

    @property
    def seconds(self) -> float:
        """Duration without the pauses between logs."""
        return sum(float(np.ptp(self.t[rows])) for _, rows in self.each() if rows.size)

    def rows(self, taken: slice | Integers) -> "FreeBaseMotion":
        """Some of the instants."""
        contacts, sensed = self.contacts, self.contacts.sensed
        sensed = None if sensed is None else sensed[taken]
        of_contacts = replace(contacts, wrench=contacts.wrench[taken], sensed=sensed)
        arrays = {key: getattr(self, key) for key in _ARRAYS}
        cut = {key: values[taken] for key, values in arrays.items() if values is not None}
        return replace(self, contacts=of_contacts, **cut)


def motion_of(
    recording: FreeBaseRecording,
    joints: tuple[str, ...],
    cutoff_hz: float | None = None,
    delay_s: float = 0.0,
    terms: Friction | None = None,
) -> FreeBaseMotion:
    """Filter and differentiate a recording, whose torque acts `delay_s` later.

    Friction columns that are not linear pass the low-pass like the torques, since the filtered sign
    of a speed is not the sign of the filtered speed.
    """
    blocks = _signals(recording, places_of(recording, joints), delay_s)
    width = sum(block.shape[1] for key, block in blocks.items() if key in _OF_MOTION)
    wrench = recording.contacts.wrench.reshape(len(recording.t), -1)
    whole = Recording(recording.t, np.hstack(list(blocks.values())), name=recording.name)
    whole, unknown = _on_uniform_clock(whole, np.isnan(wrench))
    signals = _with_lag(recording.contacts, whole, blocks)
    motion = Recording(whole.t, signals[:, :width], name=recording.name)
    forces, inside = signals[:, width:], np.arange(len(whole))
    if cutoff_hz is not None:
        motion = low_pass(motion, cutoff_hz)
    if terms is not None:
        dry = _dry_friction(motion, blocks, terms)
        blocks["friction"] = np.zeros((len(whole), dry.shape[1]))
        blocks["friction"][np.searchsorted(whole.t, motion.t)] = dry
        forces = np.hstack([forces, blocks["friction"]])
    if cutoff_hz is not None:
        forces, inside = _low_pass_of_forces(whole.t, forces, unknown, cutoff_hz)
    motion = segments.differentiate(motion, from_position=True)
    kept = np.intersect1d(inside, np.searchsorted(whole.t, motion.t))
    if not kept.size:
        raise RecordingError(
            f"{recording.name} has only stretches that are too short for the low-pass, between "
            "gaps or changes of contact; raise --cutoff, or give a log with longer ones"
        )
    motion = motion.take(np.isin(motion.t, whole.t[kept]), "Took the rows with forces.")
    forces, unknown = forces[np.isin(inside, kept)], unknown[kept]
    parts = (motion.q, motion.required("dq"), motion.required("ddq"))
    x, dx, ddx = (_by_name(np.hstack([part, forces]), blocks) for part in parts)
    turned = Rotation.from_matrix(x["rotation"].reshape(-1, 3, 3))
    rotation = turned.as_matrix()
    twist, acceleration = _base_rates(
        rotation,
        *(each["rotation"].reshape(-1, 3, 3) for each in (dx, ddx)),
        *(each["position"] for each in (dx, ddx)),
    )
    if "twist" in blocks:
        require_twist(x["twist"], twist, rotation, motion.t, recording.name)
        twist, acceleration = x["twist"], dx["twist"]
    if "acceleration" in blocks:
        given = x["acceleration"]
        require_acceleration(given, acceleration, twist, rotation, recording.name)
        acceleration = given
    dq = x.get("dq", dx["q"])
    ddq = x.get("ddq", dx.get("dq", ddx["q"]))
    known = np.where(unknown, np.nan, x["wrench"]).reshape(len(motion), -1, 6)
    return FreeBaseMotion(
        motion.t,
        np.hstack([x["position"], turned.as_rotvec(), x["q"]]),
        np.hstack([twist, dq]),
        np.hstack([acceleration, ddq]),
        x.get("tau"),
        replace(recording.contacts, wrench=known, sensed=x.get("sensed")),
        rotation,
        x.get("tau_rate"),
        None if terms is None else _friction(x["friction"], dq, ddq, terms),
        log=np.zeros(len(motion), dtype=int),
        logs=(recording.name,),
    )


def joined(motions: Sequence[FreeBaseMotion]) -> FreeBaseMotion:
    """Motions of several logs, one after the other."""
    first, *others = motions
    if not others:
        return first
    for other in others:
        for key in _OF_CONTACTS:
            if not np.array_equal(getattr(first.contacts, key), getattr(other.contacts, key)):
                raise RecordingError(
                    f"{other.logs[0]} has other contacts than {first.logs[0]} ({key}), and one fit "
                    "needs the same in all logs; list every contact in each, with contact_flags 0 "
                    "where there is none"
                )
    arrays = {key: [getattr(each, key) for each in motions] for key in _ARRAYS}
    arrays["t"] = [segments.on_one_clock(arrays["t"])]
    arrays["log"] = [each.log + k for k, each in enumerate(motions)]
    whole: dict[str, Any] = {
        key: None if any(part is None for part in parts) else np.concatenate(parts)
        for key, parts in arrays.items()
    }
    wrench, sensed = (
        np.concatenate([getattr(each.contacts, key) for each in motions])
        for key in ("wrench", "sensed")
    )
    contacts = replace(first.contacts, wrench=wrench, sensed=sensed)
    names = tuple(each.logs[0] for each in motions)
    return replace(first, contacts=contacts, logs=names, **whole)


def _by_name(values: Array, blocks: Mapping[str, Array]) -> dict[str, Array]:
    """Columns side by side by the names of the signals."""
    ends = np.cumsum([block.shape[1] for block in blocks.values()])[:-1]
    return dict(zip(blocks, np.split(values, ends, axis=1), strict=True))


def _dry_friction(motion: Recording, blocks: Mapping[str, Array], terms: Friction) -> Array:
    """Friction columns of a filtered motion that are not linear, (N, n k)."""
    x = _by_name(motion.q, {key: each for key, each in blocks.items() if key in _OF_MOTION})
    dq = x["dq"] if "dq" in x else np.gradient(x["q"], motion.t, axis=0)
    names = tuple(name for name in terms.columns if not COLUMNS[name].is_linear)
    values = friction_columns(JointMotion(dq, x["q"]), replace(terms, columns=names))
    return values.reshape(len(motion), dq.shape[1] * len(names))


def _friction(filtered: Array, dq: Array, ddq: Array, terms: Friction) -> Array:
    """Friction columns, (N, n, k): linear ones of the filtered motion, others as filtered."""
    motion = JointMotion(dq, ddq=ddq)
    dry = sum(not COLUMNS[name].is_linear for name in terms.columns)
    others = iter(np.moveaxis(filtered.reshape(*dq.shape, dry), -1, 0))
    parts = [
        COLUMNS[name].function(motion, terms) if COLUMNS[name].is_linear else next(others)
        for name in terms.columns
    ]
    return np.stack(parts, axis=-1) if parts else np.zeros((*dq.shape, 0))


def _signals(recording: FreeBaseRecording, places: list[int], delay_s: float) -> dict[str, Array]:
    """Signals by name, (N, …) each, those of the motion first."""
    count, t = len(recording.t), recording.t
    blocks: dict[str, Array] = {
        "position": recording.position,
        "rotation": recording.rotation.reshape(count, 9),
        "q": unwrap(recording.q[:, places])[0],
    }
    for key, columns in (("dq", places), ("ddq", places), ("twist", None), ("acceleration", None)):
        values = getattr(recording, key)
        if values is not None:
            blocks[key] = values if columns is None else values[:, columns]
    blocks["wrench"] = np.nan_to_num(recording.contacts.wrench.reshape(count, -1), nan=0.0)
    if recording.contacts.sensed is not None:
        blocks["sensed"] = recording.contacts.sensed
    if recording.tau is not None:
        tau = recording.tau[:, places]
        blocks["tau"] = segments.interpolate(t - delay_s, t, tau) if delay_s else tau
        blocks["tau_rate"] = np.gradient(blocks["tau"], t, axis=0)
    return blocks


def _with_lag(contacts: Contacts, whole: Recording, blocks: Mapping[str, Array]) -> Array:
    """Signals with the lag of the contacts' sensors in those that these do not measure."""
    if contacts.cutoff_hz is None:
        return whole.q
    names = np.repeat(list(blocks), [block.shape[1] for block in blocks.values()])
    others = np.flatnonzero((names != "wrench") & (names != "sensed"))
    signals = whole.q.copy()
    signals[:, others] = lagged(whole, whole.q[:, others], contacts.cutoff_hz)
    return signals


def _on_uniform_clock(log: Recording, unknown: Mask) -> tuple[Recording, Mask]:
    """A log on a uniform clock of its own rate, without its gaps, and what is unknown there."""
    steps = np.diff(log.t)
    if np.abs(steps / np.median(steps) - 1).max() <= _JITTER:
        return log, unknown
    rate = 1.0 / float(steps[~segments.holes(log.t)].mean())
    whole = segments.resample(log, rate, max(_GAP_S, 2.0 / rate))
    return whole, _unknown_between(log.t, unknown, whole.t)


def _unknown_between(t: Array, unknown: Mask, grid: Array) -> Mask:
    """Components that are unknown on a grid: those of either row beside an instant."""
    after = np.searchsorted(t, grid).clip(1, len(t) - 1)
    near = 1e-6 * np.diff(t)[after - 1]
    at_before, at_after = np.abs(grid - t[after - 1]) <= near, np.abs(grid - t[after]) <= near
    before = unknown[after - 1] & ~at_after[:, None]
    return np.asarray(before | (unknown[after] & ~at_before[:, None]))


def _low_pass_of_forces(
    t: Array, forces: Array, unknown: Mask, cutoff_hz: float
) -> tuple[Array, Integers]:
    """Low-pass of torques and wrenches between changes of what is unknown."""
    changed = np.concatenate([[False], (unknown[1:] != unknown[:-1]).any(axis=1)])
    # A clock that stands still for ten steps at every change has a hole there for the filter.
    clock = t + 10.0 * np.median(np.diff(t)) * np.cumsum(changed)
    filtered = low_pass(Recording(clock, forces), cutoff_hz)
    return filtered.q, np.searchsorted(clock, filtered.t)


def _base_rates(
    rotation: Array, d_rotation: Array, dd_rotation: Array, velocity: Array, acceleration: Array
) -> tuple[Array, Array]:
    """Twist and its derivative in axes of the base from derivatives in those of the world."""
    back = np.swapaxes(rotation, 1, 2)
    omega = _vee(back @ d_rotation)
    alpha = _vee(np.swapaxes(d_rotation, 1, 2) @ d_rotation + back @ dd_rotation)
    v = np.einsum("nij,nj->ni", back, velocity)
    dv = np.einsum("nij,nj->ni", back, acceleration) - np.cross(omega, v)
    return np.hstack([v, omega]), np.hstack([dv, alpha])


def _vee(matrix: Array) -> Array:
    """Vector of the skew-symmetric part."""
    skew = (matrix - np.swapaxes(matrix, 1, 2)) / 2
    return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)


def places_of(recording: FreeBaseRecording, joints: tuple[str, ...]) -> list[int]:
    """Columns of a recording in the order of the robot's joints."""
    names = recording.joint_names
    if not names:
        if recording.q.shape[1] != len(joints):
            raise RecordingError(
                f"{recording.name} has {recording.q.shape[1]} joints, the robot has {len(joints)}; "
                "name the columns by an array `joints`"
            )
        return list(range(len(joints)))
    missing = [joint for joint in joints if joint not in names]
    if missing:
        raise RecordingError(
            f"{recording.name} has no joint '{missing[0]}' of the robot; lock it by "
            "symgen build --lock, or add its column"
        )
    return [names.index(joint) for joint in joints]
