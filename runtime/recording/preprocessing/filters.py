"""Zero-phase filters and derivatives, segment by segment: no filter crosses a hole.

Every filter treats q, dq, ddq, τ and the friction columns alike, because a linear relation
between signals survives only if all of them pass the same filter.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.numerics.sections import butterworth_sections
from runtime.recording import Recording
from runtime.recording.preprocessing.segments import holes, segments, uniform_step
from runtime.recording.preprocessing.zero_phase import zero_phase
from runtime.recording.recording import ALL, FloatArray

FILTERED = ("Low-passed", "Averaged", "Smoothed")
"""First words of the sentences that these filters add to the history."""

LOWEST = 1e-7
"""Cut-off over rate at which the poles of a low-pass are 1 in double precision."""


@dataclass(frozen=True, slots=True)
class Butterworth:
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
    """Butterworth low-pass for the clock of a recording.

    Args:
        recording: on a uniform clock.
        cutoff_hz: cut-off [Hz].
        order: of the filter; it is applied forwards and backwards.

    Returns:
        Second-order sections with the rows that they need.

    Raises:
        RecordingError: the clock is not uniform, or the cut-off is not below half the rate.
    """
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
    """Selected rows of every signal, filtered segment by segment.

    Args:
        recording: without segments that are too short.
        design: the low-pass.
        only: names of the signals.
        rows: (M,) indices of the rows, ascending.
        period: as for `zero_phase`.

    Returns:
        name → (M, …).
    """
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
    """Sentence of the history about a low-pass.

    Args:
        cutoff_hz: cut-off [Hz].
        order: of the filter.

    Returns:
        The sentence.
    """
    return f"Low-passed at {cutoff_hz:g} Hz (Butterworth of order {order}, both directions)."


def moving_average(recording: Recording, window_s: float, only: tuple[str, ...] = ALL) -> Recording:
    """Mean over a centred window of an odd number of samples; it narrows at the ends.

    Args:
        recording: on a uniform clock.
        window_s: length of the window [s].
        only: names of the signals.

    Returns:
        The averaged recording.

    Raises:
        RecordingError: the clock is not uniform.
    """
    half = _half_window(recording, window_s, "average")

    def smooth(values: FloatArray) -> FloatArray:
        n = len(values)
        sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
        i = np.arange(n)
        reach = np.minimum(half, np.minimum(i, n - 1 - i))
        width = (2 * reach + 1).reshape(-1, *[1] * (values.ndim - 1))
        return (sums[i + reach + 1] - sums[i - reach]) / width

    what = "all signals" if only == ALL else ", ".join(only)
    sentence = f"Averaged {what} over {2 * half + 1} samples ({window_s:g} s)."
    return _per_segment(recording, smooth, 1, sentence, only)


def savitzky_golay(
    recording: Recording, window_s: float, order: int = 4, only: tuple[str, ...] = ALL
) -> Recording:
    """Least-squares polynomials over a sliding window; missing dq and ddq are their derivatives.

    Args:
        recording: on a uniform clock.
        window_s: length of the window [s].
        order: degree of the polynomials.
        only: names of the signals.

    Returns:
        The smoothed recording.

    Raises:
        RecordingError: the clock is not uniform, or the window holds too few samples.
    """
    half = _half_window(recording, window_s, "fit polynomials")
    width = 2 * half + 1
    if width <= order:
        raise RecordingError(
            f"the Savitzky–Golay window of {width} samples expects more than {order}, the degree; "
            "widen window_s"
        )
    step = uniform_step(recording, "fit polynomials")

    def smooth(values: FloatArray, derivative: int = 0) -> FloatArray:
        from scipy import signal as scipy_signal

        return np.asarray(
            scipy_signal.savgol_filter(values, width, order, deriv=derivative, delta=step, axis=0)
        )

    missing = [key for key in ("dq", "ddq") if key in only and getattr(recording, key) is None]
    recording = without_short(recording, width)
    derived: dict[str, FloatArray] = {}
    for key in missing:
        base, derivative = ("q", 1) if key == "dq" else ("dq", 1)
        if key == "ddq" and "dq" in missing:
            base, derivative = "q", 2
        values = getattr(recording, base)
        parts = segments(recording.t)
        derived[key] = np.concatenate([smooth(values[part], derivative) for part in parts])
    suffix = f", {' and '.join(missing)} by its derivatives" if missing else ""
    sentence = f"Smoothed by Savitzky–Golay, degree {order} over {width} samples{suffix}."
    return _per_segment(recording, smooth, width, sentence, only).replace(**derived)


def differentiate(recording: Recording, from_position: bool = False) -> Recording:
    """Fill in dq from q and ddq from dq by central differences, of second order at the ends as
    well.

    Args:
        recording: with q.
        from_position: replace measured dq and ddq too.

    Returns:
        The recording with dq and ddq.
    """
    result = recording
    if from_position or recording.dq is None:
        result = without_short(result, 3)
        result = result.replace(dq=_gradient(result.t, result.q)).noted(
            "Differentiated q to dq by central differences."
        )
    if from_position or recording.ddq is None:
        result = without_short(result, 3)
        result = result.replace(ddq=_gradient(result.t, result.required("dq"))).noted(
            "Differentiated dq to ddq by central differences."
        )
    return result


def _gradient(t: FloatArray, values: FloatArray) -> FloatArray:
    """The slope of the parabola through three neighbours: the row itself, or next to an edge."""
    hole = holes(t)
    centre = np.arange(len(t))
    centre[0] += 1
    centre[1:] += hole
    centre[:-1] -= hole
    centre[-1] -= 1
    before, after = t[centre] - t[centre - 1], t[centre + 1] - t[centre]
    off = 2.0 * (t - t[centre])  # 0 but at edges
    left = (off - after) / (before * (before + after))
    right = (off + before) / (after * (before + after))
    here = values.take(centre, axis=0)
    slope = left[:, None] * (values.take(centre - 1, axis=0) - here)
    slope += right[:, None] * (values.take(centre + 1, axis=0) - here)
    return slope


def _half_window(recording: Recording, window_s: float, purpose: str) -> int:
    """Half of the odd window, in samples: the largest that fits into window_s."""
    return int(window_s / uniform_step(recording, purpose) + 1e-6) // 2


def _per_segment(
    recording: Recording,
    function: Callable[[FloatArray], FloatArray],
    minimum: int,
    sentence: str,
    only: tuple[str, ...],
) -> Recording:
    recording = without_short(recording, minimum)
    parts = segments(recording.t)
    return recording.mapped(
        lambda values: np.concatenate([function(values[part]) for part in parts]), sentence, only
    )


def without_short(recording: Recording, minimum: int) -> Recording:
    """The recording without segments that hold fewer samples than a step needs.

    Args:
        recording: the data.
        minimum: number of samples.

    Returns:
        The remaining segments.
    """
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
