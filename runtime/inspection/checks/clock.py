"""Checks of the clock: backward time, repeated states, dropped samples, jitter, holes.

A trouble that the recipe already handles is reported as information, any other as a warning with
the steps of [preparation] that handle it.

Rows may be lost before a log is stamped at a constant rate,

    r_k = Δq_k · v̄_k / (|v̄_k|² Δt)

r is 1 for a row after its predecessor and 2 where one between is lost. v̄ is the mean measured
velocity of both ends, or without one the mean of the neighbouring steps.
"""

from dataclasses import replace

import numpy as np

from runtime.common.tables import significant
from runtime.errors import RecordingError
from runtime.inspection.checks.signals import moving_joints
from runtime.inspection.finding import ERROR, INFO, WARNING, Checked, Finding
from runtime.library import Array, Library, Mask
from runtime.recording import Preparation, Recipe, Recording
from runtime.recording.preprocessing.segments import HOLE, JITTER, repair_clock
from runtime.recording.reader import Raw
from runtime.recording.recipes.recipe import UNITS, Time
from runtime.recording.rest_speeds import rest_speeds

REPEATED = 0.002  # share of rows that may repeat the one before in motion, without a finding
HOLE_S = 0.1  # length [s] from which a pause of more than ten steps is a hole, not dropped samples
BETTER = 0.7  # misfit of Δq = v Δt, rebuilt over logged clock, below which it is proposed
COUNTABLE = 0.15  # misfit of Δq = v Δt on the rebuilt clock below which its ticks are counted
BRIDGED_S = 0.06  # longest interpolated gap where rows are left out [s]: single rows, not bursts
_GAP_STEPS = 10.0
_COUNTS = 5.0  # encoder counts per row above which a repeated value is not its resolution
_NICE = (1.0, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0)
EVEN = 0.05  # largest relative spread of the steps of a clock that counts as made up
MADE_UP = 0.95  # share of such steps from which on the clock counts as made up
LOST, WIDTH = 0.004, 0.2  # share of steps with r = 2 that is reported, and their distance from it
BETWEEN = (1.35, 1.65)  # r of neither case, which noise fills as well
CLEAR = 4.0  # steps with r = 2 over those between, so that noise is excluded
FEWEST_ROWS = 100


def order_of_time(raw: Raw, plan: Recipe) -> Checked:
    """Time stamps that do not increase."""
    if "time" not in raw.values:
        return plan, []
    t = raw.values["time"][:, 0]
    steps = np.diff(t)
    same = np.ones(len(steps), dtype=bool)
    for values in raw.values.values():
        same &= np.all(np.diff(values, axis=0) == 0.0, axis=1)
    backward = np.flatnonzero((steps <= 0) & ~same)
    if not backward.size:
        return plan, []
    unit = UNITS["time"][plan.time.unit] if plan.time else 1.0
    step = float(np.median(steps[steps > 0])) * unit if np.any(steps > 0) else 1.0
    first = int(backward[0])
    sentence = (
        f"time does not increase at {backward.size} rows (first at row {first + 1}: "
        f"{t[first]:.9g}, then {t[first + 1]:.9g}): the file holds several runs, or stamps "
        "of another clock; cut the log into runs, or replace [time] by the proposed rate_hz "
        "if the rows are equally spaced"
    )
    evidence = {"rows": int(backward.size), "first": first + 1, "rate_hz": 1.0 / step}
    findings = [Finding("time_backwards", ERROR, sentence, evidence)]
    return plan.replace(time=Time(rate_hz=1.0 / step)), findings


