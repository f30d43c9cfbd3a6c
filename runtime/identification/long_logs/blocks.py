"""Blocks of a streamed log, each prepared with enough overlap that its edges have no effect.

The response of a Butterworth filter of order p decays like exp(−t/T), T = 1 / (2π f_c sin(π/2p));
thirty T on both sides leave 1e-13 of the signal beyond the block. Blocks begin at instants that
decimation keeps, so that the prepared rows are those of all rows at once. Each block is prepared
once; its rows are then stored in a temporary file.
"""

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from runtime.common.threads import cores
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, StreamedRecording
from runtime.recording.formats.tables import Spool
from runtime.recording.preprocessing import prepare
from runtime.recording.recording import ARRAYS, FloatArray
from runtime.recording.streamed import RawRows

BLOCK = 65536
"""Rows of a block: a minute at 1 kHz, about ten megabytes."""
FADING = 30.0
"""Time constants of the filter in the overlap."""
AHEAD = 3
"""Largest number of blocks that are prepared while another one is used."""
REACH = 4096
"""Rows of which at least one has a usable time stamp."""


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """A streamed log in blocks, with its preparation."""

    log: StreamedRecording  # rows in their file
    lib: Library  # library of the robot
    preparation: Preparation  # steps for each block; rows of rest are dropped
    terms: Friction  # friction columns
    overlap: int  # rows on either side that are prepared and discarded
    edges: tuple[int, ...]  # first row of each block, then one past the last row
    # t [s] of these rows; at the ends those of the first and the last prepared row that is kept, or
    # −∞ and ∞
    instants: FloatArray
    half_step: float  # half of the time step [s]; edges lie between two rows
    spool: Spool  # temporary file of prepared rows
    # index of a block → place of its prepared rows; None where the arm rests
    kept: dict[int, "_Kept | None"] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.edges) - 1

    def prepared(self, index: int) -> Recording | None:
        """Prepared rows of one block; None where the arm rests in all of it."""
        if index not in self.kept:
            return self._stored(index, self._prepare(index, self._read(index)))
        kept = self.kept[index]
        return None if kept is None else kept.read(self.spool)

    def _stored(self, index: int, rows: Recording | None) -> Recording | None:
        self.kept[index] = None if rows is None else _stored(rows, self.spool)
        return rows

    def in_order(self, indices: range) -> Iterator[Recording | None]:
        """Prepared blocks; the next ones are read and prepared meanwhile, one per core."""
        # This thread alone reads and stores: files and spool have one place, and rows that are
        # read in order are decoded once.
        new = [index for index in indices if index not in self.kept]
        if min(cores(), len(new)) < 2:
            yield from map(self.prepared, indices)
            return
        _keep_freed_memory()
        rest = iter(new)
        with ThreadPoolExecutor(min(cores(), AHEAD)) as pool:

            def submit(index: int) -> Future[Recording | None]:
                return pool.submit(self._prepare, index, self._read(index))

            started = {i: submit(i) for i in islice(rest, AHEAD)}
            for index in indices:
                if index not in started:
                    yield self.prepared(index)
                    continue
                if (later := next(rest, None)) is not None:
                    started[later] = submit(later)
                yield self._stored(index, started.pop(index).result())

    def _read(self, index: int) -> RawRows:
        start, stop = self.edges[index], self.edges[index + 1]
        first = max(start - self.overlap, self.edges[0])
        return self.log.numbers(first, min(stop + self.overlap, self.edges[-1]))

    def _prepare(self, index: int, raw: RawRows) -> Recording | None:
        window = self.log.recording_of(raw)
        whole = prepare(
            window, replace(self.preparation, rest_speed=None), self.terms, lib=self.lib
        )
        low, high = self.instants[index : index + 2] - self.half_step
        kept = (whole.t >= low) & (whole.t < high)
        rest = self.preparation.rest_speed
        if rest is not None and whole.dq is not None:
            kept &= np.any(np.abs(whole.dq) >= rest, axis=1)
        rows = np.flatnonzero(kept)
        return whole.take(rows, f"Took {len(rows)} rows of a block.") if rows.size else None

    def within(self, first: float, last: float) -> range:
        """Blocks that contain instants first ≤ t < last."""
        begin = int(np.searchsorted(self.instants, first, side="right")) - 1
        end = int(np.searchsorted(self.instants - self.half_step, last, side="left"))
        return range(max(begin, 0), min(max(end, 1), len(self)))

    def parts(self, first: float, last: float) -> Iterator[Recording]:
        """Prepared rows with first ≤ t < last, one block at a time."""
        for block in self.in_order(self.within(first, last)):
            if block is None:
                continue
            inside = (block.t >= first) & (block.t < last)
            if inside.all():
                yield block
            elif inside.any():
                yield block.take(inside, "Cut to the part.")

    def count(self, first: float) -> int:
        """Number of prepared rows with t ≥ first."""
        count = 0
        for index in self.within(first, np.inf):
            if index not in self.kept:
                self.prepared(index)
            if (kept := self.kept[index]) is not None:
                whole = first <= kept.first.t[0]
                count += kept.count if whole else int(np.sum(kept.instants(self.spool) >= first))
        return count

    def _ratio(self) -> int:
        """Rows of the log per prepared row."""
        rate = self.preparation.rate_hz
        return 1 if rate is None else max(1, round(0.5 / self.half_step / rate))


