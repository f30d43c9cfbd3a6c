"""Moving averages and Savitzky–Golay polynomials, segment by segment: none crosses a hole."""

from collections.abc import Callable

import numpy as np

from runtime.errors import RecordingError
from runtime.recording import Recording
from runtime.recording.preprocessing.filters import without_short
from runtime.recording.preprocessing.segments import segments, uniform_step
from runtime.recording.recording import ALL, FloatArray


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