def clock(recording: Recording, plan: Recipe, raw: Raw, lib: Library) -> Checked:
    """Repeated states, dropped samples, jitter and holes."""
    logged = raw.values["position"]
    original = logged if len(logged) == len(recording) else None
    preparation, findings = _stale(recording, plan, lib, original)
    if not findings:
        findings = [] if preparation.clock_tick is not None else lost_rows(recording)
        preparation = _rebuilt(recording, preparation)[0] if findings else preparation
    elif "skipped_ticks" in (evidence := findings[0].evidence) and (
        evidence["misfit_rebuilt"] < COUNTABLE
    ):  # a rebuilt clock is proposed that fits well enough for its ticks to be counted
        findings += lost_beside_repeats(recording, evidence["count"], evidence["skipped_ticks"])
    constant = plan.time is None or plan.time.rate_hz is not None
    if len(recording) < 10 or (constant and not plan.leave_out):
        return plan.replace(preparation=preparation), findings
    ticking = preparation.clock_tick is not None
    steps = np.diff(recording.t)
    median = float(np.median(steps))
    handled = plan.preparation.max_gap_s is not None
    level = INFO if handled else WARNING
    is_logged = ~_left_out(recording, plan)
    findings += _gaps(recording.t, is_logged, level)
    if not ticking:
        findings += _dropped(steps, is_logged, level) + _jitter(steps, level)
    uniform = float(np.abs(steps / median - 1.0).max()) <= JITTER
    if not uniform and not handled:
        gap = max(4.0 * median, 0.02, BRIDGED_S if plan.leave_out else 0.0)
        if ticking:
            gap = 20.0 * (preparation.clock_tick or 0.0)
        rate = None if ticking else _nice_rate(1.0 / median)
        preparation = replace(preparation, max_gap_s=float(f"{gap:.3g}"), grid_hz=rate)
    return plan.replace(preparation=preparation), findings


def _least_gap(steps: Array) -> float:
    """Step [s] above which the clock has a gap; shorter steps are dropped samples."""
    return max(HOLE_S, _GAP_STEPS * float(np.median(steps)))


def _gaps(t: Array, is_logged: Mask, level: str) -> list[Finding]:
    steps = np.diff(t)
    gaps = np.flatnonzero((steps > _least_gap(steps)) & is_logged)
    if not gaps.size:
        return []
    longest = float(steps[gaps].max())
    places = ", ".join(f"{t[i]:.4g} s" for i in gaps[:4])
    sentence = (
        f"{gaps.size} gaps in the clock, the longest {longest:.3g} s (after {places}); keep "
        "max_gap_s under [preparation] shorter than these, so that no filter or derivative crosses "
        "them"
    )
    evidence = {"count": int(gaps.size), "longest_s": longest}
    return [Finding("holes", level, sentence, evidence)]


def _dropped(steps: Array, is_logged: Mask, level: str) -> list[Finding]:
    median = float(np.median(steps))
    count = int(np.sum((steps > HOLE * median) & (steps <= _least_gap(steps)) & is_logged))
    if not count:
        return []
    sentence = (
        f"{count} of {len(steps)} steps exceed 1.5 times the median of {median:.4g} s: samples "
        "were dropped; set max_gap_s under [preparation] to interpolate them"
    )
    evidence = {"count": count, "share": count / len(steps)}
    return [Finding("dropped_ticks", level, sentence, evidence)]


def _jitter(steps: Array, level: str) -> list[Finding]:
    median = float(np.median(steps))
    spread = np.quantile(steps[steps <= HOLE * median], [0.001, 0.999]) / median
    if max(abs(spread - 1.0)) <= max(10 * JITTER, 0.05):
        return []
    sentence = (
        f"time steps vary from {spread[0] * median:.4g} to {spread[1] * median:.4g} s (99.8 % of "
        f"them) around {median:.4g} s; derivatives need a uniform grid: set max_gap_s and grid_hz "
        "under [preparation]"
    )
    evidence = {"steps_s": [float(s * median) for s in spread], "median_s": median}
    return [Finding("jitter", level, sentence, evidence)]