_ARRAYS = ("t", *ARRAYS)


@dataclass(frozen=True, slots=True, eq=False)
class _Kept:
    """A recording whose rows are in the spool: its first row, and the place of all rows."""

    first: Recording
    start: int
    count: int

    def instants(self, spool: Spool) -> FloatArray:
        return spool.read(self.start, self.count)  # the clock is the first of the arrays

    def read(self, spool: Spool) -> Recording:
        arrays, at = {}, self.start
        for key in _ARRAYS:
            like = getattr(self.first, key)
            if like is not None:
                arrays[key] = spool.read(at, self.count * like.size)
                arrays[key] = arrays[key].reshape(self.count, *like.shape[1:])
                at += arrays[key].size
        return self.first.replace(**arrays)


def _stored(rows: Recording, spool: Spool) -> _Kept:
    start = spool.size
    for key in _ARRAYS:
        values = getattr(rows, key)
        if values is not None:
            spool.append(values)
    # The columns of prepared rows hold what further signals were for.
    first = rows.take([0], "").replace(history=rows.history, signals={})
    return _Kept(first, start, len(rows))


def _keep_freed_memory() -> None:
    """Let the C library keep what one block frees for the next.

    glibc returns freed arrays to the system from a size on that it raises to that of the largest
    array freed so far, 32 MiB at most. New pages for every array of every block take a fifth of the
    computing time. Elsewhere the call has no effect.
    """
    np.empty(31 * 2**20, dtype=np.uint8)


def head_of(log: StreamedRecording) -> Recording:
    """The first rows, on which units, signs and options are checked."""
    return log.block(0, BLOCK)


def blocks_of(
    log: StreamedRecording,
    lib: Library,
    preparation: Preparation,
    terms: Friction,
    rows: tuple[int, int] | None = None,
    between: tuple[float, float] = (-np.inf, np.inf),
    rate_hz: float | None = None,
) -> Blocks:
    """Divide rows of a log into blocks whose size is a whole number of prepared rows."""
    rate = head_of(log).rate_hz if rate_hz is None else rate_hz
    blocks = Blocks(log, lib, preparation, terms, 0, (), np.zeros(0), 0.5 / rate, Spool(log.name))
    ratio = blocks._ratio()
    overlap = _rounded(int(np.ceil(_reach_of_edge(preparation) * rate)) + 8, ratio)
    size = _rounded(max(BLOCK, 4 * overlap), ratio)
    first, stop = rows or (0, log.rows)
    starts = range(first, stop, size)
    ends = np.array(between) + blocks.half_step
    instants = np.concatenate([ends[:1], log.instants(starts[1:], REACH), ends[1:]])
    edges = (*starts, stop)
    return replace(blocks, overlap=overlap, edges=edges, instants=instants)


def _reach_of_edge(preparation: Preparation) -> float:
    """Distance from an edge [s] beyond which it has no effect on a prepared row."""
    late = float(np.max(np.abs(np.atleast_1d(preparation.torque_delay_s or 0.0))))
    seconds = (preparation.trim_s or 0.0) + (preparation.max_gap_s or 0.0) + late
    if preparation.filter == "butterworth" and preparation.cutoff_hz is not None:
        slowest = 2 * np.pi * preparation.cutoff_hz * np.sin(np.pi / (2 * preparation.order))
        return seconds + FADING / slowest
    if preparation.window_s is not None and preparation.filter != "none":
        return seconds + 2 * preparation.window_s
    return seconds


def _rounded(rows: int, ratio: int) -> int:
    """Smallest multiple of `ratio` that is not below `rows`."""
    return -(-rows // ratio) * ratio
