"""Checks of the units of q, dq and t, by the limits of the joints and the slope of q on ∫ dq dt.

s = Δq / ∫ dq dt  =  u_dq u_t / u_q   is 1 in the right units
"""

import itertools
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from runtime.estimators.regression.posterior import least_squares
from runtime.inspection.checks.column_faults import BEYOND, ROWS, beyond_limits, mismatches
from runtime.inspection.finding import ERROR, WARNING, Checked, Finding, joint_list, numbers
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import slopes_of, unwrap
from runtime.recording.recipes.recipe import UNITS, Signal

TINY = 0.06  # span [rad] below which the numbers may be radians that were read as degrees
DOUBT = 0.8  # mismatch of τ with gravity above which degrees are rejected though limits allow them
LOADED, DRIVEN, SHOWN, DENSE = 0.5, 0.2, 0.8, 900
"""Of the joints whose gravity torque is this share of the largest one: squared residual of a drive
alone over the variance of τ, up to which drives take nearly all of it (0.02 Z1, 0.11 TX40); squared
residual with gravity over that, below which τ shows gravity nevertheless (0.6 Z1, 0.2 TX40, 0.97
motor angles of a TX40 read as degrees); number of rows."""
MEAN_S = 0.05  # moving mean of positions and torque before they are differentiated [s]
SLOPE = 0.15  # distance of s from 1 that is accepted
FEWEST_ROWS = 20  # rows that a slope needs
USUAL_RATES = (2.0, 2e4)  # rates of loggers, Hz
_ANGULAR = {"position": ("rad", "deg"), "velocity": ("rad/s", "deg/s", "rpm")}


def units(recording: Recording, plan: Recipe, lib: Library) -> Checked:
    """Unit of q by the limits of the joints, then units of dq and t by the slope s."""
    findings: list[Finding] = []
    factor = _position_factor(recording.q, lib)
    doubt = ""
    if factor != 1.0 and _turns(recording, lib):
        factor = 1.0
    if factor not in {None, 1.0} and recording.tau is not None:
        mismatch = gravity_mismatch(recording.q * factor, recording.tau, lib)
        if mismatch > DOUBT and not _shows_gravity(recording, factor, lib):
            doubt = (
                " (degrees would lie within the limits, but then τ does not resemble the gravity "
                f"torque, mismatch {mismatch:.2f})"
            )
            factor = None
    turned = _turned(recording.q, lib) if factor is None and not plan.gear else []
    if turned:
        plan, negated = _with_signs(plan, turned, lib)
        findings.append(negated)
        factor = 1.0
    elif factor is None:
        findings.append(_out_of_reach(recording.q, plan, lib, doubt))
        factor = 1.0
    if abs(factor - 1.0) > 1e-9:
        position = _rescaled("position", plan.signals()["position"], factor)
        plan = plan.replace(position=position)
        span = np.ptp(recording.q, axis=0).max()
        sentence = (
            f"positions look like {position.unit}: in the present unit they reach "
            f"{np.abs(recording.q).max():.4g} and span {span:.4g}, in {position.unit} "
            "they lie within the limits of the joints; set the unit under [position]"
        )
        evidence = {"factor": factor, "reach": float(np.abs(recording.q).max())}
        findings.append(Finding("position_unit", ERROR, sentence, evidence))
    if recording.dq is None or plan.velocity is None:
        return plan, findings + _rate_only(recording, plan)
    if len(recording) < FEWEST_ROWS:
        return plan, findings
    slopes = slopes_of(recording.replace(q=unwrap(recording.q * factor)[0]))
    if not np.isfinite(slopes).any():
        return plan, findings
    return _velocity_and_time(float(np.nanmedian(slopes)), slopes, recording, plan, findings)


