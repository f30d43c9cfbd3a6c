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
    contact_force_z_crosstalk (2,) standard deviations of what these sensors read per moment about
    x and y of the link; contact_force_z_cutoff () cut-off of their first-order low-pass
    contact_flags (N, C) whether a contact can transmit a wrench; 0 states that there is none
    contact_kind "surface" or "point", whose moment is zero
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.common.files import bytes_of
from runtime.errors import RecordingError
from runtime.recording.formats.npz import open_npz
from runtime.recording.free_base.arrays import names_of, numbers_of
from runtime.recording.free_base.contacts import contacts_of
from runtime.recording.free_base.pose import pose_of
from runtime.recording.free_base.recording import FreeBaseRecording
from runtime.recording.recording import FloatArray

_KEYS = (
    *("t", "q", "dq", "ddq", "tau", "joints", "base_pose", "base_position", "base_rpy"),
    *("base_twist", "base_acceleration", "contact_links", "contact_position", "contact_wrench"),
    *("contact_axes", "contact_force_z", "contact_force_z_sigma", "contact_force_z_sharing"),
    *("contact_force_z_crosstalk", "contact_force_z_cutoff", "contact_flags", "contact_kind"),
)
_FEWEST = 8
"""Fewest instants of a recording."""


_ZIP = b"PK"
"""First bytes of an NPZ."""


def read_free_base(path: Path) -> FreeBaseRecording:
    """Read an NPZ of this layout.

    Raises:
        RecordingError: unreadable, an array is missing, has another shape or unknown name.
    """
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
    t = numbers_of(arrays, "t", name, ("N",))
    count = len(t)
    steps = np.diff(t)
    if count < _FEWEST or not (steps > 0).all():
        raise RecordingError(
            f"{name} needs {_FEWEST} or more instants t that increase, got {count}; sort the rows"
        )
    q = numbers_of(arrays, "q", name, (count, "n"))
    shape = q.shape

    def optional(key: str, *sizes: int) -> FloatArray | None:
        return numbers_of(arrays, key, name, sizes) if key in arrays else None

    rotation, position = pose_of(arrays, name, count)
    names = names_of(arrays, "joints")
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
        contacts=contacts_of(arrays, name, count),
        dq=optional("dq", *shape),
        ddq=optional("ddq", *shape),
        tau=optional("tau", *shape),
        twist=optional("base_twist", count, 6),
        acceleration=optional("base_acceleration", count, 6),
        unread=tuple(sorted(set(arrays) - set(_KEYS))),
    )
