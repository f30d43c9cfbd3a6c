"""A log that stays in its file; any rows of it become a `Recording` without the others."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from threading import Lock

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array
from runtime.recording.current_gains import CurrentGains
from runtime.recording.formats import format_of_folder, format_of_suffix
from runtime.recording.formats.log_format import Digests, LogRows
from runtime.recording.formats.tables import LogTable, Tables
from runtime.recording.log_files import LogFiles, parts_of
from runtime.recording.reader import GivenRecipe, place_and_recipe, read_recording
from runtime.recording.recipes.recipe import UNITS, Recipe, Signal, Time
from runtime.recording.recording import Recording
from runtime.recording.unit_conversion import converted, scaled

LARGE = 200_000_000  # size of a file above which a log is streamed by default [bytes]


@dataclass(frozen=True, slots=True, eq=False)
class StreamedRecording:
    """Rows of raw files, and their conversion to recordings."""

    name: str  # of the recording in reports
    rows: int  # of the log, corrupt ones too
    plan: Recipe  # how they are read
    recipe: Recipe | None  # as chosen; its defaults for preparation, split and friction
    source: Digests  # file name → sha256
    joint_names: tuple[str, ...]  # n names, or none
    origin: float | None  # the first instant in its own unit, where time is counted from there
    start: float | None  # the first instant of the log [s]; None where it is not known
    files: tuple[LogRows, ...]  # the sources of the signals
    clock: LogRows | None  # the source of the time alone
    remarks: tuple[str, ...] = ()  # sentences about the form of the files
    gains: CurrentGains | None = None  # estimated, of motor currents; None: it states them
    bias: Array | None = None  # added to q for the encoders, (n,) [rad, m]; None for 0
    one_at_a_time: Lock = field(default_factory=Lock)  # held while rows are read

    def block(self, start: int, stop: int) -> Recording:
        """Rows start … stop − 1 as a recording; corrupt rows among them are dropped and noted."""
        return self.recording_of(self.numbers(start, stop))

    def numbers(self, start: int, stop: int) -> Tables:
        """Rows start … stop − 1 as they lie in the files, read by one thread at a time."""
        lines = np.arange(start, min(stop, self.rows), dtype=np.int64)
        with self.one_at_a_time:  # a file has one place, which another thread would move
            read = [each.read(start, start + len(lines)).items() for each in self.files]
        parts = sorted(chain.from_iterable(read), key=lambda part: part[0] != "time")
        return {kind: LogTable(values, lines) for kind, values in parts}

    def recording_of(self, tables: Tables) -> Recording:
        """Usable rows in SI units and on the joint side; any thread may convert its rows."""
        recording = converted(
            self.plan,
            tables,
            first_row=int(next(iter(tables.values())).lines[0]),
            origin=self.origin,
            start=self.start,
            name=self.name,
            joint_names=self.joint_names,
            source=self.source,
            recipe=self.recipe,
            history=self.remarks,
        )
        if self.bias is not None:
            recording = recording.replace(q=recording.q + self.bias)
        return recording if self.gains is None else scaled(recording, self.gains)

    def instants(self, rows: Sequence[int], reach: int) -> Array:
        """Times [s] of ascending rows; for a corrupt one that of the next one within `reach`."""
        time = self.plan.time
        if time is None or self.clock is None:
            rate = 1.0 if time is None or time.rate_hz is None else time.rate_hz
            return np.asarray(rows) / rate
        times = []
        for row in rows:
            stamps = self.clock.read(row, min(row + reach, self.rows))["time"][:, 0]
            usable = stamps[np.isfinite(stamps) & (np.abs(stamps) < 1e20)]
            if not usable.size:
                raise RecordingError(
                    f"{self.name} has no usable time from row {row} on; export the log again"
                )
            times.append(usable[0])
        return (np.array(times) - (self.origin or 0.0)) * UNITS["time"][time.unit]


def is_large(path: str | Path) -> bool:
    """Whether a file or a bag is streamed by default."""
    path = Path(path)
    if path.is_dir():
        sizes = (p.stat().st_size for p in path.iterdir())
        return format_of_folder(path) is not None and sum(sizes) > LARGE
    known = path.is_file() and format_of_suffix(path.name) is not None
    return known and path.stat().st_size > LARGE


def open_streamed(
    path: str | Path, recipe: GivenRecipe = None, run: str | None = None, joints: Sequence[str] = ()
) -> StreamedRecording:
    """Open a log that stays in its file, as `read_recording`: NPZ, Parquet, CSV, or a bag."""
    place, chosen = place_and_recipe(path, recipe, run)
    files = LogFiles(place, chosen or Recipe(), tuple(joints), in_place=True)
    plan = files.plan()
    by_file: dict[str, dict[str, Signal | Time]] = {}
    for kind, part in parts_of(plan).items():
        by_file.setdefault(files.file_of(part.file), {})[kind] = part
    layouts = {name: next(iter(parts.values())).layout for name, parts in by_file.items()}
    sources = tuple(
        files.reader(name, layouts[name]).rows(parts) for name, parts in by_file.items()
    )
    counts = [rows.count for rows in sources]
    if min(counts) != max(counts) or not counts[0]:
        raise RecordingError(
            f"expected as many rows of every signal, but there are {', '.join(map(str, counts))}; "
            "check the files, and that samples are rows"
        )
    clock, origin, start = None, None, 0.0
    if plan.time is not None and plan.time.rate_hz is None:
        name = files.file_of(plan.time.file)
        clock = sources[list(by_file).index(name)]
        if files.format_of(name, layouts[name]).reads_time_alone:
            clock = files.reader(name, layouts[name]).rows({"time": plan.time})
        first = float(clock.read(0, 1)["time"][0, 0])
        if plan.time.from_zero:
            origin = first
        else:
            start = first * UNITS["time"][plan.time.unit]
    return StreamedRecording(
        name=plan.name or place.stem,
        rows=counts[0],
        plan=plan,
        recipe=chosen,
        source=files.sha256,
        joint_names=plan.joints or files.extras().texts.get("joint_names", ()),
        origin=origin,
        start=start if np.isfinite(start) else None,
        files=sources,
        clock=clock,
        remarks=files.remarks(),
    )


def open_log(
    path: str | Path,
    recipe: GivenRecipe = None,
    run: str | None = None,
    joints: Sequence[str] = (),
    stream: bool | None = None,
) -> Recording | StreamedRecording:
    """Read a log as `read_recording` does, or leave it in its file; None decides by its size."""
    if stream:
        return open_streamed(path, recipe, run, joints)
    if stream is None and is_large(path):
        with suppress(RecordingError):  # compressed or damaged: `read_recording` says which
            return open_streamed(path, recipe, run, joints)
    return read_recording(path, recipe, run, joints)
