"""Arrays of an NPZ, checked: numbers of a shape, words of a choice."""

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.recording import FloatArray


def word_of(arrays: dict[str, NDArray], key: str, name: str, known: tuple[str, ...]) -> str:
    """A word of a choice; the first where the file has none."""
    value = np.asarray(arrays.get(key, known[0]))
    value = value.reshape(()) if value.size == 1 else value
    word = str(_texts(value))
    if word not in known:
        raise RecordingError(
            f"{name}: {key} is '{word}', expected one of {', '.join(known)}; correct it"
        )
    return word


def names_of(arrays: dict[str, NDArray], key: str) -> tuple[str, ...]:
    """Names of an array of texts or of bytes, which HDF5 and older NumPy write."""
    return tuple(map(str, _texts(np.atleast_1d(arrays.get(key, np.array([], dtype=str))))))


def _texts(values: NDArray) -> NDArray:
    """Texts of bytes; others as they are. Bytes of another encoding become a replacement mark."""
    return np.char.decode(values, "utf-8", "replace") if values.dtype.kind == "S" else values


def numbers_of(
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
    if not shape and array.size == 1:
        array = array.reshape(())
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
    bad = ~np.isfinite(values) if finite else np.isinf(values)
    if bad.any():
        row = int(np.flatnonzero(bad.reshape(len(values), -1).any(axis=1))[0]) if values.ndim else 0
        remedy = "remove these rows" if finite else "state what was not measured as NaN"
        raise RecordingError(
            f"{name}: {key} has {'NaN or infinite' if finite else 'infinite'} values, the first in "
            f"row {row}; {remedy}"
        )
    return values
