"""Recording → file by the default convention of a format, written wholly or not at all.

CSV (%.17g) and Parquet carry t, q, dq, ddq and tau to the last bit; NPZ carries the friction
columns, the names and the history too.
"""

from pathlib import Path

from runtime.common.files import replacing
from runtime.errors import RecordingError
from runtime.recording.formats import FORMATS
from runtime.recording.recording import Recording


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write CSV, NPZ or Parquet, by the suffix of the path.

    Args:
        recording: SI units, joint side.
        path: of the file; missing folders are made.

    Raises:
        RecordingError: another suffix, or Parquet without its library.
    """
    path = Path(path)
    writers = {each.suffixes[0]: each.write for each in FORMATS.records() if each.write}
    if path.suffix not in writers:
        raise RecordingError(
            f"expected a path that ends in {', '.join(writers)}, got {path.name!r}; rename it"
        )
    with replacing(path) as file:
        writers[path.suffix](recording, file)