def _velocity_and_time(
    seen: float, slopes: Array, recording: Recording, plan: Recipe, findings: list[Finding]
) -> Checked:
    """Pair of units of t and dq, closest to that of the recipe, that makes s = 1."""
    if abs(seen - 1.0) < SLOPE:
        return plan, findings
    clocks = UNITS["time"].values() if plan.time and plan.time.unit else (1.0,)
    present = UNITS["time"][plan.time.unit] if plan.time and plan.time.unit else 1.0
    angular = {1.0, np.pi / 180, 180 / np.pi, np.pi / 30, 30 / np.pi}
    # The products of the pairs differ by 1.8 times or more, so that one pair fits at most.
    for clock, speed in itertools.product({each / present for each in clocks}, angular):
        rate = recording.rate_hz / clock
        # s contains the units in use: t and dq too large by c and v give s = c v.
        if abs(seen / (clock * speed) - 1.0) < SLOPE and USUAL_RATES[0] <= rate <= USUAL_RATES[1]:
            return _in_units(seen, clock, speed, plan, findings, rate)
    if plan.time is not None and plan.time.rate_hz is not None and seen > 0:
        rate = recording.rate_hz / seen
        time = replace(plan.time, rate_hz=float(f"{rate:.3g}"))
        plan = plan.replace(leave_out=_scaled(plan, recording.rate_hz / (time.rate_hz or rate)))
        sentence = (
            f"the log has no column of time; Δq = dq Δt gives a rate of {rate:.4g} Hz; confirm "
            "rate_hz under [time]"
        )
        findings.append(Finding("missing_clock", WARNING, sentence, {"rate_hz": rate}))
        return plan.replace(time=time), findings
    sentence = (
        f"Δq/Δt over dq is {seen:.4g} instead of 1 (joint by joint "
        f"{', '.join(f'{s:.3g}' for s in slopes)}), which no unit explains: check gear, order "
        "and clock; until then take velocities from q (derivative = 'position'), as proposed"
    )
    evidence = {"slope": seen, "slopes": numbers(slopes)}
    findings.append(Finding("velocity_scale", WARNING, sentence, evidence))
    return plan.replace(preparation=replace(plan.preparation, derivative="position")), findings


def _in_units(
    seen: float, clock: float, speed: float, plan: Recipe, findings: list[Finding], rate: float
) -> Checked:
    if clock != 1.0 and plan.time is not None:
        factor = UNITS["time"][plan.time.unit] * clock
        unit = min(UNITS["time"], key=lambda u: abs(np.log(UNITS["time"][u] / factor)))
        leave_out = _scaled(plan, UNITS["time"][unit] / UNITS["time"][plan.time.unit])
        plan = plan.replace(time=replace(plan.time, unit=unit), leave_out=leave_out)
        sentence = (
            f"time looks like {unit}: Δq/Δt is {seen:.3g} of dq, and in {unit} the log runs "
            f"at {rate:.4g} Hz; set unit = '{unit}' under [time]"
        )
        evidence = {"slope": seen, "rate_hz": rate, "unit": unit}
        findings.append(Finding("time_unit", ERROR, sentence, evidence))
    if speed != 1.0 and plan.velocity is not None:
        plan = plan.replace(velocity=_rescaled("velocity", plan.velocity, speed))
        sentence = (
            f"velocities look like {plan.velocity.unit}: Δq/Δt is {seen:.3g} of dq; set the "  # type: ignore[union-attr]
            "unit under [velocity]"
        )
        findings.append(Finding("velocity_unit", ERROR, sentence, {"slope": seen}))
    return plan, findings


def _scaled(plan: Recipe, factor: float) -> tuple[tuple[float, float], ...]:
    """Intervals of the recipe on a clock that runs `factor` times as fast."""
    return tuple((first * factor, last * factor) for first, last in plan.leave_out)


def _rate_only(recording: Recording, plan: Recipe) -> list[Finding]:
    """An unusual rate, which without dq cannot be checked further."""
    given = recording.rate_hz if plan.time and plan.time.unit else USUAL_RATES[0]
    if USUAL_RATES[0] <= given <= USUAL_RATES[1]:
        return []
    rate = f"a rate of {recording.rate_hz:.4g} Hz is unusual, and there is no dq to check it with"
    sentence = f"{rate}; if time is in ms or µs, set its unit under [time]"
    return [Finding("time_unit", WARNING, sentence, {"rate_hz": recording.rate_hz})]


def _position_factor(q: Array, lib: Library) -> float | None:
    """Factor of q that brings it within the limits in the best order; None where there is none."""
    span = float(np.ptp(unwrap(q)[0], axis=0).max())
    costs = {factor: _misplaced(q * factor, lib) for factor in (1.0, np.pi / 180, 180 / np.pi)}
    if costs[1.0] <= BEYOND:
        if span < TINY and costs[180 / np.pi] <= BEYOND and span > 0:
            return 180 / np.pi
        return 1.0
    return next((f for f in (np.pi / 180, 180 / np.pi) if costs[f] <= BEYOND), None)


def _turned(q: Array, lib: Library) -> list[int]:
    """Joints whose negated positions alone lie within the limits, where that helps all of them."""
    beyond = np.diag(beyond_limits(q, lib))
    outside = [int(j) for j in np.flatnonzero(beyond > BEYOND)]
    sign = np.where(beyond > BEYOND, -1.0, 1.0)
    within = bool((np.diag(beyond_limits(q * sign, lib)) <= BEYOND).all())
    # Motor angles are far outside: those of a joint have its range.
    return outside if within and 2 * len(outside) < len(sign) else []


