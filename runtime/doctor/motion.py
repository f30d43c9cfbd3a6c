"""Do q, dq and t speak of this robot in rad, rad/s and s?  Units, order and signs of the motion.

Order and sign of dq against the derivative of q come first, because a correlation knows no unit;
then the unit of q by the limits of the joints in their best order; then the units of dq and t:

    s = Δq / ∫ dq dt  =  u_dq u_t / u_q   is 1 in the right units, and another number in each other
"""

import itertools
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from runtime.doctor.finding import ERROR, INFO, WARNING, Finding, joints_told
from runtime.doctor.limits import BEYOND, ROWS, beyond_limits, mismatches
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import slopes_of, unwrap
from runtime.recording.recipe import UNITS, Signal

ALIKE = 0.8
"""Correlation of dq with the derivative of q that speaks for a pair."""
TINY = 0.06
"""Span in rad below which a motion may be degrees taken for radians."""
DOUBT = 0.8
"""Mismatch of τ with gravity above which degrees are not believed, though the limits allow them."""
SLOPE = 0.15
USUAL_RATES = (2.0, 2e4)
_ANGULAR = {"position": ("rad", "deg"), "velocity": ("rad/s", "deg/s", "rpm")}


def velocity_pairs(recording: Recording, plan: Recipe, lib: Library) -> tuple[Recipe, list[Finding]]:
    """Order and sign of dq, by the correlation with the derivative of q."""
    if recording.dq is None or plan.velocity is None or len(recording) < 10:
        return plan, []
    slope = np.gradient(unwrap(recording.q)[0], recording.t, axis=0)
    alike = correlation(_smooth(slope), _smooth(recording.dq))  # (joint of q, column of dq)
    _, order = linear_sum_assignment(-np.abs(alike))
    n = len(order)
    own, best = np.abs(np.diag(alike)), np.abs(alike[np.arange(n), order])
    moved = [j for j in range(n) if order[j] != j and best[j] > ALIKE and own[j] < best[j] / 2]
    findings, changes = [], plan.velocity
    if len(moved) > 1 and sorted(order[moved]) == moved:
        final = np.arange(n)
        final[moved] = order[moved]
        changes = replace(changes, order=_composed(changes, final))
        told = ", ".join(str(k) for k in changes.order)
        findings.append(
            Finding(
                "velocity_order",
                WARNING,
                f"the velocities belong to other joints: the derivative of q is like the columns "
                f"{told} of dq (correlation {best[moved].min():.2f}, as they stand "
                f"{own[moved].max():.2f} at most); set order = [{told}] under [velocity]",
                {"order": list(map(int, changes.order)), "correlation": _list(best)},
                trap=9,
            )
        )
        alike = alike[:, final]
    else:
        final = np.arange(n)
    against = [j for j in range(n) if alike[j, j] < -ALIKE]
    if against:
        sign = np.where(np.isin(np.arange(n), against), -1.0, 1.0)
        changes = replace(changes, sign=tuple(float(s) for s in sign * _signs(changes, n)))
        findings.append(
            Finding(
                "velocity_sign",
                WARNING,
                f"dq runs against the derivative of q at {joints_told(lib.joint_names, against)} "
                f"(correlation {min(alike[j, j] for j in against):.2f}): one of them has the wrong "
                "sign; set sign under [velocity], or under [position] where q turns the wrong way",
                {"joints": against, "correlation": _list(np.diag(alike))},
                trap=3,
            )
        )
    return plan.replace(velocity=changes), findings


def units(recording: Recording, plan: Recipe, lib: Library) -> tuple[Recipe, list[Finding]]:
    """Units of q by the limits, then of dq and t by the slope."""
    findings: list[Finding] = []
    factor = _position_factor(recording.q, lib)
    doubt = ""
    if factor not in {None, 1.0} and recording.tau is not None:
        mismatch = gravity_mismatch(recording.q * factor, recording.tau, lib)
        if mismatch > DOUBT:
            doubt = (
                f" (as degrees they would lie within, but then τ is nothing like the torque of "
                f"gravity, mismatch {mismatch:.2f})"
            )
            factor = None
    if factor is None:
        findings.append(_out_of_reach(recording.q, plan, lib, doubt))
        factor = 1.0
    if abs(factor - 1.0) > 1e-9:
        assert plan.position is not None  # noqa: S101  a plan has one
        plan = plan.replace(position=_rescaled("position", plan.position, factor))
        span = np.ptp(recording.q, axis=0).max()
        findings.append(
            Finding(
                "position_unit",
                ERROR,
                f"positions look like {plan.position.unit}: as they stand they reach "
                f"{np.abs(recording.q).max():.4g} and span {span:.4g}, in {plan.position.unit} "
                "they lie within the limits of the joints; set the unit under [position]",
                {"factor": factor, "reach": float(np.abs(recording.q).max())},
                trap=10,
            )
        )
    if recording.dq is None or plan.velocity is None:
        return plan, findings + _rate_only(recording, plan)
    slopes = slopes_of(recording.replace(q=unwrap(recording.q * factor)[0]))
    if not np.isfinite(slopes).any():
        return plan, findings
    seen = float(np.nanmedian(slopes))
    return _velocity_and_time(seen, slopes, recording, plan, findings)


