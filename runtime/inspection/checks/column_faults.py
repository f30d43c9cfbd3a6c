"""Columns of q, dq and τ that belong to another joint or have the opposite sign.

The faults are compared in `runtime.estimators.column_faults`; this check corrects the plan, and
states which signs and exchanges the log does not show.
"""

from dataclasses import replace

import numpy as np

from runtime.common.tables import significant
from runtime.estimators import column_faults as faults
from runtime.estimators.column_faults import ColumnFault, ColumnFaults
from runtime.inspection.checks.torque_rows import TorqueRows
from runtime.inspection.finding import INFO, WARNING, Finding, joint_list, numbers
from runtime.library import Array
from runtime.recording import Recipe
from runtime.recording.recipes.recipe import Signal


def column_faults(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """Sign and order of the columns, by the torque of the URDF and by friction, which brakes."""
    lib = torque_rows.lib
    seen = faults.column_faults(lib, torque_rows.samples)
    findings = []
    for fault, rivals in zip(seen.named, seen.rivals, strict=True):
        findings.append(_finding(fault, rivals, seen, lib.joint_names))
        if fault.kind in {faults.REVERSED, faults.GRAVITY}:
            break  # the check of gravity decides between the two
        if plan.law is None and plan.torque is not None and not plan.gear:
            plan = _corrected(plan, fault)
    return plan, findings + _hidden(seen, lib.joint_names)


def _finding(
    fault: ColumnFault, rivals: tuple[ColumnFault, ...], seen: ColumnFaults, names: tuple[str, ...]
) -> Finding:
    """The finding of one fault, with others that explain nearly as much."""
    before, after = (np.nanmean(left[list(fault.joints)]) for left in seen.left)
    other = "".join(f", or else {each.sentence(names)}" for each in rivals)
    columns = ", ".join(map(str, fault.order))
    remedy = {
        faults.TORQUE_SIGN: "correct sign under [torque]",
        faults.POSITION_SIGN: "correct sign under [position] and [velocity], or turn the axis in "
        "the URDF",
        faults.BOTH_SIGN: "correct sign under [position], [velocity] and [torque], or turn the "
        "axis in the URDF",
        faults.TORQUE_ORDER: f"set order = [{columns}] under [torque]",
        faults.POSITION_ORDER: f"set order = [{columns}] under [position] and [velocity]",
        faults.REVERSED: "set sign = -1 under [torque]",
        faults.GRAVITY: "build the robot with the gravity of its mount",
    }[fault.kind]
    evidence = {
        "joints": list(fault.joints),
        "evidence": fault.evidence,
        "unexplained_as_is": numbers(seen.left[0]),
        "unexplained": numbers(seen.left[1]),
        "rivals": [each.kind for each in rivals],
    }
    if fault.kind in {faults.REVERSED, faults.GRAVITY}:
        evidence["common"] = True
    if fault.order != tuple(range(len(fault.order))):
        evidence["order"] = list(fault.order)
    return Finding(
        {faults.REVERSED: faults.TORQUE_SIGN}.get(fault.kind, fault.kind),
        WARNING,
        f"{fault.sentence(names)}{other}: the model with friction that brakes leaves "
        f"{significant(100 * before)} % of the squared torque of these joints unexplained, so "
        f"corrected {significant(100 * after)} %; compare with the logger, and {remedy}",
        evidence,
    )


def _hidden(seen: ColumnFaults, names: tuple[str, ...]) -> list[Finding]:
    """Signs and exchanges of which this log has no trace."""
    n = len(names)
    unexplained = [j for j in range(n) if seen.left[1][j] > faults.GOOD]
    resting = [j for j in range(n) if np.isnan(seen.left[1][j])]
    hidden = [each for each in seen.hidden if not {*unexplained, *resting} & set(each.joints)]
    signs = {
        each.joints[0] for each in hidden if each.kind in {faults.TORQUE_SIGN, faults.POSITION_SIGN}
    }
    kinds = {faults.TORQUE_ORDER, faults.POSITION_ORDER}
    pairs = sorted({each.joints for each in hidden if each.kind in kinds})
    whole = [each.kind for each in seen.hidden if each.kind in {faults.REVERSED, faults.GRAVITY}]
    parts = []
    if resting:
        parts.append(f"signs and order of {joint_list(names, resting)}, which rest or have no τ")
    if unexplained:
        shares = ", ".join(f"{100 * seen.left[1][j]:.0f} %" for j in unexplained)
        parts.append(
            f"signs and order of {joint_list(names, unexplained)}, of whose squared torque "
            f"model and friction leave {shares}"
        )
    if signs:
        parts.append(f"the sign of {joint_list(names, sorted(signs))}")
    if pairs:
        listed = ", ".join("/".join(names[j] for j in pair) for pair in pairs)
        parts.append(f"an exchange of {listed}, which move or load alike")
    if faults.GRAVITY in whole:
        parts.append("the direction of gravity")
    if faults.REVERSED in whole:
        parts.append("a common sign of all torques")
    if not parts:
        return []
    return [
        Finding(
            "hidden_faults",
            INFO,
            f"this log does not show {'; '.join(parts)}: check them by hand, or record a motion in "
            "which every joint moves by itself",
            {
                "resting": resting,
                "unexplained": unexplained,
                "signs": sorted(int(j) for j in signs),
                "pairs": [list(pair) for pair in pairs],
                "whole": whole,
            },
        )
    ]


def _corrected(plan: Recipe, fault: ColumnFault) -> Recipe:
    """The plan that undoes a fault."""
    sign = np.ones(len(fault.order))
    if fault.kind in {faults.TORQUE_SIGN, faults.POSITION_SIGN, faults.BOTH_SIGN}:
        sign[list(fault.joints)] = -1.0
    of_torque = {faults.TORQUE_SIGN, faults.TORQUE_ORDER}
    changes = {
        kind: _changed(each, sign, fault.order)
        for kind, each in plan.signals().items()
        if fault.kind == faults.BOTH_SIGN or (kind == "torque") == (fault.kind in of_torque)
    }
    return plan.replace(**changes)


def _changed(signal: Signal, sign: Array, order: tuple[int, ...]) -> Signal:
    """The signal with other signs and order; offsets are added after the sign and change theirs."""
    if order != tuple(range(len(order))):
        base = signal.order or tuple(range(len(order)))
        return replace(signal, order=tuple(int(base[k]) for k in order))
    present = np.broadcast_to(np.asarray(signal.sign, dtype=float), sign.shape)
    offset = np.broadcast_to(np.asarray(signal.offset, dtype=float), sign.shape) * sign
    return replace(
        signal,
        sign=tuple(float(x) for x in present * sign),
        offset=tuple(float(x) for x in offset) if offset.any() else 0.0,
    )
