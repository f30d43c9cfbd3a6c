"""Training, validation and test part of a streamed log, each in blocks of its own rows.

No block reaches beyond its part, so that no row of the test part has an effect on the others
(`runtime.recording.preprocessing.parts` does the same for a log in memory).
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from runtime.errors import RecordingError
from runtime.identification.long_logs.blocks import REACH, Blocks, blocks_of, head_of
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, Split, StreamedRecording
from runtime.recording.preprocessing.parts import for_part, span_of_part, validation_start


@dataclass(frozen=True, slots=True, eq=False)
class StreamedPart:
    """One part of a streamed log.

    Attributes:
        blocks: blocks of its rows, or of those of the training part, which include it.
        span: first and last instant of its prepared rows [s].
        first: first instant that is taken of the blocks [s].
    """

    blocks: Blocks
    span: tuple[float, float]
    first: float = -np.inf

    def recordings(self) -> Iterator[Recording]:
        """Prepared rows, one block at a time in the order of time."""
        return self.blocks.parts(self.first, np.inf)

    def count(self) -> int:
        """Number of prepared rows."""
        return self.blocks.count(self.first)


def parts_of_log(
    log: StreamedRecording,
    lib: Library,
    preparation: Preparation,
    terms: Friction,
    shares: Split,
    is_joined: bool = False,
    rate_hz: float | None = None,
) -> dict[str, StreamedPart]:
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

    def part(name: str, share: tuple[float, float]) -> StreamedPart:
        rows = row(share[0]), row(share[1])
        if rows[0] >= rows[1]:
            raise RecordingError(
                f"no row of {log.name} is in the {name} part, {share[0]:g} to {share[1]:g} of the "
                "duration; use another --split"
            )
        short = for_part(preparation, (share[1] - share[0]) * duration)
        span = span_of_part((start, end), share, short)
        guarded = short.trim_s is None
        kept = (
            span[0] if guarded and share[0] > 0.0 else -np.inf,
            span[1] if guarded and share[1] < 1.0 else np.inf,
        )
        return StreamedPart(blocks_of(log, lib, short, terms, rows, kept, rate), span)

    train = part("train", shares.joined() if is_joined else shares.train)
    if shares.is_everything:
        return dict.fromkeys(("train", "validation", "test"), train)
    if is_joined:
        low = validation_start(shares, train.span)
        validation = StreamedPart(train.blocks, (low, train.span[1]), low)
    else:
        validation = part("validation", shares.validation)
    return {"train": train, "validation": validation, "test": part("test", shares.test)}


def first_row(share_of: Callable[[int], float], count: int, share: float) -> int:
    """First row whose share of the duration is not below a bound.

    The search begins where a uniform clock has that row and doubles its steps from there, since
    every share is read from the file.
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
