"""Contacts of a recording: links, points, wrenches, flags, errors of the sensors."""

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.free_base.arrays import names_of, numbers_of, word_of
from runtime.recording.free_base.recording import Contacts
from runtime.recording.recording import FloatArray

UNKNOWN = np.nan
"""Component of a contact wrench that was not measured."""
_LIFTED = 2.0
"""Force of lifted contacts over that of loaded ones from which flags count as inverted."""
_KINDS, _AXES = ("surface", "point"), ("link", "world")


def contacts_of(arrays: dict[str, NDArray], name: str, count: int) -> Contacts:
    """Contacts that arrays of a log hold."""
    links = names_of(arrays, "contact_links")
    size = len(links)
    given = sorted(key for key in arrays if key.startswith("contact_"))
    if given and not size:
        raise RecordingError(f"{name} has {given[0]}, but no contact_links; name the links")
    position = np.zeros((size, 3))
    if "contact_position" in arrays:
        position = numbers_of(arrays, "contact_position", name, (size, 3))
    _require_distinct(links, position, name)
    kind = word_of(arrays, "contact_kind", name, _KINDS)
    axes = word_of(arrays, "contact_axes", name, _AXES)
    wrench = np.full((count, size, 6), UNKNOWN)
    if kind == "point":
        wrench[:, :, 3:] = 0.0
    if "contact_wrench" in arrays and "contact_force_z" in arrays:
        raise RecordingError(
            f"{name} has contact_wrench and contact_force_z; keep one of them, with NaN for "
            "components of contact_wrench that were not measured"
        )
    if "contact_wrench" in arrays:
        measured = numbers_of(arrays, "contact_wrench", name, (count, size, 6), finite=False)
        wrench = np.where(np.isnan(measured), wrench, measured)
    if "contact_force_z" in arrays:
        axes = "world"
        wrench[:, :, 2] = numbers_of(arrays, "contact_force_z", name, (count, size))
    sensed = np.ones((count, size))
    if "contact_flags" in arrays:
        flags = numbers_of(arrays, "contact_flags", name, (count, size))
        _require_lifted_unloaded(wrench[..., :3], flags != 0, name)
        wrench[flags == 0] = 0.0
        sensed[flags == 0] = 0.0
    sigma = _of_sensors(
        arrays,
        "contact_force_z_sigma",
        name,
        (size,),
        "numbers of at least 0 [N] and contact_force_z beside them",
    )
    sharing = _of_sensors(
        arrays,
        "contact_force_z_sharing",
        name,
        (),
        "a number of at least 0 and contact_force_z beside it",
    )
    crosstalk = _of_sensors(
        arrays,
        "contact_force_z_crosstalk",
        name,
        (2,),
        "two numbers of at least 0 [1/m] and contact_force_z beside them",
    )
    cutoff = _of_sensors(
        arrays,
        "contact_force_z_cutoff",
        name,
        (),
        "a number above 0 [Hz] and contact_force_z beside it",
        zero=False,
    )
    return Contacts(
        links,
        position,
        wrench,
        axes,
        sigma,
        None if sharing is None else sharing.item(),
        crosstalk,
        None if cutoff is None else cutoff.item(),
        sensed,
    )


def _require_distinct(links: tuple[str, ...], position: FloatArray, name: str) -> None:
    """Refuse a contact that is listed twice."""
    for k, (link, point) in enumerate(zip(links, position, strict=True)):
        if any(link == links[j] and (point == position[j]).all() for j in range(k)):
            raise RecordingError(
                f"{name}: contact_links names '{link}' twice at the same point; correct the name, "
                "or give contact_position"
            )


def _of_sensors(
    arrays: dict[str, NDArray],
    key: str,
    name: str,
    shape: tuple[int, ...],
    wanted: str,
    zero: bool = True,
) -> FloatArray | None:
    """Property of the sensors of the vertical forces; None where the log does not state it."""
    if key not in arrays:
        return None
    values = numbers_of(arrays, key, name, shape)
    if "contact_force_z" not in arrays or not (values >= 0).all() or not (zero or values.all()):
        raise RecordingError(f"{name}: {key} needs {wanted}; correct or remove it")
    return values


def _require_lifted_unloaded(force: FloatArray, touching: NDArray[np.bool_], name: str) -> None:
    """Refuse inverted flags, which state no contact where the sensors read a load."""
    size = np.sqrt(np.nansum(np.square(force), axis=2))
    lifted, loaded = (_rms(size[part]) for part in (~touching, touching))
    if lifted > _LIFTED * max(loaded, 1.0):
        raise RecordingError(
            f"{name}: contact_flags state 0, no contact, where the forces are {lifted:.3g} N, and "
            f"contact where they are {loaded:.3g} N (RMS); expected 0 for a lifted contact"
        )


def _rms(values: FloatArray) -> float:
    """Root of the mean square; 0 without values."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0
