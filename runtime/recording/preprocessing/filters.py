"""Zero-phase low-pass filters, segment by segment: no filter crosses a hole.

Every filter, here and in `smoothing`, treats q, dq, ddq, τ and the friction columns alike, because
a linear relation between signals survives only if all of them pass the same filter.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording import Recording
from runtime.recording.preprocessing.sections import butterworth_sections
from runtime.recording.preprocessing.segments import holes, segments, uniform_step
from runtime.recording.preprocessing.zero_phase import zero_phase
from runtime.recording.recording import ALL, FloatArray

FILTERED = ("Low-passed", "Averaged", "Smoothed")
"""First words of the sentences that these filters add to the history."""

LOWEST = 1e-7
"""Cut-off over rate at which the poles of a low-pass are 1 in double precision."""


class Butterworth(NamedTuple):
    """A low-pass for one clock.

    Attributes:
        sections: second-order sections.
        padding: rows of odd extension: ten time constants of the slowest pole.
        minimum: rows of the shortest segment.
    """

    sections: FloatArray
    padding: int
    minimum: int


def is_filtered(history: Iterable[str]) -> bool:
    """Whether one of these filters is among the steps of a recording.

    Steps of joined logs begin with the name of their log and a colon.
    """
    return any(
        step.startswith(FILTERED) or any(f": {word}" in step for word in FILTERED)
        for step in history
    )


def butterworth(recording: Recording, cutoff_hz: float, order: int = 4) -> Butterworth:
    """Butterworth low-pass for the clock of a recording."""
    step = uniform_step(recording, "low-pass")
    if not 0.0 < cutoff_hz * step < 0.499:
        raise RecordingError(
            f"cutoff_hz expects a value between 0 and {0.5 / step:.4g} Hz (half the rate), "
            f"got {cutoff_hz:g}; lower it"
        )
    if not cutoff_hz * step > LOWEST:
        raise RecordingError(
            f"cutoff_hz expects at least {LOWEST:g} of the rate, {1.0 / step:.4g} Hz, got "
            f"{cutoff_hz:g} Hz; raise it, or state the unit of time"
        )
    sections = butterworth_sections(order, cutoff_hz * 2.0 * step)
    minimum = 3 * (order + 1)
    return Butterworth(sections, max(int(np.ceil(4.0 / (cutoff_hz * step))), minimum), minimum)


def low_pass(
    recording: Recording, cutoff_hz: float, order: int = 4, only: tuple[str, ...] = ALL
) -> Recording:
    """Low-pass forwards and backwards: gain |H(f)|² = 1 / (1 + (f/f_c)^(2·order)), phase 0.

    This is the analogue form; the digital one bends frequencies close to half the rate.

    Args:
        recording: on a uniform clock.
        cutoff_hz: f_c [Hz].
        order: of the Butterworth filter.
        only: names of the signals that are filtered.

    Returns:
        The filtered recording without segments that are too short.

    Raises:
        RecordingError: the clock is not uniform, or the cut-off is not below half the rate.
    """
    design = butterworth(recording, cutoff_hz, order)
    data = without_short(recording, design.minimum)
    filtered = low_passed(data, design, only, np.arange(len(data)))
    return data.replace(**filtered).noted(low_pass_sentence(cutoff_hz, order))


def low_passed(
    recording: Recording,
    design: Butterworth,
    only: tuple[str, ...],
    rows: NDArray[np.int64],
    period: int = 1,
) -> dict[str, FloatArray]:
    """Selected rows of every signal, filtered segment by segment."""
    present = {k: v for k in only if (v := getattr(recording, k)) is not None}
    flat = [values.reshape(len(recording), -1) for values in present.values()]
    parts = []
    for part in segments(recording.t):
        length = part.stop - part.start
        inside = rows[np.searchsorted(rows, part.start) : np.searchsorted(rows, part.stop)]
        padding = min(design.padding, length - 1)
        segment = [values[part] for values in flat]
        parts.append(zero_phase(design.sections, segment, padding, inside - part.start, period))
    whole = [
        pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
        for pieces in zip(*parts, strict=True)
    ]
    return {
        key: values.reshape(len(rows), *present[key].shape[1:])
        for key, values in zip(present, whole, strict=True)
    }


def low_pass_sentence(cutoff_hz: float, order: int) -> str:
    """Sentence of the history about a low-pass."""
    return f"Low-passed at {cutoff_hz:g} Hz (Butterworth of order {order}, both directions)."


def without_short(recording: Recording, minimum: int) -> Recording:
    """The recording without segments that hold fewer samples than a step needs."""
    edges = np.flatnonzero(np.concatenate([[True], holes(recording.t), [True]]))
    lengths = np.diff(edges)
    short = lengths < minimum
    if not short.any():
        return recording
    keep = np.repeat(~short, lengths)
    return recording.take(
        keep,
        f"Dropped {short.sum()} segments with fewer than {minimum} samples ({np.sum(~keep)} rows).",
    )
