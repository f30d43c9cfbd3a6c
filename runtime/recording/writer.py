"""Recording → CSV or NPZ by the default convention; a file is either written wholly or not at all.

CSV carries t, q, dq, ddq and tau to the last bit (%.17g); NPZ carries the friction columns, the
names and the history too.
"""

from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np

from runtime.atomic import replacing
from runtime.errors import RecordingError
from runtime.recording.recording import SIGNALS, Recording


def write_recording(recording: Recording, path: str | Path) -> None:
    """Writes CSV or NPZ, by the suffix of the path.

    Raises:
        RecordingError: another suffix.
    """
    path = Path(path)
    writers: dict[str, Callable[[Recording, IO[bytes]], None]] = {
        ".csv": _write_csv,
        ".npz": _write_npz,
    }
    if path.suffix not in writers:
        raise RecordingError(
            f"expected a path that ends in .csv or .npz, got {path.name!r}; rename it"
        )
    with replacing(path) as file:
        writers[path.suffix](recording, file)


def _write_csv(recording: Recording, file: IO[bytes]) -> None:
    titles, blocks = ["t"], [recording.t[:, None]]
    for key in SIGNALS:
        values = getattr(recording, key)
        if values is not None:
            titles += [f"{key}{joint}" for joint in range(1, recording.n_joints + 1)]
            blocks.append(values)
    header = ",".join(titles)
    np.savetxt(file, np.hstack(blocks), fmt="%.17g", delimiter=",", header=header, comments="")


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
