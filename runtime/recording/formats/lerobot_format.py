"""Log format LeRobot: a folder with meta/info.json and data/*/*.parquet, versions 2.1 and 3.

A feature such as "observation.state" or "action" is a column of lists; info.json names its
numbers. No file of the data set states the unit of a joint, so that a recipe is expected: `key` is
a feature, `columns` are names of its numbers, or indices. Episodes are joined with a pause between
them, which filters and derivatives respect. Source: LeRobot, LeRobotDataset v2.1 and v3.0.
"""

from contextlib import closing
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import json_of
from runtime.errors import RecordingError
from runtime.library import Array
from runtime.recording.formats import FOLDERS
from runtime.recording.formats.log_format import LogFormat, LogReader
from runtime.recording.formats.parquet_format import ParquetLog
from runtime.recording.formats.tables import LogTable, common_count
from runtime.recording.recipes.recipe import Recipe, Signal, Time

PAUSE_S = 1.0  # time between two episodes [s]; at 10 Hz and more it is longer than a step
MOST_FILES = 10_000  # largest number of Parquet files of a data set that is read as one log
_FEATURES = {"time": "timestamp", "position": "observation.state", "desired_position": "action"}


class LerobotReader(LogReader):
    """Reader of a LeRobot data set; info.json is read once."""

    def convention(self) -> Recipe:
        """Refuse a data set without a recipe: its units are not stated anywhere."""
        names = ", ".join(sorted(self._info))
        raise RecordingError(
            f"{self.raw.name} is a LeRobot data set, which states no units; write a recipe: "
            '[time] key = "timestamp", unit = "s"; [position] key = "observation.state", '
            f'unit = "deg" or "rad"; [torque] … (features: {names})'
        )

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Numbers of one feature, of all episodes one after the other."""
        feature = part.key or _FEATURES.get(kind, "")
        if feature not in self._info:
            raise RecordingError(
                f"{self.raw.name} is expected to have the feature {feature!r}, but has "
                f"{', '.join(sorted(self._info)) or 'none'}; correct key in the recipe"
            )
        values = self._column(feature)
        remarks: tuple[str, ...] = ()
        if kind == "time":
            values, remarks = self._joined(values)
        elif part.columns:
            values = values[:, self._picks(feature, part.columns, values.shape[1])]
        return LogTable(values, np.arange(len(values), dtype=np.int64), remarks)

    @cached_property
    def _info(self) -> dict[str, Any]:
        """Feature → its description."""
        try:
            return dict(json_of(self.raw.path / LEROBOT.marker)["features"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RecordingError(
                f"{self.raw.name}: {LEROBOT.marker} is expected to describe the features of a "
                f"LeRobot data set, but is damaged ({type(error).__name__}); download it again"
            ) from error

    def _files(self) -> list[Path]:
        paths = sorted(self.raw.path.glob("data/*/*.parquet"))
        if not 1 <= len(paths) <= MOST_FILES:
            raise RecordingError(
                f"{self.raw.name} is expected to hold 1 to {MOST_FILES} files "
                f"data/chunk-…/….parquet, but holds {len(paths)}; download the data set, or "
                "give a folder with some of its episodes"
            )
        for path in paths:
            key = f"{self.raw.name}/{path.relative_to(self.raw.path).as_posix()}"
            if key not in self.raw.sha256:
                self.raw.sha256.of_file(key, path)
        return paths

    def _column(self, name: str) -> Array:
        parts = []
        for path in self._files():
            with closing(ParquetLog(path)) as log:
                parts.append(log.table((name,)).values)
        if len({part.shape[1] for part in parts}) > 1:
            raise RecordingError(
                f"{self.raw.name}: the feature {name!r} is expected to have one width, but its "
                "files differ; download the data set again"
            )
        return np.concatenate(parts)

    def _joined(self, stamps: Array) -> tuple[Array, tuple[str, ...]]:
        """Times of the episodes, each beginning `PAUSE_S` after the end of the one before."""
        episodes = self._column("episode_index")
        common_count(self.raw.path, (len(stamps), len(episodes)))
        starts = np.flatnonzero(np.diff(episodes[:, 0])) + 1
        shifts = np.zeros_like(stamps)
        shifts[starts] = stamps[starts - 1] + PAUSE_S - stamps[starts]
        count = len(starts) + 1
        remark = f"{self.raw.name}: {count} episodes were joined, with pauses of {PAUSE_S:g} s."
        return stamps + np.cumsum(shifts, axis=0), (remark,) * (count > 1)

    def _picks(self, feature: str, columns: tuple[str | int, ...], width: int) -> list[int]:
        described = self._info[feature]
        names = described.get("names") if isinstance(described, dict) else None
        if isinstance(names, dict):  # {"motors": [...]} of older data sets
            names = next(iter(names.values()), None)
        titles = list(names) if isinstance(names, list) else []
        picks = [titles.index(c) if c in titles else c for c in columns]
        wrong = [c for c in picks if not isinstance(c, int) or not 0 <= c < width]
        if wrong:
            raise RecordingError(
                f"{self.raw.name}: the feature {feature!r} is expected to have the number "
                f"{wrong[0]!r}, but has {', '.join(map(str, titles)) or f'{width} without names'}; "
                "correct columns in the recipe"
            )
        return [c for c in picks if isinstance(c, int)]


LEROBOT = LogFormat(
    name="lerobot",
    sentence="LeRobot data set v2.1 or v3: meta/info.json and data/*/*.parquet, with a recipe",
    suffixes=(),
    reader=LerobotReader,
    marker=FOLDERS["lerobot"],
    is_one_file=True,
)