def _left_out(recording: Recording, plan: Recipe) -> Mask:
    """Steps of time across rows that the recipe leaves out, (N − 1,)."""
    before, after = recording.t[:-1], recording.t[1:]
    across = np.zeros(len(before), dtype=bool)
    for first, last in plan.leave_out:
        across |= (before < first) & (after > last)
    return across


def _rebuilt(
    recording: Recording, preparation: Preparation
) -> tuple[Preparation, float | None, tuple[float, float, int] | None]:
    """The preparation with the rebuilt clock where it fits better, its tick and the fits."""
    tick = _tick(recording)
    fit = None if tick is None else _fit_of_clocks(recording, tick)
    if tick is not None and fit is not None and fit[1] < BETTER * fit[0]:
        preparation = replace(preparation, clock_tick=tick, max_gap_s=20 * tick)
    return preparation, tick, fit


def _stale(
    recording: Recording, plan: Recipe, lib: Library, logged: Array | None
) -> tuple[Preparation, list[Finding]]:
    """States logged twice, and the clock rebuilt from Δq = v Δt where that fits better."""
    preparation = plan.preparation
    same = np.all(np.diff(recording.q, axis=0) == 0.0, axis=1)
    if recording.dq is not None:
        same &= np.all(np.diff(recording.dq, axis=0) == 0.0, axis=1)
        same &= np.any(np.abs(recording.dq[1:]) > rest_speeds(lib), axis=1)
    else:
        # A slow joint repeats its encoder count, and noise at rest may span many counts: only
        # large steps of a moving arm are significant.
        values = recording.q if logged is None else logged
        moved = np.abs(np.diff(values, axis=0))
        around = np.minimum(np.roll(moved, 1, axis=0), np.roll(moved, -1, axis=0))
        same &= np.any(around > _COUNTS * _counts(values)[1:], axis=1)
        same &= moving_joints(recording, lib)[1:].any(axis=1)
    count = int(same.sum())
    if count <= REPEATED * len(same):
        return preparation, []
    share = count / len(same)
    evidence: dict = {"count": count, "share": share}
    if preparation.clock_tick is not None:
        remedy = f"clock_tick = {preparation.clock_tick:g} of the recipe drops them"
        return preparation, [_repeated(INFO, count, share, remedy, evidence)]
    preparation, tick, fit = _rebuilt(recording, preparation)
    remedy = "write clock_tick under [preparation] if the controller's period is known"
    if tick is not None and fit is None:
        remedy = (
            "the logged velocities do not rebuild its clock, so the rows stay; use a low-pass far "
            "below the rate of the log"
        )
    elif tick is not None and fit is not None:
        before, rebuilt, skipped = fit
        evidence |= {"misfit_logged": before, "misfit_rebuilt": rebuilt, "tick_s": tick}
        if preparation.clock_tick is not None:
            evidence["skipped_ticks"] = skipped
            remedy = (
                f"without them, and on a clock rebuilt from Δq = v Δt in ticks of {1e3 * tick:g} "
                f"ms ({skipped} ticks were skipped), velocities explain the steps of q to "
                f"{significant(100 * rebuilt)} % instead of {significant(100 * before)} %; set "
                f"clock_tick = {tick:g} under [preparation]"
            )
    return preparation, [_repeated(WARNING, count, share, remedy, evidence)]


def _repeated(level: str, count: int, share: float, remedy: str, evidence: dict) -> Finding:
    sentence = (
        f"{count} rows ({100 * share:.1f} %) repeat the previous state while the arm moves: the "
        f"logger reads faster than the robot updates its state; {remedy}"
    )
    return Finding("repeated_rows", level, sentence, evidence)


def _counts(q: Array) -> Array:
    """Smallest step of q (N, n) at each row: one encoder count, or the last digit of the file."""
    steps = np.abs(np.diff(q, axis=0))
    least = np.array([column[column > 0].min(initial=np.inf) for column in steps.T])
    scale = 10.0 ** np.floor(np.log10(np.maximum(np.abs(q), 1e-12)))
    for digits in range(3, 10):
        unit = scale * 10.0 ** (1 - digits)
        if np.abs(q / unit - np.round(q / unit)).max() < 1e-5:
            return np.asarray(np.maximum(unit, least))
    return np.broadcast_to(least, q.shape)


