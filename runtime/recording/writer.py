"""Recording → CSV, NPZ or Parquet by the default convention, written wholly or not at all.

CSV (%.17g) and Parquet carry t, q, dq, ddq and tau to the last bit; NPZ carries the friction
columns, the names and the history too.
"""

from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np

from runtime.errors import RecordingError
from runtime.files import replacing
from runtime.recording.formats.parquet import write_parquet
from runtime.recording.recording import SIGNALS, FloatArray, Recording


def write_recording(recording: Recording, path: str | Path) -> None:
    """Writes CSV, NPZ or Parquet, by the suffix of the path.

    Raises:
        RecordingError: another suffix, or Parquet without its library.
    """
    path = Path(path)
    writers: dict[str, Callable[[Recording, IO[bytes]], None]] = {
        ".csv": _write_csv,
        ".npz": _write_npz,
        ".parquet": lambda recording, file: write_parquet(*_columns(recording), file),
    }
    if path.suffix not in writers:
        raise RecordingError(
            f"expected a path that ends in {', '.join(writers)}, got {path.name!r}; rename it"
        )
    with replacing(path) as file:
        writers[path.suffix](recording, file)


def _write_csv(recording: Recording, file: IO[bytes]) -> None:
    titles, values = _columns(recording)
    np.savetxt(file, values, fmt="%.17g", delimiter=",", header=",".join(titles), comments="")


def _columns(recording: Recording) -> tuple[list[str], FloatArray]:
    titles, blocks = ["t"], [recording.t[:, None]]
    for key in SIGNALS:
        values = getattr(recording, key)
        if values is not None:
            titles += [f"{key}{joint}" for joint in range(1, recording.n_joints + 1)]
            blocks.append(values)
    return titles, np.hstack(blocks)


def _write_npz(recording: Recording, file: IO[bytes]) -> None:
    arrays = {key: getattr(recording, key) for key in ("t", *SIGNALS, "columns", "motors")}
    present: dict[str, Any] = {key: values for key, values in arrays.items() if values is not None}
    texts: dict[str, tuple[str, ...]] = {
        "column_names": recording.column_names,
        "joint_names": recording.joint_names,
        "history": recording.history,
        "name": (recording.name,),
    }
    present |= {key: np.array(text, dtype=str) for key, text in texts.items()}
    np.savez(file, **present)