def _velocity_and_time(
    seen: float, slopes: Array, recording: Recording, plan: Recipe, findings: list[Finding]
) -> tuple[Recipe, list[Finding]]:
    """s = 1 in the right units; the pair of units nearest to the recipe's that makes it so."""
    assert plan.velocity is not None  # noqa: S101  asked for by the caller
    if abs(seen - 1.0) < SLOPE:
        return plan, findings
    clocks = UNITS["time"].values() if plan.time and plan.time.unit else (1.0,)
    own = UNITS["time"][plan.time.unit] if plan.time and plan.time.unit else 1.0
    angular = {1.0, np.pi / 180, 180 / np.pi, np.pi / 30, 30 / np.pi}
    for clock, speed in sorted(
        itertools.product({each / own for each in clocks}, angular),
        key=lambda pair: (pair[0] != 1.0) + (pair[1] != 1.0),
    ):
        rate = recording.rate_hz / clock
        # s carries the units as they were taken: dq and t too large by c and v give s = c v.
        if abs(seen / (clock * speed) - 1.0) < SLOPE and USUAL_RATES[0] <= rate <= USUAL_RATES[1]:
            return _in_units(seen, clock, speed, plan, findings, rate)
    if plan.time is not None and plan.time.rate_hz is not None:
        rate = recording.rate_hz / seen
        time = replace(plan.time, rate_hz=float(f"{rate:.3g}"))
        findings.append(
            Finding(
                "missing_clock",
                WARNING,
                f"the log has no column of time; by Δq = dq Δt its rate is {rate:.4g} Hz; confirm "
                "rate_hz under [time]",
                {"rate_hz": rate},
                trap=2,
            )
        )
        return plan.replace(time=time), findings
    findings.append(
        Finding(
            "velocity_scale",
            WARNING,
            f"Δq/Δt over dq is {seen:.4g} instead of 1 (joint by joint "
            f"{', '.join(f'{s:.3g}' for s in slopes)}), which no unit explains: a gear, a wrong "
            "order or a wrong clock; velocities from q are proposed (derivative = 'position')",
            {"slope": seen, "slopes": _list(slopes)},
            trap=2,
        )
    )
    return plan.replace(preparation=replace(plan.preparation, derivative="position")), findings


def _in_units(
    seen: float, clock: float, speed: float, plan: Recipe, findings: list[Finding], rate: float
) -> tuple[Recipe, list[Finding]]:
    assert plan.velocity is not None  # noqa: S101  asked for by the caller
    if clock != 1.0 and plan.time is not None:
        factor = UNITS["time"][plan.time.unit] * clock
        unit = min(UNITS["time"], key=lambda u: abs(np.log(UNITS["time"][u] / factor)))
        plan = plan.replace(time=replace(plan.time, unit=unit))
        findings.append(
            Finding(
                "time_unit",
                ERROR,
                f"time looks like {unit}: Δq/Δt is {seen:.3g} of dq, and in {unit} the log runs "
                f"at {rate:.4g} Hz; set unit = '{unit}' under [time]",
                {"slope": seen, "rate_hz": rate, "unit": unit},
                trap=2,
            )
        )
    if speed != 1.0 and plan.velocity is not None:
        plan = plan.replace(velocity=_rescaled("velocity", plan.velocity, speed))
        findings.append(
            Finding(
                "velocity_unit",
                ERROR,
                f"velocities look like {plan.velocity.unit}: Δq/Δt is {seen:.3g} of dq; set the "  # type: ignore[union-attr]
                "unit under [velocity]",
                {"slope": seen},
                trap=10,
            )
        )
    return plan, findings


