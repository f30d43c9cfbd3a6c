"""Rows that were lost before the log was stamped at a constant rate (trap 2).

    r_k = Δq_k · v̄_k / (|v̄_k|² Δt)

r is 1 for a row after its predecessor and 2 where one between is lost. v̄ is the mean measured
velocity of both ends, or without one the mean of the neighbouring steps.
"""

import numpy as np
from numpy.typing import NDArray

from runtime.inspection.finding import WARNING, Finding
from runtime.library import Array
from runtime.recording import Recording

EVEN = 0.05
"""Largest relative spread of the steps of a clock that counts as made up."""
MADE_UP = 0.95
"""Share of such steps from which on the clock counts as made up."""
LOST, WIDTH = 0.004, 0.2
"""Share of the steps with r = 2 that is reported, and their distance from it."""
BETWEEN = (1.35, 1.65)
"""r of neither case, which noise fills as well."""
CLEAR = 4.0
"""Steps with r = 2 over those between, so that noise is excluded."""
FEWEST = 100


def lost_rows(recording: Recording) -> list[Finding]:
    """Steps of q that took two periods by the velocities, on a clock of constant rate."""
    if len(recording) < FEWEST:
        return []
    step, even = _even_steps(recording)
    if even.mean() < MADE_UP:
        return []
    ratio, fast = _ratios(recording, step)
    ratio = ratio[fast & even]
    if len(ratio) < FEWEST:
        return []
    twice = float(np.mean(np.abs(ratio - 2.0) < WIDTH))
    between = float(np.mean((ratio > BETWEEN[0]) & (ratio < BETWEEN[1])))
    if twice < LOST or twice < CLEAR * between:
        return []
    return [
        Finding(
            "restamped",
            WARNING,
            f"at {100 * twice:.1f} % of the steps q moves twice as far as its velocity in one "
            f"period of {1e3 * step:.4g} ms, though the stamps are even: rows were lost and the "
            "others stamped at a constant rate, so that velocities, accelerations and the delay "
            "of τ are wrong there; log the clock of the controller, or use clock_tick under "
            "[preparation] where it is proposed",
            {"share": twice, "share_between": between, "step_s": step},
            trap=2,
        )
    ]


def lost_beside_repeats(recording: Recording, repeated: int, skipped: int) -> list[Finding]:
    """Rows lost from a log that also repeats states.

    A logger at the rate of the robot that is not in step with it repeats as many states as it
    skips. More skipped ticks, under a clock of constant rate, are rows that were lost before it
    was made.
    """
    step, even = _even_steps(recording)
    gaps = np.round(np.diff(recording.t)[~even] / step) - 1.0
    lost = skipped - repeated - int(gaps.clip(0.0).sum())
    share = lost / max(len(recording), 1)
    if even.mean() < MADE_UP or share < LOST:
        return []
    return [
        Finding(
            "restamped",
            WARNING,
            f"{lost} rows more are missing than repeated ({100 * share:.1f} %), though the stamps "
            "are even: rows were lost and the others stamped at a constant rate; use the rebuilt "
            "clock (clock_tick under [preparation]), or log the clock of the controller",
            {"share": share, "step_s": step},
            trap=2,
        )
    ]


def _even_steps(recording: Recording) -> tuple[float, NDArray[np.bool_]]:
    """Median step [s], and whether each step is that of a clock of constant rate, (N − 1,)."""
    steps = np.diff(recording.t)
    step = float(np.median(steps))
    return step, np.asarray(np.abs(steps / step - 1.0) < EVEN)


def _ratios(recording: Recording, step: float) -> tuple[Array, NDArray[np.bool_]]:
    """r of every step, and whether the arm moves fast enough there, (N − 1,) each."""
    moved = np.diff(recording.q, axis=0)
    if recording.dq is not None:
        speed = 0.5 * (recording.dq[1:] + recording.dq[:-1]) * step
    else:
        speed = np.zeros_like(moved)
        speed[1:-1] = 0.5 * (moved[2:] + moved[:-2])
    power = np.sum(speed**2, axis=1)
    fast = power > 0.25 * float(np.mean(power))
    ratio = np.sum(moved * speed, axis=1) / np.where(power > 0, power, np.inf)
    return np.asarray(ratio), fast
