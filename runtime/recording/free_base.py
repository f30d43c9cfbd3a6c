"""Recordings of a robot with a free base: joints, motion of the base, contacts.

An NPZ with one row per instant, SI units:

    t (N,), q (N, n); dq, ddq, tau (N, n) where they were measured; joints (n,) names
    tau_command (N, n) commanded torques instead of tau; or the law of position and velocity that
    commands them: q_des (N, n), kp, kd (n,) or one number, dq_des, tau_ff (N, n)
    base_pose (N, 7) position and quaternion x, y, z, w, or (N, 4, 4); or
    base_position (N, 3) and base_rpy (N, 3) roll, pitch, yaw
    base_twist, base_acceleration (N, 6) in axes of the base, see `runtime.BaseMotion`
    imu_gyro, imu_acceleration (N, 3) of an IMU in axes of the base instead, what it reads;
    imu_position (3,) its place in the frame of the base; then base_rpy needs no base_position
    contact_links (C,) names of moving links; contact_position (C, 3) in their frames
    contact_wrench (N, C, 6) force and moment on the robot at contact_position, NaN where a
    component is not measured; contact_axes "link" or "world"
    contact_force_z (N, C) vertical forces instead, all else unknown
    contact_force_z_sigma (C,) standard deviation of the unknown offsets of these sensors
    contact_force_z_sharing () standard deviation of the relative error of these sensors while
    contacts share the load, see `Contacts`
    contact_force_z_crosstalk (2,) standard deviations of what these sensors read per moment about
    x and y of the link; contact_force_z_cutoff () cut-off of their first-order low-pass
    contact_flags (N, C) whether a contact can transmit a wrench; 0 states that there is none
    contact_kind "surface" or "point", whose moment is zero
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from runtime.common.files import bytes_of
from runtime.errors import RecordingError, ShapeError
from runtime.library import Array, Mask
from runtime.library.free_base import rotation_and_position
from runtime.recording.formats.log_format import Digests
from runtime.recording.formats.npz import open_npz
from runtime.recording.recording import Recording


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """Contacts of a robot with the world."""

    links: tuple[str, ...]  # names of the C links
    position: Array  # (C, 3) point that the wrench is about, in the frame of the link [m]
    wrench: Array  # (N, C, 6) force and moment on the robot [N, N·m]; NaN where it is unknown
    axes: str  # "link" or "world"
    # (C,) standard deviation of unknown offsets of the vertical forces [N]; None where the log does
    # not state it
    offset_sigma: Array | None = None
    # standard deviation of γ: a sensor that reads the share s of ΣF_z reads F (1 + γ (1 − s)); None
    # where the log does not state it
    sharing_sigma: float | None = None
    # (2,) standard deviations of c: a sensor reads c·m more, with m the moments about x and y of
    # the link at `position` [1/m]; None where the log does not state them
    crosstalk_sigma: Array | None = None
    # cut-off of the first-order low-pass of the sensors of the vertical forces [Hz]; None where the
    # log states none
    cutoff_hz: float | None = None
    # (N, C) 1 where the force is that of a sensor, 0 where a flag states that there is none;
    # filtered like the forces
    sensed: Array | None = None
    is_stated: bool = True  # whether the log states which contacts touch


@dataclass(frozen=True, slots=True, eq=False)
class FreeBaseRecording:
    """Motion of joints and base at N instants, with torques and contacts.

    Attributes:
        name: name of the file.
        t: instants, (N,) [s].
        q: joint positions in the order of the file, (N, n) [rad, m].
        joint_names: n names, empty where the file has none.
        rotation: R of the base in the world, (N, 3, 3).
        position: origin of the base in the world, (N, 3) [m].
        contacts: contacts of the robot with the world.
        dq, ddq, tau: joint velocities, accelerations and torques, (N, n); None where they were not
            measured.
        twist, acceleration: of the base, (N, 6); None where they were not measured.
        unread: names of arrays of the file that are not part of the layout.
        is_commanded: whether tau is what a control law commanded.
        source: file name → sha256 of its bytes.
    """

    name: str
    t: Array
    q: Array
    joint_names: tuple[str, ...]
    rotation: Array
    position: Array
    contacts: Contacts
    dq: Array | None = None
    ddq: Array | None = None
    tau: Array | None = None
    twist: Array | None = None
    acceleration: Array | None = None
    unread: tuple[str, ...] = ()
    is_commanded: bool = False
    source: Mapping[str, str] = field(default_factory=dict)

    @property
    def joints(self) -> Recording:
        """The joints alone."""
        return Recording(self.t, self.q, tau=self.tau, name=self.name, source=self.source)


_KEYS = (
    *("t", "q", "dq", "ddq", "tau", "joints", "base_pose", "base_position", "base_rpy"),
    *("base_twist", "base_acceleration", "contact_links", "contact_position", "contact_wrench"),
    *("contact_axes", "contact_force_z", "contact_force_z_sigma", "contact_force_z_sharing"),
    *("contact_force_z_crosstalk", "contact_force_z_cutoff", "contact_flags", "contact_kind"),
    *("tau_command", "q_des", "dq_des", "tau_ff", "kp", "kd"),
    *("imu_gyro", "imu_acceleration", "imu_position"),
)
GRAVITY = 9.81  # gravity in what an accelerometer reads [m/s²]
_FEWEST_ROWS = 8  # fewest instants of a recording

_ZIP = b"PK"  # first bytes of an NPZ


@dataclass(frozen=True, slots=True, eq=False)
class _File:
    """Arrays of a file, and its name for messages."""

    name: str
    arrays: dict[str, NDArray]

    def __contains__(self, key: str) -> bool:
        return key in self.arrays

    def word(self, key: str, choices: tuple[str, ...]) -> str:
        """A word of a choice; the first where the file has none."""
        value = np.asarray(self.arrays.get(key, choices[0]))
        value = value.reshape(()) if value.size == 1 else value
        word = str(_texts(value))
        if word not in choices:
            raise RecordingError(
                f"{self.name}: {key} is '{word}', expected one of {', '.join(choices)}; correct it"
            )
        return word

    def names(self, key: str) -> tuple[str, ...]:
        """Names of an array of texts or of bytes, which HDF5 and older NumPy write."""
        values = self.arrays.get(key, np.array([], dtype=str))
        return tuple(map(str, _texts(np.atleast_1d(values))))

    def optional(self, key: str, *shape: int) -> Array | None:
        """Numbers of a shape; None where the file has no such array."""
        return self.numbers(key, *shape) if key in self else None

    def numbers(self, key: str, *shape: int | str, finite: bool = True) -> Array:
        """Numbers of a shape, in which a text is any size."""
        if key not in self:
            raise RecordingError(
                f"{self.name} has no array {key}; save it with numpy.savez({key}=…)"
            )
        array = self.arrays[key]
        if not shape and array.size == 1:
            array = array.reshape(())
        fits = array.ndim == len(shape) and all(
            isinstance(wanted, str) or wanted == size
            for wanted, size in zip(shape, array.shape, strict=True)
        )
        if array.dtype.kind not in "fiub" or not fits:
            raise RecordingError(
                f"{self.name}: {key} needs real numbers of shape ({', '.join(map(str, shape))}), "
                f"got {array.dtype} of shape {array.shape}"
            )
        values = np.ascontiguousarray(array, dtype=float)
        bad = ~np.isfinite(values) if finite else np.isinf(values)
        if bad.any():
            rows = np.flatnonzero(bad.reshape(len(values), -1).any(axis=1)) if values.ndim else [0]
            remedy = "remove these rows" if finite else "state what was not measured as NaN"
            raise RecordingError(
                f"{self.name}: {key} has {'NaN or infinite' if finite else 'infinite'} values, the "
                f"first in row {rows[0]}; {remedy}"
            )
        return values


def _texts(values: NDArray) -> NDArray:
    """Texts of bytes; others as they are. Bytes of another encoding become a replacement mark."""
    return np.char.decode(values, "utf-8", "replace") if values.dtype.kind == "S" else values


def read_free_base(path: str | PathLike[str]) -> FreeBaseRecording:
    """Read the log of a robot with a free base, an NPZ in the layout of this module.

    Args:
        path: file.

    Returns:
        Motion of joints and base, torques and contacts [SI].

    Raises:
        RecordingError: the file cannot be read, or its arrays do not fit the layout.
    """
    path = Path(path)
    try:
        data = bytes_of(path)
        if not data.startswith(_ZIP):
            raise RecordingError(
                f"{path.name} is no NPZ, expected one with arrays t, q, base_pose and contacts for "
                "a robot with a free base; save it with numpy.savez, see docs/howto/free-base.md"
            )
        arrays = open_npz(data, path.name)
    except (OSError, ValueError) as error:
        raise RecordingError(f"cannot read '{path}': {error}") from None
    digests = Digests()
    digests.of_bytes(path.name, data)
    return replace(free_base_of(arrays, path.name), source=digests)


def free_base_of(arrays: dict[str, NDArray], name: str) -> FreeBaseRecording:
    """The recording that arrays of this layout hold; the name of their file is for messages."""
    file = _File(name, arrays)
    unknown = sorted(key for key in arrays if key.startswith(("base_", "contact_")))
    unknown = [key for key in unknown if key not in _KEYS]
    if unknown:
        raise RecordingError(
            f"{name} has the array {unknown[0]}, expected those of a robot with a free base: "
            f"{', '.join(key for key in _KEYS if key.startswith(('base_', 'contact_')))}; rename it"
        )
    t = file.numbers("t", "N")
    count = len(t)
    if count < _FEWEST_ROWS or not (np.diff(t) > 0).all():
        raise RecordingError(
            f"{name} needs {_FEWEST_ROWS} or more instants t that increase, got {count}; sort the "
            "rows"
        )
    q = file.numbers("q", count, "n")
    rotation, position = _pose(file, count)
    names = file.names("joints")
    if names and len(names) != q.shape[1]:
        raise RecordingError(
            f"{name} names {len(names)} joints, but q has {q.shape[1]} columns; name every column"
        )
    dq = file.optional("dq", *q.shape)
    command = _commanded(file, q, dq)
    twist = file.optional("base_twist", count, 6)
    acceleration = file.optional("base_acceleration", count, 6)
    if "imu_gyro" in file or "imu_acceleration" in file:
        twist, acceleration = _from_imu(file, t, rotation)
        position = np.zeros_like(position)
    return FreeBaseRecording(
        name=name,
        t=t,
        q=q,
        joint_names=names,
        rotation=rotation,
        position=position,
        contacts=_contacts(file, count),
        dq=dq,
        ddq=file.optional("ddq", *q.shape),
        tau=file.optional("tau", *q.shape) if command is None else command,
        twist=twist,
        acceleration=acceleration,
        unread=tuple(sorted(set(arrays) - set(_KEYS))),
        is_commanded=command is not None,
    )


def _commanded(file: _File, q: Array, dq: Array | None) -> Array | None:
    """Commanded torque (N, n) of an array or of a control law; None for none."""
    given = [key for key in ("tau", "tau_command", "q_des") if key in file]
    if len(given) > 1:
        raise RecordingError(
            f"{file.name} has {given[0]} and {given[1]}; keep tau where torques were measured, "
            "else tau_command or q_des of the control law"
        )
    if "q_des" not in file:
        return file.optional("tau_command", *q.shape)
    if dq is None:
        raise RecordingError(
            f"{file.name}: the control law of q_des needs dq; give tau_command instead"
        )

    def gain(key: str) -> Array:
        size = () if np.size(file.arrays.get(key, np.zeros(2))) == 1 else (q.shape[1],)
        return np.broadcast_to(file.numbers(key, *size), q.shape[1:])

    def wanted(key: str) -> Array:
        return file.numbers(key, *q.shape) if key in file else np.zeros_like(q)

    error = file.numbers("q_des", *q.shape) - q
    return gain("kp") * error + gain("kd") * (wanted("dq_des") - dq) + wanted("tau_ff")


def _from_imu(file: _File, t: Array, rotation: Array) -> tuple[Array, Array]:
    """Twist and acceleration, (N, 6) each, by f = v̇ + ω̇ × p + ω × (ω × p) − Rᵀ g at v = 0.

    The equations depend on v̇ + ω × v alone, so that v may be any velocity.
    """
    if any(key in file for key in ("base_twist", "base_acceleration", "base_position")):
        raise RecordingError(
            f"{file.name} has readings of an IMU beside base_position, base_twist or "
            "base_acceleration; keep either"
        )
    omega, felt = (file.numbers(key, len(t), 3) for key in ("imu_gyro", "imu_acceleration"))
    place = file.numbers("imu_position", 3) if "imu_position" in file else np.zeros(3)
    alpha = np.gradient(omega, t, axis=0)
    fall = np.einsum("nji,j->ni", rotation, [0.0, 0.0, -GRAVITY])
    linear = felt + fall - np.cross(alpha, place) - np.cross(omega, np.cross(omega, place))
    return np.hstack([np.zeros_like(omega), omega]), np.hstack([linear, alpha])


UNKNOWN = np.nan  # component of a contact wrench that was not measured

_LIFTED = 2.0
"""Force of lifted contacts over that of loaded ones from which flags count as inverted."""

_KINDS, _AXES = ("surface", "point"), ("link", "world")


def _contacts(file: _File, count: int) -> Contacts:
    """Contacts that arrays of a log hold."""
    name, links = file.name, file.names("contact_links")
    size = len(links)
    given = sorted(key for key in file.arrays if key.startswith("contact_"))
    if given and not size:
        raise RecordingError(f"{name} has {given[0]}, but no contact_links; name the links")
    position = np.zeros((size, 3))
    if "contact_position" in file:
        position = file.numbers("contact_position", size, 3)
    _require_distinct(links, position, name)
    kind, axes = file.word("contact_kind", _KINDS), file.word("contact_axes", _AXES)
    wrench = np.full((count, size, 6), UNKNOWN)
    if kind == "point":
        wrench[:, :, 3:] = 0.0
    if "contact_wrench" in file and "contact_force_z" in file:
        raise RecordingError(
            f"{name} has contact_wrench and contact_force_z; keep one of them, with NaN for "
            "components of contact_wrench that were not measured"
        )
    if "contact_wrench" in file:
        measured = file.numbers("contact_wrench", count, size, 6, finite=False)
        wrench = np.where(np.isnan(measured), wrench, measured)
    if "contact_force_z" in file:
        axes = "world"
        wrench[:, :, 2] = file.numbers("contact_force_z", count, size)
    sensed = np.ones((count, size))
    if "contact_flags" in file:
        flags = file.numbers("contact_flags", count, size)
        _require_lifted_unloaded(wrench[..., :3], flags != 0, name)
        wrench[flags == 0] = 0.0
        sensed[flags == 0] = 0.0

    def of_sensors(word: str, wanted: str, *shape: int, zero: bool = True) -> Any:
        """Property of the sensors of the vertical forces; None where the log does not state it."""
        key = f"contact_force_z_{word}"
        values = file.optional(key, *shape)
        if values is None:
            return None
        if "contact_force_z" not in file or not (values >= 0).all() or not (zero or values.all()):
            raise RecordingError(f"{name}: {key} needs {wanted}; correct or remove it")
        return values if shape else values.item()

    beside = "contact_force_z beside"
    sigma = of_sensors("sigma", f"numbers of at least 0 [N] and {beside} them", size)
    sharing = of_sensors("sharing", f"a number of at least 0 and {beside} it")
    crosstalk = of_sensors("crosstalk", f"two numbers of at least 0 [1/m] and {beside} them", 2)
    cutoff = of_sensors("cutoff", f"a number above 0 [Hz] and {beside} it", zero=False)
    is_stated, sensors = "contact_flags" in file, (sigma, sharing, crosstalk, cutoff)
    return Contacts(links, position, wrench, axes, *sensors, sensed, is_stated)


def _require_distinct(links: tuple[str, ...], position: Array, name: str) -> None:
    """Refuse a contact that is listed twice."""
    for k, (link, point) in enumerate(zip(links, position, strict=True)):
        if any(link == links[j] and (point == position[j]).all() for j in range(k)):
            raise RecordingError(
                f"{name}: contact_links names '{link}' twice at the same point; correct the name, "
                "or give contact_position"
            )


def _require_lifted_unloaded(force: Array, touching: Mask, name: str) -> None:
    """Refuse inverted flags, which state no contact where the sensors read a load."""
    size = np.sqrt(np.nansum(np.square(force), axis=2))
    lifted, loaded = (_rms(size[part]) for part in (~touching, touching))
    if lifted > _LIFTED * max(loaded, 1.0):
        raise RecordingError(
            f"{name}: contact_flags state 0, no contact, where the forces are {lifted:.3g} N, and "
            f"contact where they are {loaded:.3g} N (RMS); expected 0 for a lifted contact"
        )


def _rms(values: Array) -> float:
    """Root of the mean square; 0 without values."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0


