"""Checks of the torque in their order: columns, signs, unit, gravity, delay, fit of the model."""

from dataclasses import replace

from runtime.errors import RuntimeFault
from runtime.inspection.check_run import CheckRun
from runtime.inspection.checks import (
    drives,
    gear_coupling,
    gravity,
    measured_torque,
    model_fit,
    other_model,
    position_columns,
    torque_delay,
    torque_signs,
)
from runtime.inspection.checks.torque_rows import rough
from runtime.inspection.finding import INFO, WARNING, Finding
from runtime.inspection.proposed_preparation import proposed_preparation
from runtime.inspection.regressor_choice import choose_regressor, differentiation_of
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recipe, Recording
from runtime.recording.friction import DRIVE, ROTOR, names_where

_AGAINST_THE_LINKS = (
    position_columns.position_columns,
    torque_signs.torque_order,
    torque_signs.joint_signs,
    torque_signs.scale,
    gravity.gravity,
)
"""Checks of τ that compare it with the torque of the URDF's links."""
_LOWERED = 5
"""Largest number of lower cut-offs that are tried."""


def check_torque(checks: CheckRun, lib: Library, propose: bool) -> None:
    """Order, sign and unit of τ, then its fit to the model."""
    terms = checks.plan.friction or proposed_terms(checks.plan)
    try:
        for check in () if lib.placeholders else _AGAINST_THE_LINKS:
            checks.run_on_torque(check, lib, terms)
        checks.findings += _placeholders(lib)
        preparation = checks.plan.preparation
        if propose and preparation.filter == "none":
            ready, notes = proposed_preparation(
                checks.recording, lib, preparation, checks.plan.split, terms
            )
            checks.plan = checks.plan.replace(preparation=ready)
            checks.findings += notes
        usual = rough(checks.recording, checks.plan.preparation)
        _, failing = choose_regressor(checks.recording, lib, usual)
        checks.findings += [Finding("differentiation", WARNING, each) for each in failing]
        if any(f.kind == "gravity" for f in checks.findings):
            return  # the model of the log is another one
        _check_fit(checks, lib, terms)
    except RuntimeFault as fault:
        sentence = f"the torque could not be checked: {fault}"
        checks.findings.append(Finding("not_judged", WARNING, sentence))


def check_commanded(checks: CheckRun, lib: Library) -> None:
    """Law, delay and drives of a commanded torque; unit, sign and order are those of the law."""
    checks.findings += drives.commanded(checks.recording, checks.plan)
    try:
        if not lib.placeholders:
            terms = drives.friction_of(checks.recording, lib, checks.plan)
            checks.run(lambda r, p: drives.delay(r, lib, p, terms))
            checks.findings += drives.rotor(checks.recording, lib, checks.plan, terms)
            if checks.plan.friction is None:
                checks.plan = checks.plan.replace(friction=terms)
        checks.findings += _placeholders(lib)
        usual = drives.filtered(checks.recording, checks.plan.preparation)
        if checks.plan.preparation.filter == "none":
            usual = replace(usual, cutoff_hz=_harmless_cutoff(checks.recording, lib, usual))
            late = checks.plan.preparation.torque_delay_s
            checks.plan = checks.plan.replace(preparation=replace(usual, torque_delay_s=late))
        _, failing = choose_regressor(checks.recording, lib, usual)
        checks.findings += [Finding("differentiation", WARNING, each) for each in failing]
        checks.findings.append(model_fit.one_run(checks.recording.duration))
    except RuntimeFault as fault:
        sentence = f"the torque could not be checked: {fault}"
        checks.findings.append(Finding("not_judged", WARNING, sentence))


def _placeholders(lib: Library) -> list[Finding]:
    """Note on links without inertials, whose placeholders no torque can be compared with."""
    if not lib.placeholders:
        return []
    sentence = (
        f"{len(lib.placeholders)} links of the URDF have no <inertial> but placeholders "
        f"({', '.join(lib.placeholders[:4])}{', …' if len(lib.placeholders) > 4 else ''}): order, "
        "sign, unit and gravity of τ cannot be compared with such a model and were not checked; "
        "build with --masses, or check them by hand"
    )
    return [Finding("placeholders", INFO, sentence, {"links": list(lib.placeholders)})]


def _harmless_cutoff(recording: Recording, lib: Library, usual: Preparation) -> float | None:
    """Cut-off of the proposal [Hz]: lower than the usual one where that leaves too much noise.

    A lower cut-off takes a part of the motion too, so that the share of noise is computed again.
    """
    tried = usual
    for _ in range(_LOWERED):
        quality = differentiation_of(recording, lib, tried)
        if quality is None or not quality.fails:
            return tried.cutoff_hz
        if quality.harmless_hz >= quality.cutoff_hz:
            break
        # Rounded to two digits, hardly ever up.
        tried = replace(tried, cutoff_hz=float(f"{0.98 * quality.harmless_hz:.2g}"))
    return usual.cutoff_hz


def _check_fit(checks: CheckRun, lib: Library, terms: Friction) -> None:
    """Delay of τ, whether it was measured, and what the model lacks."""
    torque_rows = checks.torque_rows(lib, terms)
    matrix = model_fit.fit_rows(torque_rows)
    tau = checks.recording.required("tau")
    computed = measured_torque.not_measured(torque_rows, matrix, tau)
    gain = [] if computed or not checks.has_gains else other_model.joint_gain(torque_rows, matrix)
    late = (
        []
        if computed or gain
        else torque_delay.delay(torque_rows, matrix, checks.plan, has_gains=checks.has_gains)
    )
    if any(finding.kind == "time_shift" for finding in late):
        shifted = replace(
            checks.plan.preparation, torque_delay_s=float(f"{late[0].evidence['delay_s']:.3g}")
        )
        checks.plan = checks.plan.replace(preparation=shifted)
        torque_rows = checks.torque_rows(lib, terms)
        matrix = model_fit.fit_rows(torque_rows)
        computed = measured_torque.not_measured(torque_rows, matrix, tau)
    strange = model_fit.unexplained(torque_rows, matrix, has_gains=checks.has_gains)
    checks.findings += late + strange + computed
    torque = checks.plan.torque
    guessed = torque is not None and torque.unit == "A" and not checks.plan.gear
    guessed = guessed and any(f.kind == "torque_unit" for f in checks.findings)
    guessed = guessed or not checks.has_gains
    if not strange and not guessed:  # wrong gains look like a tool or a coupling
        checks.findings += gain
        no_tool = bool(gain or lib.placeholders)
        tool = [] if no_tool else model_fit.tool(torque_rows)
        coupled = [] if gain else gear_coupling.coupling(torque_rows, matrix, terms)
        other = [] if no_tool or tool else other_model.other_robot(torque_rows, matrix)
        checks.findings += tool + coupled + other
    checks.findings.append(model_fit.one_run(torque_rows.whole.duration))


def proposed_terms(plan: Recipe) -> Friction:
    """Friction columns to propose, with those of motors where the gear couples them."""
    if plan.law is not None:
        return Friction(DRIVE)
    gear = plan.gear
    coupled = any(x != 0.0 for i, row in enumerate(gear) for j, x in enumerate(row) if i != j)
    motors = (ROTOR.name, *names_where(lambda column: column.of_motors))
    return Friction(columns=(*Friction().columns, *(motors if coupled else ())))
