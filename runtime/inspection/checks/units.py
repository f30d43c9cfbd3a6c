"""In which units are q, dq and t?  By the limits of the joints, and by the slope of q on dq.

s = Δq / ∫ dq dt  =  u_dq u_t / u_q   is 1 in the right units, and another number in each other
"""

import itertools
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from runtime.inspection.checks.order_scores import BEYOND, ROWS, beyond_limits, mismatches
from runtime.inspection.finding import ERROR, WARNING, Finding, numbers
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import slopes_of, unwrap
from runtime.recording.recipes.recipe import UNITS, Signal

TINY = 0.06
"""Span in rad below which a motion may be degrees taken for radians."""
DOUBT = 0.8
"""Mismatch of τ with gravity above which degrees are not believed, though the limits allow them."""
SLOPE = 0.15
FEWEST = 20
"""Rows that a slope needs."""
USUAL_RATES = (2.0, 2e4)
_ANGULAR = {"position": ("rad", "deg"), "velocity": ("rad/s", "deg/s", "rpm")}


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
        position = _rescaled("position", plan.signals()["position"], factor)
        plan = plan.replace(position=position)
        span = np.ptp(recording.q, axis=0).max()
        findings.append(
            Finding(
                "position_unit",
                ERROR,
                f"positions look like {position.unit}: as they stand they reach "
                f"{np.abs(recording.q).max():.4g} and span {span:.4g}, in {position.unit} "
                "they lie within the limits of the joints; set the unit under [position]",
                {"factor": factor, "reach": float(np.abs(recording.q).max())},
                trap=10,
            )
        )
    if recording.dq is None or plan.velocity is None:
        return plan, findings + _rate_only(recording, plan)
    if len(recording) < FEWEST:
        return plan, findings
    slopes = slopes_of(recording.replace(q=unwrap(recording.q * factor)[0]))
    if not np.isfinite(slopes).any():
        return plan, findings
    seen = float(np.nanmedian(slopes))
    return _velocity_and_time(seen, slopes, recording, plan, findings)


def _velocity_and_time(
    seen: float, slopes: Array, recording: Recording, plan: Recipe, findings: list[Finding]
) -> tuple[Recipe, list[Finding]]:
    """s = 1 in the right units; the pair of units nearest to the recipe's that makes it so."""
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
            {"slope": seen, "slopes": numbers(slopes)},
            trap=2,
        )
    )
    return plan.replace(preparation=replace(plan.preparation, derivative="position")), findings


def _in_units(
    seen: float, clock: float, speed: float, plan: Recipe, findings: list[Finding], rate: float
) -> tuple[Recipe, list[Finding]]:
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
    """What q is to be multiplied with to lie within the limits, in the best order, or None."""
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
    told = ", ".join(f"{x:.3g}" for x in np.abs(q).max(axis=0))
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
        f"beyond its limits, the joints reach {told}{doubt}; {what}",
        {"reach": numbers(ratio), "beyond": numbers(beyond)},
        trap=6,
    )


def gravity_mismatch(q: Array, tau: Array, lib: Library) -> float:
    """E of `runtime.inspection.checks.joint_order` for the joints as they stand."""
    take = np.linspace(0, len(q) - 1, ROWS).astype(int)
    return float(mismatches(q[take], tau[take], np.arange(lib.n_joints)[None], lib)[0])


def _rescaled(kind: str, signal: Signal, factor: float) -> Signal:
    """The unit whose numbers are `factor` times those of the signal's unit."""
    unit = signal.unit if isinstance(signal.unit, str) else signal.unit[0]
    wanted = UNITS[kind][unit] * factor
    best = min(_ANGULAR[kind], key=lambda u: abs(np.log(UNITS[kind][u] / wanted)))
    return replace(signal, unit=best)