_SAME = 1e-3  # largest difference between two statements of the same pose [m, entries of R]

_EULER = ("base_position", "base_rpy")


def _pose(file: _File, count: int) -> tuple[Array, Array]:
    """Rotation and position of the base, (N, 3, 3) [m]."""
    missing = [key for key in _EULER if key not in file]
    if "imu_acceleration" in file and "base_rpy" not in missing and "base_pose" not in file:
        return _rotation(file, count), np.zeros((count, 3))
    if "base_pose" not in file:
        if missing:
            raise RecordingError(
                f"{file.name} has no motion of the base: expected base_pose, or base_position and "
                f"base_rpy; {missing[0]} is missing"
            )
        return _rotation(file, count), file.numbers("base_position", count, 3)
    pose = file.numbers("base_pose", count, *np.shape(file.arrays["base_pose"])[1:])
    try:
        rotation, position = rotation_and_position(pose)
    except ShapeError as error:
        raise RecordingError(f"{file.name}, base_pose: {error}") from None
    differences: dict[str, float] = {}
    if "base_rpy" not in missing:
        differences["base_rpy"] = np.abs(_rotation(file, count) - rotation).max()
    if "base_position" not in missing:
        other = file.numbers("base_position", count, 3)
        differences["base_position"] = np.abs(other - position).max()
    for key, difference in differences.items():
        if difference > _SAME:
            raise RecordingError(
                f"{file.name}: base_pose and {key} differ by up to {difference:.2g}; keep the "
                "right one"
            )
    return rotation, position


def _rotation(file: _File, count: int) -> Array:
    rpy = file.numbers("base_rpy", count, 3)
    pitch = float(np.abs(rpy[:, 1]).max())
    if pitch > np.pi:
        raise RecordingError(
            f"{file.name}: base_rpy reaches a pitch of {pitch:.3g}, expected at most π rad; "
            "convert degrees to rad"
        )
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix())
