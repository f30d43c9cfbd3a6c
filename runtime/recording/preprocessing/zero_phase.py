"""Filtering forwards and backwards by matrix products, where only some rows are needed.

A cascade of second-order sections takes L samples u at once from its state x, and then, backwards
in time, their output from its state z (J reverses L rows):

    x⁺ = Φ x + Γ u,   f = O x + T u;      z⁻ = Φ z + ΓJ f,   y = J (O z + TJ f)

With f put in, y costs 4p + L products per row, and nothing for a row that is not needed.
Φ, Γ, O, T are the outputs of `scipy.signal.sosfilt` for unit states and unit samples. Near both
ends sosfilt itself is used, so that the result is that of `scipy.signal.sosfiltfilt` to rounding.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from runtime.recording.preprocessing.sections import both_directions, run_sections, steady_state
from runtime.recording.recording import FloatArray

LENGTH = 64
"""Rows of a block where only some are needed; shorter (`DENSE`) where all are."""
DENSE = 32
TOGETHER = 64
"""Number of blocks whose products stay in the cache."""
_FEW = 8


def zero_phase(
    sections: FloatArray,
    signals: Sequence[FloatArray],
    padding: int,
    rows: NDArray[np.int64],
    period: int = 1,
) -> list[FloatArray]:
    """Selected rows of `sosfiltfilt(sections, signal, axis=0, padlen=padding)` of every signal.

    sections (s, 6), signals (N, m), rows (M,) → (M, m).
    """
    # Blocks whose length is a multiple of the period have the same pattern of needed rows.
    length = DENSE if period == 1 else period * -(-LENGTH // period)
    count = len(signals[0]) // length
    if count < _FEW:
        return [both_directions(sections, x, padding)[rows] for x in signals]
    cut = count * length
    cascade = _Cascade(sections)
    phi, gamma, free, forced = cascade.block(length)
    order, gamma_back = len(phi), gamma[:, ::-1]
    # Both passes are driven by the samples: Γ u forwards, ΓJ T u backwards. All signals share the
    # same products, so that their columns lie side by side.
    blocks = [x[:cut].reshape(count, length, -1) for x in signals]
    into = np.vstack([gamma, gamma_back @ forced])
    driven = np.concatenate([into @ u for u in blocks], axis=2)
    # States forwards at the start of every block, x⁺ = Φ x + Γ u; behind the last block scipy
    # filters the tail and returns the state backwards, z.
    x = _states(phi, driven[:, :order], cascade.entering(signals, padding))
    z, tail = cascade.returning(signals, padding, cut, x[-1])
    # States backwards at the end of every block, z⁻ = Φ z + ΓJ (O x + T u).
    back = driven[:, order:] + (gamma_back @ free) @ x[:-1]
    xz = np.concatenate([x[:-1], _states(phi, back[::-1], z)[-2::-1]], axis=1)

    # Place of each requested row: its block, and its index among the needed rows of a block.
    inner = rows[: np.searchsorted(rows, cut)]
    block, place = np.divmod(inner, length)
    needed = np.flatnonzero(np.bincount(place, minlength=length))
    first = count * len(needed)
    index = np.concatenate(
        [block * len(needed) + np.searchsorted(needed, place), rows[len(inner) :] - cut + first]
    )
    # y = J T J T u + J T J O x + J O z, of the needed rows only.
    taps = (forced @ forced[::-1])[::-1][needed]
    out = np.hstack([(forced @ free[::-1])[::-1], free[::-1]])[needed]
    filtered, column = [], 0
    for u in blocks:
        mine = slice(column, column := column + u.shape[2])
        y = np.empty((first + len(tail), u.shape[2]))
        inside = y[:first].reshape(count, -1, u.shape[2])
        # A few blocks at a time, so that the two products stay in the cache.
        for part in (slice(k, k + TOGETHER) for k in range(0, count, TOGETHER)):
            np.matmul(taps, u[part], out=inside[part])
            inside[part] += out @ xz[part, :, mine]
        y[first:] = tail[:, mine]
        filtered.append(y if len(index) == len(y) else y.take(index, axis=0))
    return filtered


def _states(phi: FloatArray, drive: FloatArray, first: FloatArray) -> FloatArray:
    """x₀ … x_N of x⁺ = Φ x + v, (N + 1, p, m): every other one from the same of Φ² and Φ v + v⁺."""
    count = len(drive)
    states = np.empty((count + 1, *first.shape))
    states[0] = first
    if count < _FEW:
        for j, v in enumerate(drive):
            states[j + 1] = phi @ states[j] + v
        return states
    even = count - count % 2
    v = drive[0:even:2]
    states[0 : even + 1 : 2] = _states(phi @ phi, phi @ v + drive[1:even:2], first)
    states[1:even:2] = phi @ states[0:even:2] + v
    if even < count:
        states[-1] = phi @ states[-2] + drive[-1]
    return states


class _Cascade:
    """Sections with their state as (z₁, (z₁ + z₂)/w), w = |1 − pole|.

    z₁ and z₂ of a slow low-pass all but cancel; their sum over w is as large as they are, and keeps
    the digits that they would lose (Middleton & Goodwin 1986, delta operator).
    """

    def __init__(self, sections: FloatArray) -> None:
        self.sections = sections
        self.slowness = np.sqrt(1.0 + sections[:, 4] + sections[:, 5])[:, None]
        self.still = steady_state(sections)[:, :, None]

    def block(self, length: int) -> tuple[FloatArray, ...]:
        """Φ (p, p), Γ (p, L), O (L, p) and T (L, L) of L samples."""
        order = 2 * len(self.sections)
        free, phi = self._run(np.zeros((length, order)), self._plain(np.eye(order)))
        silent = np.zeros((len(self.sections), 2, length))
        forced, gamma = self._run(np.eye(length), silent)
        return phi, gamma, free, forced

    def entering(self, signals: Sequence[FloatArray], padding: int) -> FloatArray:
        """The state forwards behind the odd extension of the beginning, (p, m)."""
        head = np.hstack([2 * x[0] - x[padding:0:-1] for x in signals])
        return self._run(head, self.still * head[0])[1]

    def returning(
        self, signals: Sequence[FloatArray], padding: int, cut: int, state: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The state backwards at row `cut`, where it is `state` forwards, and the rows behind."""
        tail = np.hstack(
            [np.vstack([x[cut:], 2 * x[-1] - x[-2 : -padding - 2 : -1]]) for x in signals]
        )
        forwards, _ = self._run(tail, self._plain(state))
        backwards, state = self._run(forwards[::-1], self.still * forwards[-1])
        return state, backwards[: padding - 1 : -1]

    def _run(self, values: FloatArray, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter values (N, m); return the output and the state after them."""
        out, end = run_sections(self.sections, values, start)
        state = np.stack([end[:, 0], (end[:, 0] + end[:, 1]) / self.slowness], axis=1)
        return out, state.reshape(-1, values.shape[1])

    def _plain(self, state: FloatArray) -> FloatArray:
        """z₁, z₂ of every section, as scipy has them, (s, 2, m)."""
        pairs = state.reshape(len(self.sections), 2, -1)
        return np.stack([pairs[:, 0], self.slowness * pairs[:, 1] - pairs[:, 0]], axis=1)
