"""The clock of a log: its repair, holes, and the steps that depend on them.

A hole is a gap longer than 1.5 median steps of time. `segments` is its only definition; filters and
derivatives stay inside one segment. Derivatives, resampling, trimming, rest and decimation follow.

The clock of a log that repeats states and skips ticks is repaired from dq = v · dt,

    k_i = round( Σ_j v_ij Δq_ij / (tick · Σ_j v_ij²) ),  v = mean of dq at both ends,  k_i ≥ 1

the least-squares number of ticks between two retained rows. Where the robot is too slow for this
estimate, the logged time decides.
"""

import itertools
from collections.abc import Sequence

import numpy as np
from scipy.special import i0

from runtime.errors import RecordingError
from runtime.library import Array, Integers, Mask
from runtime.recording import Preparation, Recording
from runtime.recording.recording import require_recording
from runtime.recording.rest_speeds import shown_rest_speed

SLOW = 0.1
MAX_DRIFT = 0.15
"""Largest change of the duration: a log that lost a tenth of its rows and was stamped at a constant
rate is repaired; wrong units differ by factors, and a wrong tick by its whole error."""


def repair_clock(recording: Recording, tick: float, slow: float = SLOW) -> Recording:
    """Drop rows that repeat the previous state and count the ticks between the others.

    A row repeats when no joint has another q than in the row before: the state is stale, even if a
    new τ was logged with it. Rows of a robot at rest are dropped too; their ticks are counted by
    the logged time.
    """
    if recording.dq is None:
        raise RecordingError(
            "the clock is rebuilt from dq, but there is none; leave clock_tick out"
        )
    fresh = np.concatenate([[True], np.any(np.diff(recording.q, axis=0) != 0.0, axis=1)])
    count = int(np.sum(~fresh))
    remaining = recording.take(
        fresh, f"Dropped {count} rows that repeat the positions before them."
    )
    if len(remaining) < 2:
        raise RecordingError(
            "the robot never moves, so its clock cannot be rebuilt; leave clock_tick out"
        )
    ticks = _ticks(remaining.t, remaining.q, recording.dq[fresh], tick, slow)
    t = remaining.t[0] + tick * np.concatenate([[0], np.cumsum(ticks)])
    duration, logged = float(t[-1] - t[0]), remaining.duration
    if abs(duration - logged) > MAX_DRIFT * logged:
        raise RecordingError(
            f"the clock rebuilt from dq runs {duration:.4g} s, but the log {logged:.4g} s; "
            "check the units of dq and t, and the tick"
        )
    return remaining.replace(t=t).noted(
        f"Rebuilt the clock in ticks of {tick:g} s from dq = v·dt: {duration:.6g} s "
        f"({logged:.6g} s by the log), {int(np.sum(ticks - 1))} ticks were skipped."
    )


def _ticks(t: Array, q: Array, dq: Array, tick: float, slow: float) -> Integers:
    """Whole ticks (N−1,) between rows, at least one each."""
    v = 0.5 * (dq[1:] + dq[:-1])
    square = np.sum(v * v, axis=1)
    still = square <= slow * slow
    estimate = np.sum(v * np.diff(q, axis=0), axis=1) / np.where(still, 1.0, tick * square)
    ticks = np.maximum(np.round(estimate), 1.0).astype(np.int64)
    for first, last in runs(still):
        ends = np.round((t[first + 1 : last + 1] - t[first]) / tick).astype(np.int64)
        spent = 0
        for i, end in enumerate(ends, start=first):
            ticks[i] = max(int(end) - spent, 1)
            spent += int(ticks[i])
    return ticks


HOLE = 1.5
JITTER = 0.01


def holes(t: Array) -> Mask:
    """Mask (N − 1,) of the steps of t (N,) that are holes."""
    steps = np.diff(t)
    if not steps.size or steps.max() <= HOLE * steps.min():  # nor of their median
        return np.zeros(steps.shape, dtype=bool)
    return np.asarray(steps > HOLE * np.median(steps))


