"""Log format HDF5: arrays as in an NPZ, at the top of the file or in one group.

A MATLAB 7.3 file is HDF5; a struct is a group, and `key` of a recipe is a path such as "arm/q".
"""

from collections.abc import Mapping

from runtime.recording.formats.hdf5 import HdfLog, HdfRows
from runtime.recording.formats.log_format import LogFormat, LogReader, RawFile, Rows
from runtime.recording.formats.tables import LogTable
from runtime.recording.recipes.default_convention import arrays_convention
from runtime.recording.recipes.recipe import Recipe, Signal, Time
from runtime.recording.recipes.unread_signals import unread_arrays


class HdfReader(LogReader):
    """Reader of an HDF5 file; its arrays are listed once."""

    def __init__(self, raw: RawFile) -> None:
        super().__init__(raw)
        self._listed: HdfLog | None = None

    def convention(self) -> Recipe:
        """Recipe of the arrays t, q …, at the top or in the only group that holds a q."""
        present = self._log().shapes
        groups = [key.removesuffix("q") for key in present if key.endswith("/q")]
        prefix = groups[0] if "q" not in present and len(groups) == 1 else ""
        plan = arrays_convention(present, "hdf5", prefix)
        self.said = unread_arrays(self.arrays(), plan, self.raw.name)
        return plan

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Array with the key of a part."""
        del kind
        return self._log().table(part.key)

    def rows(self, parts: Mapping[str, Signal | Time]) -> Rows:
        """Rows of the arrays, read where they lie."""
        return HdfRows(self._log(), {kind: part.key for kind, part in parts.items()})

    def arrays(self) -> dict[str, tuple[int, ...]]:
        """Name → shape of the arrays of real numbers."""
        return dict(self._log().shapes)

    def _log(self) -> HdfLog:
        if self._listed is None:
            self._listed = HdfLog(self.raw.hashed())
        return self._listed


HDF5 = LogFormat(
    name="hdf5",
    sentence="arrays of numbers in HDF5 or a MATLAB 7.3 file, one row per instant",
    suffixes=(".h5", ".hdf5", ".mat"),
    reader=HdfReader,
    has_titles=True,
    reads_time_alone=True,
)