def _rate_only(recording: Recording, plan: Recipe) -> list[Finding]:
    """Without dq the unit of time can only be doubted."""
    given = recording.rate_hz if plan.time and plan.time.unit else USUAL_RATES[0]
    if USUAL_RATES[0] <= given <= USUAL_RATES[1]:
        return []
    told = f"a rate of {recording.rate_hz:.4g} Hz is unusual and there is no dq to measure it by"
    return [
        Finding(
            "time_unit",
            WARNING,
            f"{told}; if time is in ms or µs, set its unit under [time]",
            {"rate_hz": recording.rate_hz},
            trap=2,
        )
    ]


def _position_factor(q: Array, lib: Library) -> float | None:
    """What q is to be multiplied with to lie within the limits, in the best order; None: nothing."""
    span = float(np.ptp(unwrap(q)[0], axis=0).max())
    costs = {factor: _misplaced(q * factor, lib) for factor in (1.0, np.pi / 180, 180 / np.pi)}
    if costs[1.0] <= BEYOND:
        if span < TINY and costs[180 / np.pi] <= BEYOND and span > 0:
            return 180 / np.pi
        return 1.0
    return next((f for f in (np.pi / 180, 180 / np.pi) if costs[f] <= BEYOND), None)


def _misplaced(q: Array, lib: Library) -> float:
    """The largest way beyond a limit, in the order of columns that keeps it smallest."""
    beyond = beyond_limits(q, lib)
    rows, order = linear_sum_assignment(beyond)
    return float(beyond[rows, order].max())


def _out_of_reach(q: Array, plan: Recipe, lib: Library, doubt: str) -> Finding:
    beyond = np.diag(beyond_limits(q, lib))
    worst = int(np.argmax(beyond))
    ratio = np.abs(q).max(axis=0)
    what = (
        "the gear matrix or an offset under [position] is not that of this robot"
        if plan.gear
        else "these may be motor angles, which need the [gear] matrix R of q_motor = R q_joint "
        "(couplings included) and the offset of the zero under [position], both from the "
        "manufacturer; or another robot, or an unknown offset"
    )
    return Finding(
        "position_range",
        ERROR,
        f"positions fit the robot in no unit: {lib.joint_names[worst]} goes {beyond[worst]:.3g} "
        f"beyond its limits, the joints reach {', '.join(f'{x:.3g}' for x in ratio)}{doubt}; {what}",
        {"reach": _list(ratio), "beyond": _list(beyond)},
        trap=6,
    )


def wraps(recording: Recording) -> list[Finding]:
    """Jumps of one turn: the reader has unwrapped them and says so."""
    told = [said for said in recording.history if said.startswith("Unwrapped")]
    return [
        Finding("wrap", INFO, f"{said[:-1]}, as the reader always does; check that they are none "
                "of the robot's own", trap=10)
        for said in told
    ]  # fmt: skip


def gravity_mismatch(q: Array, tau: Array, lib: Library) -> float:
    """E of `runtime.doctor.order` for the joints as they stand."""
    take = np.linspace(0, len(q) - 1, ROWS).astype(int)
    return float(mismatches(q[take], tau[take], np.arange(lib.n_joints)[None], lib)[0])


def correlation(a: Array, b: Array) -> Array:
    """Pearson's correlation of each column of a (N, m) with each of b (N, k), (m, k)."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    size = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)
    return np.asarray(a.T @ b / np.where(size > 0, size, np.inf))


def _smooth(values: Array, width: int = 9) -> Array:
    """Mean over a few rows, for differences of a fine clock."""
    if len(values) < 10 * width:
        return values
    sums = np.cumsum(values, axis=0)
    return np.asarray(sums[width:] - sums[:-width]) / width


def _rescaled(kind: str, signal: Signal, factor: float) -> Signal:
    """The unit whose numbers are `factor` times those of the signal's unit."""
    unit = signal.unit if isinstance(signal.unit, str) else signal.unit[0]
    wanted = UNITS[kind][unit] * factor
    best = min(_ANGULAR[kind], key=lambda u: abs(np.log(UNITS[kind][u] / wanted)))
    return replace(signal, unit=best)


def _composed(signal: Signal, order: Array) -> tuple[int, ...]:
    """`order` applied to the joints as the recipe has them."""
    own = signal.order or tuple(range(len(order)))
    return tuple(int(own[k]) for k in order)


def _signs(signal: Signal, n: int) -> Array:
    return np.broadcast_to(np.asarray(signal.sign, dtype=float), (n,))


def _list(values: Array) -> list[float | None]:
    return [float(x) if np.isfinite(x) else None for x in np.ravel(values)]
