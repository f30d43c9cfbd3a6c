"""Rows of a log that stays in its file, in memory that does not grow with its length.

    pass 1  windows of every part: first weights, residual correlations, pictures
    pass 2  all rows of the training part → one triangular factor (`runtime.estimators.regression`)
    pass 3  all rows of the test part → ‖τ − τ̂‖ of the answer
    on request all rows of all parts → factor of the second fit (`single_log.identify_assembled`)

The factor is that of the whole log: each block has enough overlap that its edges have no effect,
and begins at instants that decimation keeps. The response of a Butterworth filter of order p decays
like exp(−t/T), T = 1 / (2π f_c sin(π/2p)); thirty T on both sides leave 1e-13 of the signal beyond
the block. No block reaches beyond its part, so that no row of the test part has an effect on the
others. Each block is prepared once; its rows are then stored in a temporary file.

Friction with a memory begins anew with every block, ζ = 0 at the start of its overlap. What it
lacks fades with the travel, and is the difference from the block before where both have a row:

    ζ_true − ζ = d exp(−Σ|Δq| / z_c),   d at the first row, |d| ≤ exp(−travel of the overlap / z_c)

so that a joint that rests from one block to the next keeps its state.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from runtime.common.threads import computed_ahead, one_blas_thread
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.descent.fit import Preset
from runtime.estimators.methods import methods_from_statistics, require_method
from runtime.estimators.regression.samples import samples_of
from runtime.identification import settings as fit_settings
from runtime.identification.identified import Identification, WholeLog, torque_errors
from runtime.identification.problem_setup import PARTS, Assembly, FitOfAssembly, assembled
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.consistency import check_consistency, require_plausible
from runtime.recording.formats.tables import Spool, Tables
from runtime.recording.friction.coupled_motors import geared
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import for_part, span_of_part, validation_start
from runtime.recording.recording import ARRAYS
from runtime.recording.settings import COLUMNS
from runtime.recording.streamed import StreamedRecording

BLOCK = 65536  # rows of a block: a minute at 1 kHz, about ten megabytes
FADING = 30.0  # time constants of the filter in the overlap
AHEAD = 3  # largest number of blocks that are prepared while another one is used
REACH = 4096  # rows of which at least one has a usable time stamp


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """A part of a streamed log in blocks, with its preparation."""

    log: StreamedRecording  # rows in their file
    lib: Library  # library of the robot
    preparation: Preparation  # steps for each block; rows of rest are dropped
    terms: Friction  # friction columns
    overlap: int  # rows on either side that are prepared and discarded
    edges: tuple[int, ...]  # first row of each block, then one past the last row
    # t [s] of these rows; at the ends those of the first and the last prepared row that is kept, or
    # −∞ and ∞
    instants: Array
    half_step: float  # half of the time step [s]; edges lie between two rows
    spool: Spool  # temporary file of prepared rows
    kept: dict[int, "_Kept | None"] = field(default_factory=dict)  # block → place; None at rest
    span: tuple[float, float] = (-np.inf, np.inf)  # ends of the prepared rows of the part [s]
    first: float = -np.inf  # first instant of the blocks [s]; a training part may have others
    # index of a block → columns with a memory at its first row, by the block before, (n, m)
    states: dict[int, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.edges) - 1

    def prepared(self, index: int) -> Recording | None:
        """Prepared rows of one block; None where the arm rests in all of it."""
        if index not in self.kept:
            return self._stored(index, self._prepare(index, self._read(index)))
        kept = self.kept[index]
        return None if kept is None else kept.read(self.spool)

    def _stored(
        self, index: int, ready: "tuple[Recording | None, _Memory | None]"
    ) -> Recording | None:
        rows, memory = ready
        if memory is not None:
            lacked = self.states.get(index, memory.ends[0]) - memory.ends[0]
            lacked = np.clip(lacked, -memory.before[:, None], memory.before[:, None])
            self.states[index + 1] = memory.ends[1] + lacked * memory.after[:, None]
            if rows is not None and lacked.any():
                columns = np.array(rows.columns)
                columns[:, :, memory.places] += lacked * memory.within[:, :, None]
                rows = rows.replace(columns=columns)
        self.kept[index] = None if rows is None else _stored(rows, self.spool)
        return rows

    def in_order(self, indices: range) -> Iterator[Recording | None]:
        """Prepared blocks; the next ones are read and prepared meanwhile, one per core."""
        # This thread alone reads and stores: files and spool have one place, and rows that are
        # read in order are decoded once.
        # glibc returns arrays to the system above a size that it raises to that of the largest one
        # freed, 32 MiB at most; new pages for every array would take a fifth of the time.
        np.empty(31 * 2**20, dtype=np.uint8)
        new = [index for index in indices if index not in self.kept]
        raw = ((index, self._read(index)) for index in new)
        ready = computed_ahead(lambda each: self._prepare(*each), raw, AHEAD)
        for index in indices:
            yield self._stored(index, next(ready)) if index in new else self.prepared(index)

    def _read(self, index: int) -> Tables:
        start, stop = self.edges[index], self.edges[index + 1]
        first = max(start - self.overlap, self.edges[0])
        return self.log.numbers(first, min(stop + self.overlap, self.edges[-1]))

    def _prepare(self, index: int, raw: Tables) -> "tuple[Recording | None, _Memory | None]":
        window = self.log.recording_of(raw)
        whole = prepare(
            window, replace(self.preparation, rest_speed=None), self.terms, lib=self.lib
        )
        first, last = np.searchsorted(whole.t, self.instants[index : index + 2] - self.half_step)
        kept = np.arange(first, last)
        rest = self.preparation.rest_speed
        if rest is not None and whole.dq is not None:
            kept = kept[np.any(np.abs(whole.dq[kept]) >= rest, axis=1)]
        memory, names, columns = None, whole.column_names, whole.columns
        places = [k for k, each in enumerate(names) if each in COLUMNS and COLUMNS[each].has_memory]
        if columns is not None and places and first < len(whole):
            places += [
                k for k, each in enumerate(names) if each in COLUMNS and COLUMNS[each].takes_memory
            ]
            travel = np.cumsum(np.abs(np.diff(whole.q, axis=0, prepend=whole.q[:1])), axis=0)
            left = np.exp(-np.abs(travel - travel[first]) / self.terms.dahl_stroke)
            edges = [first, min(last, len(whole) - 1)]
            ends = columns[edges][:, :, places]
            memory = _Memory(places, ends, left[0], left[kept], left[edges[1]])
        took = f"Took {len(kept)} rows of a block."
        return (whole.take(kept, took) if kept.size else None), memory

    def within(self) -> range:
        """Blocks that contain instants t ≥ `first`."""
        begin = int(np.searchsorted(self.instants, self.first, side="right")) - 1
        return range(max(begin, 0), len(self))

    def recordings(self) -> Iterator[Recording]:
        """Prepared rows with t ≥ `first`, one block at a time in the order of time."""
        for block in self.in_order(self.within()):
            if block is None or block.t[-1] < self.first:
                continue
            inside = block.t >= self.first
            yield block if inside.all() else block.take(inside, "Cut to the part.")

    def count(self) -> int:
        """Number of prepared rows with t ≥ `first`."""
        count = 0
        for index in self.within():
            if index not in self.kept:
                self.prepared(index)
            if (kept := self.kept[index]) is not None:
                whole = self.first <= kept.first.t[0]
                rows = kept.count if whole else np.sum(kept.array("t", self.spool) >= self.first)
                count += int(rows)
        return count


@dataclass(frozen=True, slots=True, eq=False)
class _Memory:
    """Columns with a memory of a block, and what is left of their state by travel."""

    places: list[int]  # of the m columns
    ends: Array  # columns at the first rows of this block and of the next one, (2, n, m)
    before: Array  # exp(−Σ|Δq| / z_c) from the first prepared row to the first row, (n,)
    within: Array  # from there to every row of the block, (N, n)
    after: Array  # to the first row of the next block, (n,)


@dataclass(frozen=True, slots=True, eq=False)
class _Kept:
    """A recording whose rows are in the spool: its first row, and the place of each array."""

    first: Recording
    places: dict[str, int]
    count: int

    def array(self, key: str, spool: Spool) -> Array:
        like = np.asarray(getattr(self.first, key))
        values = spool.read(self.places[key], self.count * like.size)
        return values.reshape(self.count, *like.shape[1:])

    def read(self, spool: Spool) -> Recording:
        return self.first.replace(**{key: self.array(key, spool) for key in self.places})


def _stored(rows: Recording, spool: Spool) -> _Kept:
    arrays = {key: getattr(rows, key) for key in ("t", *ARRAYS)}
    places = {key: spool.append(x) for key, x in arrays.items() if x is not None}
    # The columns of prepared rows hold what further signals were for.
    first = rows.take([0], "").replace(history=rows.history, signals={})
    return _Kept(first, places, len(rows))


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
    # Rows of the log per prepared row; overlap and size are the next multiples of it.
    ratio = max(1, round(rate / (preparation.rate_hz or rate)))
    overlap = ratio * -(-(int(np.ceil(_reach_of_edge(preparation) * rate)) + 8) // ratio)
    size = ratio * -(-max(BLOCK, 4 * overlap) // ratio)
    first, stop = rows or (0, log.rows)
    starts, half_step = range(first, stop, size), 0.5 / rate
    ends = np.array(between) + half_step
    instants = np.concatenate([ends[:1], log.instants(starts[1:], REACH), ends[1:]])
    parts = overlap, (*starts, stop), instants, half_step, Spool(log.name)
    return Blocks(log, lib, preparation, terms, *parts)


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


WINDOWS, LENGTH = 24, 4096  # of a part; rows in each: ten give noise and correlation to 1 %
WHOLE_ONLY = ("validation", "test", "inputs", "robust")  # `Settings` that need a log in memory


def parts_of_log(
    log: StreamedRecording,
    lib: Library,
    preparation: Preparation,
    terms: Friction,
    shares: Split,
    is_joined: bool = False,
    rate_hz: float | None = None,
) -> dict[str, Blocks]:
    """Divide a streamed log into its parts."""
    start = float(log.instants([0], REACH)[0])
    end = float(log.block(max(log.rows - REACH, 0), log.rows).t[-1])
    duration = end - start or 1.0
    rate = head_of(log).rate_hz if rate_hz is None else rate_hz

    def share_of(row: int) -> float:
        return float(log.instants([row], REACH)[0] - start) / duration

    @cache
    def row(share: float) -> int:
        return log.rows if share == 1.0 else first_row(share_of, log.rows, share)

    def part(name: str, share: tuple[float, float]) -> Blocks:
        rows = row(share[0]), row(share[1])
        if rows[0] >= rows[1]:
            raise RecordingError(
                f"no row of {log.name} is in the {name} part, {share[0]:g} to {share[1]:g} of the "
                "duration; use another --split"
            )
        short = for_part(preparation, (share[1] - share[0]) * duration)
        span, guarded = span_of_part((start, end), share, short), short.trim_s is None
        kept = (
            span[0] if guarded and share[0] > 0.0 else -np.inf,
            span[1] if guarded and share[1] < 1.0 else np.inf,
        )
        return replace(blocks_of(log, lib, short, terms, rows, kept, rate), span=span)

    train = part("train", shares.joined() if is_joined else shares.train)
    if shares.is_everything:
        return dict.fromkeys(("train", "validation", "test"), train)
    if is_joined:
        low = validation_start(shares, train.span)
        validation = replace(train, span=(low, train.span[1]), first=low)
    else:
        validation = part("validation", shares.validation)
    return {"train": train, "validation": validation, "test": part("test", shares.test)}


def first_row(share_of: Callable[[int], float], count: int, share: float) -> int:
    """First row whose share of the duration is not below a bound.

    The search begins where a uniform clock has that row: every share is read from the file.
    """
    place = min(max(int(np.ceil(share * (count - 1))), 0), count - 1)
    is_later = share_of(place) < share
    low, high, step = (place + 1, count, 1) if is_later else (0, place, 1)
    while low < high:
        probe = min(low + step, high) - 1 if is_later else max(high - step, low)
        is_below = share_of(probe) < share
        low, high = (probe + 1, high) if is_below else (low, probe)
        if is_below != is_later:
            break
        step *= 2
    return bisect_left(range(count), share, low, high, key=share_of)


def require_streamable(method: str, preset: str | Preset | None = None) -> None:
    """Refuse a method that needs the samples themselves."""
    record = require_method(method)
    if record.needs_samples(preset):
        what = "a preset with mini-batches" if record.from_statistics else f"the method {method}"
        raise IdentificationError(
            f"{what} needs the samples one by one, which a streamed log does not hold; choose one "
            f"of {', '.join(methods_from_statistics())} (adam with the preset full), "
            "or use --settings stream=false"
        )


@one_blas_thread
def assemble_streamed(
    log: StreamedRecording,
    lib: Library,
    settings: fit_settings.Settings,
    *,
    progress: fit_settings.Progress = fit_settings.SILENT,
    is_joined: bool = False,
) -> Assembly:
    """Assemble the problem of a log that stays in its file."""
    fit_settings.require_default(settings, WHOLE_ONLY, "a streamed log")
    require_streamable(settings.estimator.name, settings.preset)
    recipe = log.recipe
    preparation = settings.preparation or (recipe.preparation if recipe else Preparation())
    if preparation.regressor == "energy":
        raise IdentificationError(
            "rows of energy need the whole log in memory, but this one is streamed; use "
            "--settings regressor=momentum or --settings stream=false"
        )
    head = check_consistency(head_of(log))
    require_plausible(head, lib)
    terms = geared(fit_settings.terms_of(head, settings), head, lib)
    shares = fit_settings.shares_of(log, settings)
    whole = parts_of_log(log, lib, preparation, terms, shares, is_joined, head.rate_hz)
    progress.step("windows of the parts")

    def pieces(name: str) -> Iterator[Recording]:
        progress.step(f"passing over the {name} part")
        return whole[name].recordings()

    train, validation, test = (_windows(whole[name], name) for name in PARTS)
    given = (train, validation, test), lib, settings, terms, preparation.regressor
    assembly = assembled(*given, is_joined=is_joined, pieces=pieces)
    counts = {name: part.count() for name, part in whole.items()}
    spans = {name: part.span for name, part in whole.items()}
    blocks = {id(part.kept): len(part) for part in whole.values()}  # parts may share them
    note = (
        f"streamed {log.rows} rows in {sum(blocks.values())} blocks: the first fit uses all "
        f"{counts['train']} training samples, the torque error all {counts['test']} test samples; "
        "the first weights and the residual correlations come from up to "
        f"{WINDOWS} windows of {LENGTH} samples"
    )

    def finish(result: Identification, _: FitOfAssembly) -> Identification:
        pieces = (samples_of(part, lib) for part in assembly.recordings("test"))
        streamed = WholeLog(counts, spans, torque_errors(result, pieces))
        return replace(result, streamed=streamed, notes=(*result.notes, note))

    return replace(assembly, source_note=note, finish=finish)


def _windows(blocks: Blocks, name: str) -> Recording:
    """Windows spread evenly over a part, joined with gaps in time; all blocks are stored."""
    within = blocks.within()
    chosen = set(np.linspace(within.start, within.stop - 1, WINDOWS).round().astype(int).tolist())
    windows = []
    for index, block in zip(within, blocks.in_order(within), strict=True):
        if block is None or index not in chosen:
            continue
        inside = np.flatnonzero(block.t >= blocks.first)[:LENGTH]
        if inside.size:
            windows.append(block.take(inside, "Took a window."))
    if not windows:
        raise IdentificationError(
            f"no sample of {blocks.log.name} is left in the {name} part; use another --split"
        )
    head = windows[0]
    sentence = f"Took {len(windows)} windows of the {name} part ({sum(map(len, windows))} rows)."
    signals = {
        key: np.concatenate([getattr(each, key) for each in windows])
        for key in ("t", *ARRAYS)
        if getattr(head, key) is not None
    }
    return head.replace(**signals, signals={}, name=f"{head.name}/{name}").noted(sentence)
