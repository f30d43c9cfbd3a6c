"""Training, validation and test part of a streamed log, each in blocks of its own rows.

No block reaches beyond its part, so that no row of the test part has an effect on the others
(`runtime.recording.preprocessing.parts` does the same for a log in memory).
"""

from bisect import bisect_left
from collections.abc import Iterator

import numpy as np

from runtime.errors import RecordingError
from runtime.identification.long_logs.blocks import REACH, Blocks, blocks_of, head_of
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, Split, StreamedRecording
from runtime.recording.preprocessing.parts import for_part, span_of_part, validation_start
from runtime.startup.data_classes import dataclass


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


def parts_of_log(
    log: StreamedRecording,
    lib: Library,
    preparation: Preparation,
    terms: Friction,
    shares: Split,
    is_joined: bool = False,
) -> dict[str, StreamedPart]:
    """Divide a streamed log into its parts.

    Args:
        log: rows in their file.
        lib: library of the robot.
        preparation: steps for each part.
        terms: friction columns.
        shares: fractions of the duration.
        is_joined: the training part includes the validation part.

    Returns:
        "train", "validation" and "test" → part; nothing is prepared yet.

    Raises:
        RecordingError: the log has no clock, or a part holds no row.
    """
    start = float(log.instants([0], REACH)[0])
    end = float(log.block(max(log.rows - REACH, 0), log.rows).t[-1])
    duration = end - start or 1.0
    rate = head_of(log).rate_hz

    def row(share: float) -> int:
        def share_of(row: int) -> float:
            return float(log.instants([row], REACH)[0] - start) / duration

        rows = range(log.rows)
        return len(rows) if share == 1.0 else bisect_left(rows, share, key=share_of)

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