def _with_signs(plan: Recipe, joints: list[int], lib: Library) -> tuple[Recipe, Finding]:
    """The plan with the opposite sign of q and dq of these joints, and its finding."""
    sign = np.where(np.isin(np.arange(lib.n_joints), joints), -1.0, 1.0)
    moved = {k: x for k, x in plan.signals().items() if k in {"position", "velocity"}}
    changes = {kind: each.signed(sign) for kind, each in moved.items()}
    names = joint_list(lib.joint_names, joints)
    sentence = (
        f"position and velocity of {names} have the opposite sign of the model's joint: as they "
        "are they exceed its limits, negated they lie within; correct sign under [position] and "
        "[velocity], or turn the axis in the URDF"
    )
    return plan.replace(**changes), Finding("position_sign", WARNING, sentence, {"joints": joints})


def _turns(recording: Recording, lib: Library) -> bool:
    """Whether endless joints turn often: others keep their limits, τ shows gravity in rad."""
    limits = lib.limits()
    endless = ~(np.isfinite(limits["lower"]) | np.isfinite(limits["upper"]))
    beyond = np.diag(beyond_limits(recording.q, lib))
    if recording.tau is None or not endless.any() or (beyond[~endless] > BEYOND).any():
        return False
    mismatch, other = (
        gravity_mismatch(recording.q * factor, recording.tau, lib) for factor in (1.0, np.pi / 180)
    )
    return mismatch <= min(DOUBT, other)


def _shows_gravity(recording: Recording, factor: float, lib: Library) -> bool:
    """Whether drives take nearly all torque, and gravity explains what they leave."""
    few = slice(None, None, max(1, len(recording) // DENSE))
    q, still = recording.q[few] * factor, np.zeros_like(recording.q[few])
    falls = lib.inverse_dynamics(q, still, still, lib.pi0)
    load = falls.std(axis=0)
    width = max(1, round(MEAN_S * recording.rate_hz))

    def mean(values: Array) -> Array:
        return np.convolve(values, np.ones(width) / width, "same")

    for j in np.flatnonzero(load >= max(LOADED * float(load.max()), 1e-300)):
        dq = mean(np.gradient(recording.q[:, j], recording.t))
        ddq = mean(np.gradient(dq, recording.t))
        sign = np.tanh(dq / max(0.05 * float(np.abs(dq).max()), 1e-300))
        drive = np.column_stack([dq, sign, ddq, np.ones_like(dq)])[few]
        tau = mean(recording.required("tau")[:, j])[few]
        rests = [drive, np.column_stack([drive, falls[:, j]])]
        alone, with_gravity = (float(np.sum(least_squares(x, tau)[1] ** 2)) for x in rests)
        if alone > DRIVEN * len(tau) * float(tau.var()) or with_gravity > SHOWN * alone:
            return False
    return bool(load.any())


def _misplaced(q: Array, lib: Library) -> float:
    """Largest excess over a limit in the order of columns that minimises it [rad, m]."""
    beyond = beyond_limits(q, lib)
    rows, order = linear_sum_assignment(beyond)
    return float(beyond[rows, order].max())


def _out_of_reach(q: Array, plan: Recipe, lib: Library, doubt: str) -> Finding:
    """The finding of positions that no unit brings within the limits."""
    beyond = np.diag(beyond_limits(q, lib))
    worst = int(np.argmax(beyond))
    reach = ", ".join(f"{x:.3g}" for x in np.abs(q).max(axis=0))
    ratio = np.abs(q).max(axis=0)
    what = (
        "correct the gear matrix, or the offset under [position]"
        if plan.gear
        else "these may be motor angles, which need the [gear] matrix R of q_motor = R q_joint "
        "(couplings included) and the offset of the zero under [position], both from the "
        "manufacturer; or the log is of another robot"
    )
    sentence = (
        f"positions exceed the limits in every unit: {lib.joint_names[worst]} by "
        f"{beyond[worst]:.3g}, the joints reach {reach}{doubt}; {what}"
    )
    evidence = {"reach": numbers(ratio), "beyond": numbers(beyond)}
    return Finding("position_range", ERROR, sentence, evidence)


def gravity_mismatch(q: Array, tau: Array, lib: Library) -> float:
    """E of `column_faults.joint_order` in the present order of the joints."""
    take = np.linspace(0, len(q) - 1, ROWS).astype(int)
    return float(mismatches(q[take], tau[take], np.arange(lib.n_joints)[None], lib)[0])


def _rescaled(kind: str, signal: Signal, factor: float) -> Signal:
    """The signal in the unit that is `factor` times its present unit."""
    wanted = UNITS[kind][signal.units[0]] * factor
    best = min(_ANGULAR[kind], key=lambda u: abs(np.log(UNITS[kind][u] / wanted)))
    return replace(signal, unit=best)
