"""Linear filters, segment by segment: none crosses a hole.

Zero-phase low-pass, moving average and Savitzky–Golay polynomials treat q, dq, ddq, τ and the
friction columns alike, because a linear relation between signals survives only if all of them pass
the same filter. `lagged` has the phase of a sensor instead.
"""

from collections.abc import Callable, Iterable
from types import ModuleType

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array
from runtime.recording import Recording
from runtime.recording.preprocessing.segments import segments, uniform_step, without_short
from runtime.recording.recording import ALL

FILTERED = ("Low-passed", "Averaged", "Smoothed")  # first words of the filters' sentences

LOWEST = 1e-7  # cut-off over rate at which the poles of a low-pass are 1 in double precision
AT_ONCE = 100_000  # values per call of SciPy: a call costs as much as 2000, and copies all


def scipy_signal() -> ModuleType:
    """`scipy.signal`, for the whole package: its import takes a third of a second."""
    import scipy.signal

    return scipy.signal


def is_filtered(history: Iterable[str]) -> bool:
    """Whether one of these filters is among the steps; those of joined logs begin with "LOG: "."""
    return any(
        step.startswith(FILTERED) or any(f": {word}" in step for word in FILTERED)
        for step in history
    )


def butterworth_sections(order: int, cutoff: float) -> Array:
    """Second-order sections (s, 6) of a low-pass; the cut-off is relative to half the rate."""
    return np.asarray(scipy_signal().butter(order, cutoff, output="sos"))


def low_pass(
    recording: Recording, cutoff_hz: float, order: int = 4, only: tuple[str, ...] = ALL
) -> Recording:
    """Low-pass forwards and backwards: gain |H(f)|² = 1 / (1 + (f/f_c)^(2·order)), phase 0.

    This is the analogue form; the digital one bends frequencies close to half the rate.
    """
    sections, extension = _butterworth(recording, cutoff_hz, order)
    shortest = 3 * (order + 1)
    both_directions = scipy_signal().sosfiltfilt

    def smooth(values: Array) -> Array:
        smoothed, padding = np.empty_like(values, order="C"), min(extension, len(values) - 1)
        flat, out = (each.reshape(len(values), -1) for each in (values, smoothed))
        width = max(1, AT_ONCE // len(values))
        for k in range(0, flat.shape[1], width):
            some = flat[:, k : k + width]
            out[:, k : k + width] = both_directions(sections, some, axis=0, padlen=padding)
        return smoothed

    sentence = f"Low-passed at {cutoff_hz:g} Hz (Butterworth of order {order}, both directions)."
    return _per_segment(recording, smooth, shortest, sentence, only)


def _butterworth(recording: Recording, cutoff_hz: float, order: int) -> tuple[Array, int]:
    """Second-order sections, and rows of odd extension: ten time constants of the slowest pole."""
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
    return sections, max(int(np.ceil(4.0 / (cutoff_hz * step))), 3 * (order + 1))


def lagged(recording: Recording, values: Array, cutoff_hz: float) -> Array:
    """First-order low-pass of signals, from rest at the start of every segment.

        H(s) = 1 / (1 + s / (2 π f))

    Drivers of force sensors often contain such a filter. A linear relation between forces and the
    other signals survives if these pass it, too; the inverse filter would amplify the noise of the
    forces instead. Forwards only.

    values (N, m) → (N, m).
    """
    step = uniform_step(recording, "delay")
    if not cutoff_hz * step < 0.499:
        raise RecordingError(
            f"{recording.name}: contact_force_z_cutoff is {cutoff_hz:g} Hz, expected a value below "
            f"{0.5 / step:.4g} Hz (half the rate); correct it, or remove it where the sensors have "
            "no such low-pass"
        )
    signal, sections = scipy_signal(), butterworth_sections(1, 2.0 * cutoff_hz * step)
    still = signal.sosfilt_zi(sections)[:, :, None]
    parts = [
        signal.sosfilt(sections, values[part], axis=0, zi=still * values[part][0])[0]
        for part in segments(recording.t)
    ]
    return np.concatenate(parts)


def moving_average(recording: Recording, window_s: float, only: tuple[str, ...] = ALL) -> Recording:
    """Mean over a centred window of an odd number of samples; it narrows at the ends."""
    half = _half_window(recording, window_s, "average")

    def smooth(values: Array) -> Array:
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
    """Least-squares polynomials over a sliding window; missing dq and ddq are their derivatives."""
    width = 2 * _half_window(recording, window_s, "fit polynomials") + 1
    if width <= order:
        raise RecordingError(
            f"the Savitzky–Golay window of {width} samples expects more than {order}, the degree; "
            "widen window_s"
        )
    step = uniform_step(recording, "fit polynomials")

    def smooth(values: Array, derivative: int = 0) -> Array:
        polynomials = scipy_signal().savgol_filter
        return np.asarray(polynomials(values, width, order, deriv=derivative, delta=step, axis=0))

    missing = [key for key in ("dq", "ddq") if key in only and getattr(recording, key) is None]
    recording = without_short(recording, width)
    derived: dict[str, Array] = {}
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
    function: Callable[[Array], Array],
    minimum: int,
    sentence: str,
    only: tuple[str, ...],
) -> Recording:
    recording = without_short(recording, minimum)
    parts = segments(recording.t)
    return recording.mapped(
        lambda values: np.concatenate([function(values[part]) for part in parts]), sentence, only
    )
