"""Low-pass, derivatives, trim and rate in one step: only the remaining rows are computed.

The steps one after the other would give the same rows; here they first mark which instants stay,
then the filter gives these and the neighbours that their derivatives need.
"""

import numpy as np
from numpy.typing import NDArray

from runtime.recording import Preparation, Recording
from runtime.recording.preprocessing.derivatives import SENTENCES, slopes
from runtime.recording.preprocessing.filters import (
    ALL,
    butterworth,
    low_pass_sentence,
    low_passed,
    without_short,
)
from runtime.recording.preprocessing.segments import decimate, segments, trim
from runtime.recording.recording import FloatArray


def thinned(recording: Recording, preparation: Preparation) -> Recording | None:
    """Filtered, differentiated, trimmed and decimated recording."""
    cutoff, rate = preparation.cutoff_hz, preparation.rate_hz
    if cutoff is None or rate is None:
        return None
    design = butterworth(recording, cutoff, preparation.order)
    data = without_short(recording, design.minimum)
    marked = _numbered(data)
    if preparation.trim_s is not None:
        marked = trim(marked, preparation.trim_s)
    marked = decimate(marked, rate)
    stay = marked.q[:, 0].astype(np.int64)
    if not np.array_equal(data.t[stay], marked.t):
        return None
    period = int(np.median(np.diff(stay))) if len(stay) > 1 else 1
    missing = [key for key in ("dq", "ddq") if getattr(data, key) is None]
    others: tuple[str, ...] = ALL
    history: tuple[str, ...] = ()
    derived: dict[str, FloatArray] = {}
    if missing:
        source = "q" if "dq" in missing else "dq"
        others = tuple(key for key in ALL if key != source)
        rows = _with_neighbours(data, stay, len(missing))
        values = low_passed(data, design, (source,), rows, period)[source]
        # The last derivative is needed at the remaining rows only.
        near, kept = data.t[rows], np.searchsorted(rows, stay)
        derived[source], below = values.take(kept, axis=0), values
        for key in missing[:-1]:
            below = slopes(near, below)
            derived[key] = below.take(kept, axis=0)
        derived[missing[-1]] = slopes(near, below, kept)
        history = tuple(SENTENCES[key] for key in missing)
    derived |= low_passed(data, design, others, stay, period)
    sentence = low_pass_sentence(cutoff, preparation.order)
    return data.replace(
        t=marked.t, **derived, history=(*data.history, sentence, *history, *marked.history)
    )


def _numbered(recording: Recording) -> Recording:
    """Numbers of the rows as a signal on the same clock, whose rate stays known."""
    others = dict.fromkeys(("dq", "ddq", "tau", "columns", "rows", "motors"))
    numbers = np.arange(len(recording), dtype=float)[:, None]
    return recording.replace(q=numbers, **others, column_names=(), joint_names=(), history=())


def _with_neighbours(
    recording: Recording, rows: NDArray[np.int64], reach: int
) -> NDArray[np.int64]:
    """The rows and as many on both sides, or 2 · reach on one side at the edge of a segment."""
    near = np.zeros(len(recording), dtype=bool)
    for part in segments(recording.t):
        kept = rows[np.searchsorted(rows, part.start) : np.searchsorted(rows, part.stop)]
        first = np.clip(kept - reach, part.start, part.stop - 1 - 2 * reach)
        near[first[:, None] + np.arange(2 * reach + 1)] = True
    return np.flatnonzero(near)
