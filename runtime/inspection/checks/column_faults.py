"""Columns of q, dq and τ that belong to another joint or have the opposite sign.

The order of all joints is checked by their limits and the gravity torque,

    E(P) = (1 − c²)^½,  c the cosine between τ_P and the model's gravity torque at q_P

over the permutations P that keep the joints within their limits. E needs neither units nor signs.
"""

import itertools
from math import factorial

import numpy as np

from runtime.common.tables import significant
from runtime.estimators import column_faults as faults
from runtime.estimators.column_faults import ColumnFault, ColumnFaults
from runtime.estimators.regression.posterior import least_squares
from runtime.inspection.checks.torque_rows import TorqueRows
from runtime.inspection.finding import INFO, WARNING, Checked, Finding, joint_list, numbers
from runtime.library import Array, Integers, Library
from runtime.recording import Recipe, Recording

MOST_ORDERS = 5040  # largest number of permutations that are all tried
GOOD, BETTER = 0.5, 0.6
"""E below which an order fits, and E of the best order over that of the present one below which
the order is changed."""
BEYOND = 0.2  # distance beyond a limit [rad or m] that is accepted: offsets and soft limits
ALIKE = 0.05  # difference of E that decides nothing: wrist joints carry little gravity torque
ROWS = 60  # number of rows that E is computed on


def joint_order(recording: Recording, plan: Recipe, lib: Library) -> Checked:
    """Order of the joints that fits limits and gravity torque much better than the present one."""
    n = lib.n_joints
    beyond = beyond_limits(recording.q, lib)
    fits = float(np.diag(beyond).max()) <= BEYOND
    take = np.linspace(0, len(recording) - 1, ROWS).astype(int)
    if recording.tau is None:
        return plan, []
    q, tau = recording.q[take], recording.tau[take]
    stands = mismatches(q, tau, np.arange(n)[None], lib)[0]
    if fits and stands < GOOD:
        return plan, []
    orders = np.array([p for p in _orders(n) if beyond[p, np.arange(n)].max() <= BEYOND])
    if not len(orders):
        return plan, []
    errors = mismatches(q, tau, orders, lib)
    # Joints along gravity carry none of it: of orders that fit alike the one that moves fewest.
    near = np.flatnonzero(errors <= errors.min() + ALIKE)
    chosen = near[np.argmin(np.sum(orders[near] != np.arange(n), axis=1))]
    best, least = orders[chosen], float(errors[chosen])
    same = np.array_equal(best, np.arange(n))
    if same or least > GOOD or (fits and least > BETTER * stands):
        return plan, []
    columns = ", ".join(map(str, best))
    reason = (
        "the present order exceeds the limits" if not fits else f"{stands:.2f} in the present order"
    )
    changes = {kind: signal.reordered(best) for kind, signal in plan.signals().items()}
    sentence = (
        f"the joints are in another order than in the model: with the columns {columns} "
        f"(counted from 0) limits and gravity torque fit (mismatch {least:.2f}; {reason}); "
        f"compare with the logger and set order = [{columns}] for every signal"
    )
    evidence = {"order": best.tolist(), "mismatch": least, "mismatch_as_is": float(stands)}
    return plan.replace(**changes), [Finding("joint_order", WARNING, sentence, evidence)]


def _orders(n: int) -> itertools.chain | itertools.permutations:
    """All permutations of few joints; cyclic shifts, reversal and exchanges of many."""
    if factorial(n) <= MOST_ORDERS:
        return itertools.permutations(range(n))
    base = list(range(n))
    shifted = (tuple(base[k:] + base[:k]) for k in range(n))
    pairs = itertools.combinations(range(n), 2)
    swapped = (tuple(b if k == a else a if k == b else k for k in base) for a, b in pairs)
    return itertools.chain(shifted, [tuple(reversed(base))], swapped)


def beyond_limits(q: Array, lib: Library) -> Array:
    """Distance of each column of q (N, n) beyond the limits of each joint, (columns, joints)."""
    limits = lib.limits()
    low, high = q.min(axis=0)[:, None], q.max(axis=0)[:, None]
    upper = np.where(np.isfinite(limits["upper"]), limits["upper"], 4 * np.pi)
    lower = np.where(np.isfinite(limits["lower"]), limits["lower"], -4 * np.pi)
    return np.asarray(np.maximum(np.maximum(lower - low, high - upper), 0.0))


def mismatches(q: Array, tau: Array, orders: Integers, lib: Library) -> Array:
    """E (P,) of several orders (P, n) of the joints."""
    placed = np.moveaxis(q[:, orders], 1, 0)  # (P, N, n)
    still = np.zeros_like(placed).reshape(-1, lib.n_joints)
    gravity = lib.inverse_dynamics(placed.reshape(still.shape), still, still, lib.pi0)
    measured = np.moveaxis(tau[:, orders], 1, 0).reshape(len(orders), -1)
    if lib.manifest.springs or "known_torque" in lib.manifest.kernels:
        places = placed.reshape(still.shape)
        static = gravity + lib.known_torque(places)
        return _with_springs(measured, static, lib.spring_columns(places))
    model = gravity.reshape(len(orders), -1)
    size = np.linalg.norm(model, axis=1) * np.linalg.norm(measured, axis=1)
    cosine = np.sum(model * measured, axis=1) / np.where(size > 0, size, np.inf)
    return np.asarray(np.sqrt(np.maximum(1.0 - cosine**2, 0.0)))


def _with_springs(measured: Array, model: Array, springs: Array) -> Array:
    """E of torques that springs of unknown stiffness explain as well."""
    columns = np.concatenate([model[..., None], springs], axis=2)
    columns = columns.reshape(*measured.shape, -1)
    errors = []
    for matrix, tau in zip(columns, measured, strict=True):
        _, rest = least_squares(matrix, tau)
        errors.append(np.linalg.norm(rest) / max(float(np.linalg.norm(tau)), 1e-300))
    return np.array(errors)


def column_faults(torque_rows: TorqueRows, plan: Recipe) -> Checked:
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
    sentence = (
        f"{fault.sentence(names)}{other}: the model with friction that brakes leaves "
        f"{significant(100 * before)} % of the squared torque of these joints unexplained, so "
        f"corrected {significant(100 * after)} %; compare with the logger, and {remedy}"
    )
    kind = {faults.REVERSED: faults.TORQUE_SIGN}.get(fault.kind, fault.kind)
    return Finding(kind, WARNING, sentence, evidence)


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
    sentence = (
        f"this log does not show {'; '.join(parts)}: check them by hand, or record a motion in "
        "which every joint moves by itself"
    )
    evidence = {
        "resting": resting,
        "unexplained": unexplained,
        "signs": sorted(int(j) for j in signs),
        "pairs": [list(pair) for pair in pairs],
        "whole": whole,
    }
    return [Finding("hidden_faults", INFO, sentence, evidence)]


def _corrected(plan: Recipe, fault: ColumnFault) -> Recipe:
    """The plan that undoes a fault."""
    sign = np.ones(len(fault.order))
    if fault.kind in {faults.TORQUE_SIGN, faults.POSITION_SIGN, faults.BOTH_SIGN}:
        sign[list(fault.joints)] = -1.0
    of_torque = {faults.TORQUE_SIGN, faults.TORQUE_ORDER}
    in_order = fault.order == tuple(range(len(fault.order)))
    changes = {
        kind: each.signed(sign) if in_order else each.reordered(fault.order)
        for kind, each in plan.signals().items()
        if fault.kind == faults.BOTH_SIGN or (kind == "torque") == (fault.kind in of_torque)
    }
    return plan.replace(**changes)
