"""Zero-phase filters and derivatives, segment by segment: nothing looks across a hole.

Every filter treats q, dq, ddq, τ and the friction columns alike, because a linear relation
between signals survives only if all of them pass the same filter.
"""

from collections.abc import Callable, Iterable

import numpy as np
from scipy import signal as scipy_signal

from runtime.errors import RecordingError
from runtime.preprocessing.segments import segments, uniform_step
from runtime.recording import Recording
from runtime.recording.recording import SIGNALS, FloatArray

ALL = (*SIGNALS, "columns")
FILTERED = ("Low-passed", "Averaged", "Smoothed")
"""How the sentences of the filters below begin."""


def is_filtered(history: Iterable[str]) -> bool:
    """Whether one of these filters is among the steps of a recording."""
    return any(step.startswith(FILTERED) for step in history)


def low_pass(
    recording: Recording, cutoff_hz: float, order: int = 4, only: tuple[str, ...] = ALL
) -> Recording:
    """Butterworth forwards and backwards: gain |H(f)|² = 1 / (1 + (f/f_c)^(2·order)), phase 0.

    (Analogue form; the digital one bends frequencies close to half the rate.)

    Raises:
        RecordingError: the clock is not uniform, or the cut-off not below half the rate.
    """
    step = uniform_step(recording, "low-pass")
    if not 0.0 < cutoff_hz * step < 0.499:
        raise RecordingError(
            f"cutoff_hz expects a value between 0 and {0.5 / step:.4g} Hz (half the rate), "
            f"got {cutoff_hz:g}; lower it"
        )
    sections = scipy_signal.butter(order, cutoff_hz * 2.0 * step, output="sos")
    settle = int(np.ceil(4.0 / (cutoff_hz * step)))  # ten time constants of the slowest pole
    minimum = 3 * (order + 1)

    def smooth(values: FloatArray) -> FloatArray:
        padding = min(max(settle, minimum), len(values) - 1)
        return np.asarray(scipy_signal.sosfiltfilt(sections, values, axis=0, padlen=padding))

    sentence = f"Low-passed at {cutoff_hz:g} Hz (Butterworth of order {order}, both directions)."
    return _per_segment(recording, smooth, minimum, sentence, only)


def moving_average(recording: Recording, window_s: float, only: tuple[str, ...] = ALL) -> Recording:
    """The mean over a centred window of an odd number of samples; it narrows at the ends.

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
        return np.asarray(
            scipy_signal.savgol_filter(values, width, order, deriv=derivative, delta=step, axis=0)
        )

    missing = [key for key in ("dq", "ddq") if key in only and getattr(recording, key) is None]
    recording = _without_short(recording, width)
    derived: dict[str, FloatArray] = {}
    for key in missing:
        base, derivative = ("q", 1) if key == "dq" else ("dq", 1)
        if key == "ddq" and "dq" in missing:
            base, derivative = "q", 2
        values = getattr(recording, base)
        parts = segments(recording.t)
        derived[key] = np.concatenate([smooth(values[part], derivative) for part in parts])
    told = f", {' and '.join(missing)} by its derivatives" if missing else ""
    sentence = f"Smoothed by Savitzky–Golay, degree {order} over {width} samples{told}."
    return _per_segment(recording, smooth, width, sentence, only).replace(**derived)


def differentiate(recording: Recording, from_position: bool = False) -> Recording:
    """Fills dq from q and ddq from dq by central differences, second order at the ends as well.

    Measured dq and ddq are kept, unless `from_position` asks for both anew from q.
    """
    result = recording
    if from_position or recording.dq is None:
        result = _without_short(result, 3)
        result = result.replace(dq=_gradient(result.t, result.q)).noted(
            "Differentiated q to dq by central differences."
        )
    if from_position or recording.ddq is None:
        result = _without_short(result, 3)
        assert result.dq is not None  # noqa: S101  (just filled)
        result = result.replace(ddq=_gradient(result.t, result.dq)).noted(
            "Differentiated dq to ddq by central differences."
        )
    return result


def _gradient(t: FloatArray, values: FloatArray) -> FloatArray:
    parts = [np.gradient(values[part], t[part], axis=0, edge_order=2) for part in segments(t)]
    return np.concatenate(parts)


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
    recording = _without_short(recording, minimum)
    parts = segments(recording.t)
    return recording.mapped(
        lambda values: np.concatenate([function(values[part]) for part in parts]), sentence, only
    )


def _without_short(recording: Recording, minimum: int) -> Recording:
    """Without the segments that hold fewer samples than a step needs."""
    parts = segments(recording.t)
    short = [part for part in parts if part.stop - part.start < minimum]
    if not short:
        return recording
    keep = np.ones(len(recording), dtype=bool)
    for part in short:
        keep[part] = False
    return recording.take(
        keep,
        f"Dropped {len(short)} segments with fewer than {minimum} samples ({np.sum(~keep)} rows).",
    )