def _tick(recording: Recording) -> float | None:
    """Period of the controller [s]: the median step, where it is close to a round number."""
    median = 1.0 / recording.rate_hz
    decade = 10.0 ** np.floor(np.log10(median))
    near = [n * decade for n in _NICE if abs(n * decade / median - 1.0) < 0.1]
    return float(f"{near[0]:.6g}") if near and recording.dq is not None else None


def _fit_of_clocks(recording: Recording, tick: float) -> tuple[float, float, int] | None:
    """‖Δq − v Δt‖ / ‖Δq‖ on the logged and on the rebuilt clock, and the skipped ticks.

    None where the velocities give another duration than the log: of an encoder that differentiates
    on another clock, or of a filter.
    """
    try:
        rebuilt = repair_clock(recording, tick)
    except RecordingError:
        return None
    steps = np.diff(rebuilt.t)
    return _misfit(recording), _misfit(rebuilt), int(np.sum(np.round(steps / tick) - 1))


def _misfit(recording: Recording) -> float:
    """‖Δq − v Δt‖ / ‖Δq‖ with the mean v of both ends of every step."""
    dq = recording.required("dq")
    moved: Array = np.diff(recording.q, axis=0)
    expected = 0.5 * (dq[1:] + dq[:-1]) * np.diff(recording.t)[:, None]
    return float(np.linalg.norm(moved - expected) / max(float(np.linalg.norm(moved)), 1e-300))


def _nice_rate(rate: float) -> float:
    """The rate itself [Hz], or a number of two digits within 2 % of it."""
    rounded = float(f"{rate:.2g}")
    return rounded if abs(rounded / rate - 1.0) < 0.02 else float(f"{rate:.6g}")


def lost_rows(recording: Recording) -> list[Finding]:
    """Steps of q that took two periods by the velocities, on a clock of constant rate."""
    if len(recording) < FEWEST_ROWS:
        return []
    step, even = _even_steps(recording)
    if even.mean() < MADE_UP:
        return []
    ratio, fast = _ratios(recording, step)
    ratio = ratio[fast & even]
    if len(ratio) < FEWEST_ROWS:
        return []
    twice = float(np.mean(np.abs(ratio - 2.0) < WIDTH))
    between = float(np.mean((ratio > BETWEEN[0]) & (ratio < BETWEEN[1])))
    if twice < LOST or twice < CLEAR * between:
        return []
    sentence = (
        f"at {100 * twice:.1f} % of the steps q moves twice as far as its velocity in one "
        f"period of {1e3 * step:.4g} ms, though the stamps are even: rows were lost and the "
        "others stamped at a constant rate, so that velocities, accelerations and the delay "
        "of τ are wrong there; log the clock of the controller, or use clock_tick under "
        "[preparation] where it is proposed"
    )
    evidence = {"share": twice, "share_between": between, "step_s": step}
    return [Finding("restamped", WARNING, sentence, evidence)]


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
    sentence = (
        f"{lost} rows more are missing than repeated ({100 * share:.1f} %), though the stamps "
        "are even: rows were lost and the others stamped at a constant rate; use the rebuilt "
        "clock (clock_tick under [preparation]), or log the clock of the controller"
    )
    return [Finding("restamped", WARNING, sentence, {"share": share, "step_s": step})]


def _even_steps(recording: Recording) -> tuple[float, Mask]:
    """Median step [s], and whether each step is that of a clock of constant rate, (N − 1,)."""
    steps = np.diff(recording.t)
    step = float(np.median(steps))
    return step, np.asarray(np.abs(steps / step - 1.0) < EVEN)


def _ratios(recording: Recording, step: float) -> tuple[Array, Mask]:
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
