"""Digital filters as second-order sections, with the coefficients and the recursion of SciPy.

Section s filters x by y = b₀ x + z₁, z₁ ← b₁ x − a₁ y + z₂, z₂ ← b₂ x − a₂ y, where its row is
(b₀, b₁, b₂, 1, a₁, a₂).
"""

import numpy as np

from runtime.numerics import Array
from runtime.numerics.extension import extension

_compiled = extension("scipy.signal._sosfilt", ("_sosfilt",))


def butterworth_sections(order: int, cutoff: float) -> Array:
    """Sections of a Butterworth low-pass: `scipy.signal.butter(order, cutoff, output="sos")`.

    The poles of the circle |s| = ω_c are mapped by the bilinear transform with pre-warped ω_c; all
    zeros are −1. The poles nearest the unit circle are in the last section.
    """
    angles = np.pi * np.arange(1 - order, order, 2, dtype=np.float64) / (2 * order)
    analogue = -np.exp(1j * angles) * float(4.0 * np.tan(np.pi * cutoff / 2.0))
    poles = (4.0 + analogue) / (4.0 - analogue)
    gain = float(4.0 * np.tan(np.pi * cutoff / 2.0)) ** order * np.real(1 / np.prod(4.0 - analogue))
    zeros = np.append(-np.ones(order), np.zeros(order % 2))
    # Pairs of conjugates are averaged, because their parts differ by rounding.
    by_real = poles[np.lexsort((np.abs(poles.imag), poles.real))]
    upper, lower = by_real[by_real.imag > _REAL], by_real[by_real.imag < -_REAL]
    pairs = (upper + lower.conj()) / 2
    pairs = pairs[np.argsort(np.abs(1 - np.abs(pairs)), kind="stable")]
    sections = np.zeros(((order + 1) // 2, 6))
    for place, pole in zip(range(len(sections) - 1, -1, -1), pairs, strict=False):
        nearest = np.argsort(np.abs(zeros - pole))[:2]
        sections[place] = _section(zeros[nearest], np.array([pole, pole.conj()]))
        zeros = np.delete(zeros, nearest)
    if order % 2:
        real = by_real[np.abs(by_real.imag) <= _REAL].real[0]
        sections[0] = _section(zeros, np.array([real, 0.0]))
    sections[0, :3] *= gain
    return sections


_REAL = 1e-14
"""Imaginary part up to which a pole is the real one."""


def _section(zeros: Array, poles: Array) -> Array:
    """Coefficients of Π (1 − z_k/z) over Π (1 − p_k/z)."""
    return np.concatenate([np.poly(zeros), np.real(np.poly(poles))])


def steady_state(sections: Array) -> Array:
    """State (s, 2) of every section behind an input that is 1 for ever, `sosfilt_zi`."""
    state, gain = np.empty((len(sections), 2)), 1.0
    for row, (b0, b1, b2, _, a1, a2) in zip(state, sections, strict=True):
        system = np.array([[1.0 + a1, -1.0], [a2, 1.0]])
        row[:] = gain * np.linalg.solve(system, [b1 - a1 * b0, b2 - a2 * b0])
        gain *= (b0 + b1 + b2) / (1.0 + a1 + a2)
    return state


def run_sections(sections: Array, values: Array, state: Array) -> tuple[Array, Array]:
    """Filter columns from a state on, `scipy.signal.sosfilt` along the first axis.

    sections (s, 6), values (N, m), state (s, 2, m) → (N, m).
    """
    if _compiled is None:
        from scipy.signal import sosfilt

        return sosfilt(sections, values, axis=0, zi=state)
    rows = np.array(values.T, dtype=np.float64, order="C")  # filtered in place
    memory = np.array(state.transpose(2, 0, 1), dtype=np.float64, order="C")
    _compiled._sosfilt(np.ascontiguousarray(sections), rows, memory)
    return rows.T, memory.transpose(1, 2, 0)


def both_directions(sections: Array, values: Array, padding: int) -> Array:
    """`scipy.signal.sosfiltfilt(sections, values, axis=0, padlen=padding)`.

    sections (s, 6), values (N, m) → (N, m).
    """
    head = 2 * values[:1] - values[padding:0:-1]
    tail = 2 * values[-1:] - values[-2 : -padding - 2 : -1]
    long = np.concatenate([head, values, tail])
    still = steady_state(sections)[:, :, None]
    forwards, _ = run_sections(sections, long, still * long[0])
    backwards, _ = run_sections(sections, forwards[::-1], still * forwards[-1])
    return backwards[::-1][padding : len(long) - padding]


def response(sections: Array, count: int) -> tuple[Array, Array]:
    """Squared gain |H|² at frequencies spread evenly from 0 to half the rate.

    sections (s, 6) → (count,) [rad per sample].
    """
    frequency = np.linspace(0.0, np.pi, count, endpoint=False)
    delay = np.exp(-1j * frequency[:, None] * np.arange(3))
    above, below = delay @ sections[:, :3].T, delay @ sections[:, 3:].T
    return frequency, np.prod(np.abs(above / below) ** 2, axis=1)
