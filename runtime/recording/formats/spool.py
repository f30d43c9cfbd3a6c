"""Numbers in a temporary file: large logs are parsed once, piece by piece."""

import tempfile
import weakref

import numpy as np

from runtime.errors import RecordingError
from runtime.recording.formats.tables import FloatArray


class Spool:
    """Sequence of numbers in a temporary file, which stays in memory while it is small.

    Args:
        name: of the log, for messages.
    """

    SMALL = 2**24
    """Largest size that stays in memory [bytes]."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._file = tempfile.SpooledTemporaryFile(self.SMALL, prefix="symgen-")  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self.size = 0

    def append(self, values: FloatArray) -> int:
        """Append numbers and return the place of the first of them."""
        start = self.size
        try:
            self._file.seek(8 * start)
            self._file.write(np.ascontiguousarray(values).data)
        except OSError as error:
            raise RecordingError(
                f"the numbers of {self._name} do not fit into {tempfile.gettempdir()} "
                f"({error.strerror}); set TMPDIR to a larger place, or convert the log to Parquet"
            ) from error
        self.size += values.size
        return start

    def read(self, start: int, count: int) -> FloatArray:
        """Numbers from a place on."""
        self._file.seek(8 * start)
        return np.frombuffer(self._file.read(8 * count), dtype=np.float64)
