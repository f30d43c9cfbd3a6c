"""Recordings of a robot with a free base: joints, motion of the base, contacts.

An NPZ with one row per instant, SI units:

    t (N,), q (N, n); dq, ddq, tau (N, n) where they were measured; joints (n,) names
    base_pose (N, 7) position and quaternion x, y, z, w, or (N, 4, 4); or
    base_position (N, 3) and base_rpy (N, 3) roll, pitch, yaw
    base_twist, base_acceleration (N, 6) in axes of the base, see `runtime.BaseMotion`
    contact_links (C,) names of moving links; contact_position (C, 3) in their frames
    contact_wrench (N, C, 6) force and moment on the robot at contact_position, NaN where a
    component is not measured; contact_axes "link" or "world"
    contact_force_z (N, C) vertical forces instead, all else unknown
    contact_force_z_sigma (C,) standard deviation of the unknown offsets of these sensors
    contact_force_z_sharing () standard deviation of the relative error of these sensors while
    contacts share the load, see `Contacts`
    contact_flags (N, C) whether a contact can transmit a wrench; 0 states that there is none
    contact_kind "surface" or "point", whose moment is zero
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.files import bytes_of
from runtime.recording.formats.npz import open_npz
from runtime.recording.recording import FloatArray
from runtime.startup.data_classes import dataclass

UNKNOWN = np.nan
"""Component of a contact wrench that was not measured."""
_KINDS, _AXES = ("surface", "point"), ("link", "world")
_KEYS = (
    *("t", "q", "dq", "ddq", "tau", "joints", "base_pose", "base_position", "base_rpy"),
    *("base_twist", "base_acceleration", "contact_links", "contact_position", "contact_wrench"),
    *("contact_axes", "contact_force_z", "contact_force_z_sigma", "contact_force_z_sharing"),
    *("contact_flags", "contact_kind"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """Contacts of a robot with the world.

    Attributes:
        links: names of the C links.
        position: (C, 3) point that the wrench is about, in the frame of the link [m].
        wrench: (N, C, 6) force and moment on the robot [N, N·m]; NaN where it is unknown.
        axes: "link" or "world".
        offset_sigma: (C,) standard deviation of unknown offsets of the vertical forces [N]; None
            where the log does not state it.
        sharing_sigma: standard deviation of γ: a sensor that reads the share s of ΣF_z reads
            F (1 + γ (1 − s)); None where the log does not state it.
        sensed: (N, C) 1 where the force is that of a sensor, 0 where a flag states that there is
            none; filtered like the forces.
    """

    links: tuple[str, ...]
    position: FloatArray
    wrench: FloatArray
    axes: str
    offset_sigma: FloatArray | None = None
    sharing_sigma: float | None = None
    sensed: FloatArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FreeBaseRecording:
    """Motion of joints and base at N instants, with torques and contacts.

    Attributes:
        name: of the file.
        t: (N,) s.
        q: (N, n) rad or m, in the order of the file.
        joint_names: n names, empty where the file has none.
        rotation: (N, 3, 3) R of the base in the world.
        position: (N, 3) origin of the base in the world [m].
        contacts: of the robot with the world.
        dq, ddq, tau: (N, n), None where they were not measured.
        twist, acceleration: (N, 6) of the base, None where they were not measured.
    """

    name: str
    t: FloatArray
    q: FloatArray
    joint_names: tuple[str, ...]
    rotation: FloatArray
    position: FloatArray
    contacts: Contacts
    dq: FloatArray | None = None
    ddq: FloatArray | None = None
    tau: FloatArray | None = None
    twist: FloatArray | None = None
    acceleration: FloatArray | None = None


def read_free_base(path: Path) -> FreeBaseRecording:
    """Read an NPZ of this layout.

    Raises:
        RecordingError: unreadable, an array is missing, has another shape or unknown name.
    """
    try:
        arrays = open_npz(bytes_of(path), path.name)
    except (OSError, ValueError) as error:
        raise RecordingError(f"cannot read '{path}': {error}") from None
    return free_base_of(arrays, path.name)


def free_base_of(arrays: dict[str, NDArray], name: str) -> FreeBaseRecording:
    """The recording that arrays of this layout hold.

    Args:
        arrays: by key.
        name: of the file, for messages.

    Returns:
        The recording.

    Raises:
        RecordingError: an array is missing, has another shape or unknown name.
    """
    unknown = sorted(key for key in arrays if key.startswith(("base_", "contact_")))
    unknown = [key for key in unknown if key not in _KEYS]
    if unknown:
        raise RecordingError(
            f"{name} has the array {unknown[0]}, expected those of a robot with a free base: "
            f"{', '.join(_KEYS[6:])}; rename it"
        )
    t = _numbers(arrays, "t", name, ("N",))
    count = len(t)
    steps = np.diff(t)
    if count < _FEWEST or not (steps > 0).all():
        raise RecordingError(
            f"{name} needs {_FEWEST} or more instants t that increase, got {count}; sort the rows"
        )
    q = _numbers(arrays, "q", name, (count, "n"))
    shape = q.shape

    def optional(key: str, *sizes: int) -> FloatArray | None:
        return _numbers(arrays, key, name, sizes) if key in arrays else None

    rotation, position = _pose(arrays, name, count)
    names = tuple(map(str, arrays.get("joints", np.array([], dtype=str))))
    if names and len(names) != shape[1]:
        raise RecordingError(
            f"{name} names {len(names)} joints, but q has {shape[1]} columns; name every column"
        )
    return FreeBaseRecording(
        name=name,
        t=t,
        q=q,
        joint_names=names,
        rotation=rotation,
        position=position,
        contacts=_contacts(arrays, name, count),
        dq=optional("dq", *shape),
        ddq=optional("ddq", *shape),
        tau=optional("tau", *shape),
        twist=optional("base_twist", count, 6),
        acceleration=optional("base_acceleration", count, 6),
    )


_FEWEST = 8
"""Fewest instants of a recording."""


def _pose(arrays: dict[str, NDArray], name: str, count: int) -> tuple[FloatArray, FloatArray]:
    from scipy.spatial.transform import Rotation

    if "base_pose" in arrays:
        pose = _numbers(arrays, "base_pose", name, (count, *np.shape(arrays["base_pose"])[1:]))
        if pose.shape[1:] == (4, 4):
            turned, position = Rotation.from_matrix(pose[:, :3, :3]), pose[:, :3, 3]
            error = np.abs(turned.as_matrix() - pose[:, :3, :3]).max()
        elif pose.shape[1:] == (7,):
            error = np.abs(np.linalg.norm(pose[:, 3:], axis=1) - 1).max()
            if error > _ROTATION:
                raise RecordingError(
                    f"{name}: the quaternions of base_pose differ from length 1 by up to "
                    f"{error:.2g}; expected x y z and the quaternion x y z w"
                )
            turned, position = Rotation.from_quat(pose[:, 3:]), pose[:, :3]
        else:
            raise RecordingError(
                f"{name}: base_pose needs the shape ({count}, 7) or ({count}, 4, 4), got "
                f"{pose.shape}"
            )
        if error > _ROTATION:
            raise RecordingError(
                f"{name}: base_pose is no rotation and translation (off by {error:.2g}); give R "
                "from the axes of the base to those of the world"
            )
        return turned.as_matrix(), position
    missing = [key for key in ("base_position", "base_rpy") if key not in arrays]
    if missing:
        raise RecordingError(
            f"{name} has no motion of the base: expected base_pose, or base_position and base_rpy; "
            f"{missing[0]} is missing"
        )
    rpy = _numbers(arrays, "base_rpy", name, (count, 3))
    rotation = Rotation.from_euler("xyz", rpy).as_matrix()
    return rotation, _numbers(arrays, "base_position", name, (count, 3))


def _contacts(arrays: dict[str, NDArray], name: str, count: int) -> Contacts:
    links = tuple(map(str, np.atleast_1d(arrays.get("contact_links", np.array([], dtype=str)))))
    size = len(links)
    given = sorted(key for key in arrays if key.startswith("contact_"))
    if given and not size:
        raise RecordingError(f"{name} has {given[0]}, but no contact_links; name the links")
    position = np.zeros((size, 3))
    if "contact_position" in arrays:
        position = _numbers(arrays, "contact_position", name, (size, 3))
    kind = _word(arrays, "contact_kind", name, _KINDS)
    axes = _word(arrays, "contact_axes", name, _AXES)
    wrench = np.full((count, size, 6), UNKNOWN)
    if kind == "point":
        wrench[:, :, 3:] = 0.0
    if "contact_wrench" in arrays and "contact_force_z" in arrays:
        raise RecordingError(
            f"{name} has contact_wrench and contact_force_z; keep one of them, with NaN for "
            "components of contact_wrench that were not measured"
        )
    if "contact_wrench" in arrays:
        measured = _numbers(arrays, "contact_wrench", name, (count, size, 6), finite=False)
        wrench = np.where(np.isnan(measured), wrench, measured)
    if "contact_force_z" in arrays:
        axes = "world"
        wrench[:, :, 2] = _numbers(arrays, "contact_force_z", name, (count, size))
    sensed = np.ones((count, size))
    if "contact_flags" in arrays:
        flags = _numbers(arrays, "contact_flags", name, (count, size))
        wrench[flags == 0] = 0.0
        sensed[flags == 0] = 0.0
    sigma = _sigma(
        arrays,
        "contact_force_z_sigma",
        name,
        (size,),
        "numbers of at least 0 [N] and contact_force_z beside them",
    )
    sharing = _sigma(
        arrays,
        "contact_force_z_sharing",
        name,
        (),
        "a number of at least 0 and contact_force_z beside it",
    )
    return Contacts(
        links, position, wrench, axes, sigma, None if sharing is None else sharing.item(), sensed
    )


def _sigma(
    arrays: dict[str, NDArray], key: str, name: str, shape: tuple[int, ...], wanted: str
) -> FloatArray | None:
    """Standard deviations of errors of the vertical forces; None where the log states none."""
    if key not in arrays:
        return None
    sigma = _numbers(arrays, key, name, shape)
    if "contact_force_z" not in arrays or not (sigma >= 0).all():
        raise RecordingError(f"{name}: {key} needs {wanted}; correct or remove it")
    return sigma


def _word(arrays: dict[str, NDArray], key: str, name: str, known: tuple[str, ...]) -> str:
    word = str(arrays.get(key, known[0]))
    if word not in known:
        raise RecordingError(f"{name}: {key} is '{word}', expected one of {', '.join(known)}")
    return word


def _numbers(
    arrays: dict[str, NDArray],
    key: str,
    name: str,
    shape: tuple[int | str, ...],
    finite: bool = True,
) -> FloatArray:
    """Numbers of a shape, in which a text is any size."""
    if key not in arrays:
        raise RecordingError(f"{name} has no array {key}; save it with numpy.savez({key}=…)")
    array = arrays[key]
    fits = array.ndim == len(shape) and all(
        isinstance(wanted, str) or wanted == size
        for wanted, size in zip(shape, array.shape, strict=True)
    )
    if array.dtype.kind not in "fiub" or not fits:
        raise RecordingError(
            f"{name}: {key} needs real numbers of shape ({', '.join(map(str, shape))}), got "
            f"{array.dtype} of shape {array.shape}"
        )
    values = np.ascontiguousarray(array, dtype=float)
    if finite and not np.isfinite(values).all():
        raise RecordingError(f"{name}: {key} has NaN or infinite values; remove these rows")
    return values


_ROTATION = 1e-5
"""Largest error of R Rᵀ or of a quaternion's length: logs are often stored in single precision."""