def segments(t: Array) -> list[slice]:
    """Parts of t (N,) without a hole, in order; together they hold every sample."""
    return _between(holes(t))


PAUSE = 10.0  # time between two logs on the common clock [s]: longer than any interpolated gap


def on_one_clock(clocks: Sequence[Array]) -> Array:
    """Instants of several logs one after the other, `PAUSE` apart."""
    parts, start = [], 0.0
    for t in clocks:
        parts.append(t - t[0] + start)
        start = float(parts[-1][-1]) + PAUSE
    return np.concatenate(parts)


def rate_of(t: Array, values: Array) -> Array:
    """Derivative of values (N, n) by t within every part, 0 in parts of one row."""
    rate = np.zeros_like(values)
    for part in segments(t):
        if part.stop - part.start > 1:
            rate[part] = np.gradient(values[part], t[part], axis=0)
    return rate


def runs(mask: Mask) -> list[tuple[int, int]]:
    """Runs of True as (first, one past the last)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def uniform_step(recording: Recording, purpose: str) -> float:
    """Time step of a recording whose segments are uniform to 1 %."""
    step = 1.0 / recording.rate_hz
    steps = np.diff(recording.t)
    ends = np.array([steps.min(), steps.max()])
    if ends[1] <= HOLE * step and float(np.abs(ends / step - 1.0).max()) <= JITTER:
        return step  # without a hole the shortest and the longest step decide
    inside = steps <= HOLE * step
    if float(np.abs(steps / step - 1.0).max(where=inside, initial=0.0)) > JITTER:
        raise RecordingError(
            f"a uniform clock is needed to {purpose}, but the steps go from "
            f"{steps[inside].min():.4g} to {steps[inside].max():.4g} s; set max_gap_s to resample "
            "first"
        )
    return step


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


def differentiate(recording: Recording, from_position: bool = False) -> Recording:
    """Fill in dq from q and ddq from dq by central differences, without a filter.

    Args:
        recording: a log with q; gaps of its clock split it.
        from_position: replace measured dq and ddq, too.

    Returns:
        The recording with dq [rad/s, m/s] and ddq [rad/s², m/s²].

    Raises:
        RecordingError: no part of three rows.
    """
    require_recording(recording)
    result = recording
    for base, key in (("q", "dq"), ("dq", "ddq")):
        if from_position or getattr(recording, key) is None:
            result = without_short(result, 3)
            derived = result.replace(**{key: slopes(result.t, result.required(base))})
            result = derived.noted(f"Differentiated {base} to {key} by central differences.")
    return result


def slopes(t: Array, values: Array) -> Array:
    """Derivative (N, m) by the parabola through three neighbours, at an edge shifted inwards."""
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
    slope = np.empty_like(values, order="C")
    for k, column in enumerate(values.T):  # one by one, so that the differences stay small
        here = column[centre]
        slope[:, k] = left * (column[centre - 1] - here) + right * (column[centre + 1] - here)
    return slope


def resample(recording: Recording, rate_hz: float, max_gap_s: float) -> Recording:
    """All signals on the grid t0 + i / rate, linear between samples; longer gaps stay holes.

    Linear because logged stamps may lie close together, where a spline would magnify noise. A clock
    that equals this grid to rounding stays as it is.
    """
    if not max_gap_s * rate_hz > HOLE:
        raise RecordingError(
            f"max_gap_s expects more than 1.5 steps of the {rate_hz:g} Hz grid, got "
            f"{max_gap_s:g} s; enlarge it"
        )
    t, start = recording.t, recording.t[0]
    if _is_grid(t, rate_hz):
        return recording.noted(_resampled(rate_hz, len(t), 0, max_gap_s, 0))
    parts = _between(np.diff(t) > max_gap_s)
    small = 1e-9 * max(1.0, float(np.abs(t).max()) * rate_hz)
    ticks = [
        np.arange(
            np.ceil((t[part][0] - start) * rate_hz - small),
            np.floor((t[part][-1] - start) * rate_hz + small) + 1,
        )
        for part in parts
    ]
    grids = [start + tick / rate_hz for tick in ticks]
    grid = np.concatenate(grids)
    if not grid.size:
        raise RecordingError(f"no grid point of {rate_hz:g} Hz lies in the data; raise the rate")

    def interpolated(values: Array) -> Array:
        flat = values.reshape(len(t), -1)
        pieces = [
            np.stack([np.interp(points, t[part], column[part]) for column in flat.T], axis=1)
            for points, part in zip(grids, parts, strict=True)
        ]
        return np.concatenate(pieces).reshape(len(grid), *values.shape[1:])

    filled = int(np.sum((np.diff(t) * rate_hz > HOLE) & (np.diff(t) <= max_gap_s)))
    sentence = _resampled(rate_hz, len(grid), filled, max_gap_s, len(parts) - 1)
    return recording.mapped(interpolated, sentence, t=grid)


def _is_grid(t: Array, rate_hz: float) -> bool:
    """Whether t is uniform and of this rate, to the rounding of t and of one step."""
    if len(t) < 2:
        return False
    digits = 4.0 * np.finfo(float).eps * float(np.abs(t).max())
    step = float(t[-1] - t[0]) / (len(t) - 1)
    same_rate = abs(step * rate_hz - 1.0) * step <= digits
    return bool(same_rate and np.all(np.abs(t[0] + step * np.arange(len(t)) - t) <= digits))


def _resampled(rate_hz: float, count: int, filled: int, max_gap_s: float, left: int) -> str:
    return (
        f"Resampled to {rate_hz:g} Hz ({count} samples): {filled} gaps up to {max_gap_s:g} s "
        f"interpolated, {left} longer ones kept."
    )


def advance_torque(recording: Recording, delay_s: float | tuple[float, ...]) -> Recording:
    """Compensate a delay δ: τ(t) ← τ_log(t + δ), linear between samples, within each segment."""
    if recording.tau is None:
        raise RecordingError("torque_delay_s expects τ, but there is none; leave it out")
    n = recording.n_joints
    delays = np.atleast_1d(np.asarray(delay_s, dtype=np.float64))
    if len(delays) not in {1, n}:
        raise RecordingError(
            f"torque_delay_s expects one number or {n}, got {len(delays)}; give one per joint"
        )
    each = np.broadcast_to(delays, (n,))
    t = recording.t
    advanced, keep = np.array(recording.tau), np.zeros(len(t), dtype=bool)
    slack = 1e-9
    for part in segments(t):
        logged = t[part]
        advanced[part] = np.stack(
            [
                np.interp(logged + delay, logged, row)
                for row, delay in zip(recording.tau[part].T, each, strict=True)
            ],
            axis=1,
        )
        first, last = logged[0] - delays.min(), logged[-1] - delays.max()
        keep[part] = (logged >= first - slack) & (logged <= last + slack)
    shown = ", ".join(f"{1e3 * delay:.3g}" for delay in delays)
    return recording.replace(tau=advanced).take(
        keep, f"Advanced τ by {shown} ms, its delay behind q ({keep.sum()} rows left)."
    )


def on_grid(recording: Recording, preparation: Preparation) -> Recording:
    """Apply clock, grid and delay of a preparation, without its filter."""
    data = recording
    if preparation.clock_tick is not None:
        data = repair_clock(data, preparation.clock_tick)
    if preparation.max_gap_s is not None:
        # As stated, else one instant per tick, else the median rate.
        tick = preparation.clock_tick
        rate = preparation.grid_hz or (data.rate_hz if tick is None else 1.0 / tick)
        data = resample(data, rate, preparation.max_gap_s)
    if preparation.torque_delay_s is not None:
        data = advance_torque(data, preparation.torque_delay_s)
    return data


def trim(recording: Recording, seconds: float) -> Recording:
    """The recording without both ends of every segment, where filters see samples on one side."""
    t = recording.t
    keep = np.zeros(len(t), dtype=bool)
    slack = 1e-9
    for part in segments(t):
        first, last = t[part][0] + seconds - slack, t[part][-1] - seconds + slack
        keep[part] = (t[part] >= first) & (t[part] <= last)
    return recording.take(
        keep, f"Trimmed {seconds:g} s at both ends of every segment ({int(keep.sum())} rows left)."
    )


def drop_rest(recording: Recording, speed: float | tuple[float, ...]) -> Recording:
    """Drop rows in which every |dq| < speed: friction at rest is not determined."""
    if recording.dq is None:
        raise RecordingError(
            "dq is needed to drop rows at rest, but there is none; differentiate q first"
        )
    n = recording.dq.shape[1]
    if np.size(speed) not in {1, n}:
        raise RecordingError(
            f"rest_speed expects one number or {n}, got {np.size(speed)}; give one per joint"
        )
    moving = np.any(np.abs(recording.dq) >= speed, axis=1)
    count = int(np.sum(~moving))
    slides = isinstance(speed, tuple)
    shown = f"{shown_rest_speed(speed)} {'rad/s or m/s' if slides else 'rad/s'}"
    return recording.take(moving, f"Dropped {count} rows at rest (every joint below {shown}).")


def decimate(recording: Recording, rate_hz: float) -> Recording:
    """Every k-th instant of one clock after a low-pass; for other ratios linear interpolation."""
    step = uniform_step(recording, "decimate")
    ratio = 1.0 / (step * rate_hz)
    k = round(ratio)
    if ratio < 1.0 - JITTER:
        raise RecordingError(
            f"decimation needs a rate of {1.0 / step:g} Hz or less, got {rate_hz:g} Hz; lower it"
        )
    if abs(ratio - k) > 1e-3 * k:
        return resample(recording, rate_hz, HOLE / rate_hz * 1.01)
    instants = np.round((recording.t - recording.t[0]) / step).astype(np.int64)
    keep = instants % k == 0
    count = int(keep.sum())
    return recording.take(keep, f"Kept every {k}. instant ({rate_hz:g} Hz, {count} rows).")


def _between(hole: Mask) -> list[slice]:
    """Parts between the holes of N − 1 steps."""
    edges = [0, *map(int, np.flatnonzero(hole) + 1), len(hole) + 1]
    return [slice(a, b) for a, b in itertools.pairwise(edges)]


HALF = 8  # rows on each side

EVEN = 1e-10  # scatter of the places between two rows that is rounding, in steps
SHAPE = 6.0  # Kaiser parameter: keeps the power of noise up to 0.8 of Nyquist's to 0.1 %


def interpolate(at: Array, t: Array, values: Array) -> Array:
    """Signals at other times, by a windowed sinc over the rows around them.

    Of a uniform clock and a common delay all instants lie equally between two rows, so that they
    share their weights.

    at (M,) [s], t (N,) [s], values (N, n) → (M, n).
    """
    row = np.interp(at, t, np.arange(len(t), dtype=float))
    first = np.floor(row + EVEN).astype(np.int64)
    share = row - first
    if share.size and np.ptp(share) <= EVEN:
        share = share[:1]
    offsets = np.arange(1 - HALF, HALF + 1)
    distance = share[:, None] - offsets
    inside = np.clip(1.0 - (distance / HALF) ** 2, 0.0, None)
    weights = np.sinc(distance) * i0(SHAPE * np.sqrt(inside))
    weights /= weights.sum(axis=1, keepdims=True)
    rows = np.clip(first[:, None] + offsets, 0, len(t) - 1)
    around = values[rows]
    if len(weights) < len(rows):
        return np.asarray(np.einsum("k,mkn->mn", weights[0], around))
    return np.asarray(np.einsum("mk,mkn->mn", weights, around))
