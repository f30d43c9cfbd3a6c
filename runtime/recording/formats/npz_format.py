"""Log format NPZ: arrays t (N,), q (N, n) [, dq] [, ddq] [, tau] in SI units by default.

Without tau, the arrays q_des and dq_des (N, n), kp and kd (n,) give the torque of a PD law. What
`write_recording` has written carries the friction columns, the names and the history too.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.formats import log_format
from runtime.recording.formats.npz import NpzRows, npz_table, open_npz, texts_in_place
from runtime.recording.formats.tables import LogTable, picked
from runtime.recording.recipes.default_convention import arrays_convention, unread_arrays
from runtime.recording.recipes.recipe import Recipe, Signal, Time
from runtime.recording.recording import SIGNALS, Recording

_TEXTS: tuple[str, ...] = ("name", "joint_names", "column_names", "history")


class NpzReader(log_format.LogReader):
    """Reader of an NPZ."""

    @cached_property
    def _content(self) -> dict[str, NDArray]:
        return open_npz(self.raw.data(), self.raw.name)

    def convention(self) -> Recipe:
        """Recipe of the arrays that are there; q is always expected."""
        if self.raw.in_place:
            rows = NpzRows(self.raw.hashed())
            plan, shapes = arrays_convention(rows.keys, "npz"), rows.shapes
        else:
            plan, shapes = arrays_convention(self._content, "npz"), self.arrays()
        self.said = unread_arrays(shapes, plan, self.raw.name)
        return plan

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Array with the key of a part."""
        table = npz_table(self._content, part.key, self.raw.name)
        columns = () if kind == "time" else part.columns
        return picked(table, columns, f"the array {part.key!r} of {self.raw.name}")

    def rows(self, parts: Mapping[str, Signal | Time]) -> log_format.LogRows:
        """Rows of uncompressed arrays, read where they lie."""
        log_format.require_whole_columns(parts, self.raw.name)
        path = self.raw.hashed()
        if "columns" in NpzRows(path).keys:
            raise RecordingError(
                f"{self.raw.name} holds friction columns of a prepared recording, which is not "
                "streamed; read it as a whole with --settings stream=false"
            )
        return NpzRows(path, {kind: part.key for kind, part in parts.items()})

    def extras(self) -> log_format.Extras:
        """Names, history, friction columns and motors of an NPZ by `write_recording`."""
        recipe, wanted = self.raw.recipe, _TEXTS
        if recipe.position is not None:
            parts = recipe.signals().values()
            is_picked = recipe.joints or any(part.order or part.columns for part in parts)
            wanted = () if is_picked or recipe.position.file else ("joint_names",)
        if self.raw.in_place:
            return log_format.Extras(
                texts_in_place(self.raw.hashed(), ("joint_names",) if wanted else ())
            )
        arrays = self._content
        texts = {
            key: tuple(map(str, arrays[key].ravel()))
            for key in wanted
            if key in arrays and arrays[key].dtype.kind == "U" and arrays[key].size
        }
        if recipe.position is not None:
            return log_format.Extras(texts)
        columns, motors = arrays.get("columns"), arrays.get("motors")
        table = None
        if columns is not None and columns.ndim == 3:
            values = columns.reshape(len(columns), -1).astype(np.float64)
            table = LogTable(values, np.arange(len(values), dtype=np.int64))
        if motors is not None and motors.dtype.kind != "f":
            motors = None
        return log_format.Extras(texts, table, motors)

    def arrays(self) -> dict[str, tuple[int, ...]]:
        """Name → shape of the arrays of real numbers."""
        return {key: each.shape for key, each in self._content.items() if each.dtype.kind in "fiu"}


def _write(recording: Recording, file: IO[bytes]) -> None:
    arrays = {key: getattr(recording, key) for key in ("t", *SIGNALS, "columns", "motors")}
    present: dict[str, Any] = {key: values for key, values in arrays.items() if values is not None}
    present |= recording.signals
    texts: dict[str, tuple[str, ...]] = {
        "column_names": recording.column_names,
        "joint_names": recording.joint_names,
        "history": recording.history,
        "name": (recording.name,),
    }
    present |= {key: np.array(text, dtype=str) for key, text in texts.items()}
    np.savez(file, **present)


NPZ = log_format.LogFormat(
    name="npz",
    sentence="arrays of numbers by numpy.savez, one row per instant",
    suffixes=(".npz",),
    reader=NpzReader,
    write=_write,
    has_titles=True,
    reads_time_alone=True,
)
