"""What is the effort?  Order, sign and unit of τ by regression on the model's torque.

    τ_i = s τ̂_j + v dq_j + c tanh(dq_j / ε) + b

s = 1 where τ is N·m at the joint; −1 where the log counts the other way (trap 3); one factor for
all joints is a unit, another for each is motor currents or motor torques (trap 11). The URDF is a
yardstick of 10 to 20 %: gains read off it are a start, no calibration.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from runtime.inspection.checks.torque_rows import TorqueRows, least_squares
from runtime.inspection.finding import ERROR, WARNING, Finding, joint_list
from runtime.library import Array
from runtime.recording import Recipe

SURE = 0.7
"""Partial correlation of τ with the model's torque that is believed."""
LOADED = 0.05
"""RMS of the model's torque over the largest one's, above which a joint has a say."""
NEW, GAINED = 0.6, 0.3
"""Explained share in the better order, and what it must gain, for each joint that moves."""
USUAL = (0.5, 2.0)
EPSILON = 0.05


def torque_order(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """The columns of τ, where they belong to other joints than those of q."""
    inertial, falls = torque_rows.model_torque()
    model = inertial + falls
    tau, n = torque_rows.samples.tau, torque_rows.lib.n_joints
    share = np.array(
        [[_regressed(torque_rows, model, i, j)[1] for j in range(n)] for i in range(n)]
    )
    columns, joints = linear_sum_assignment(-(share**2))
    order = columns[np.argsort(joints)]
    own, best = np.diag(share) ** 2, share[order, np.arange(n)] ** 2
    moved = np.flatnonzero(order != np.arange(n))
    if plan.torque is None or not moved.size:
        return plan, []
    if (
        np.median(best[moved]) < NEW
        or np.median(best[moved] - own[moved]) < GAINED
        or not tau.any()
    ):
        return plan, []
    told = ", ".join(map(str, order))
    base = plan.torque.order or tuple(range(n))
    torque = replace(plan.torque, order=tuple(int(base[k]) for k in order))
    return plan.replace(torque=torque), [
        Finding(
            "torque_order",
            WARNING,
            f"the columns of τ are in another order than those of q: in the order {told} (counted "
            f"from 0) the model explains {100 * best[moved].mean():.0f} % of the moved joints, as "
            f"they stand {100 * own[moved].mean():.0f} %; set order = [{told}] under [torque]",
            {"order": order.tolist(), "explained": best.tolist(), "explained_as_is": own.tolist()},
            trap=9,
        )
    ]


def scale(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """Unit and gains, from the size of the slopes of the joints that gravity or inertia load."""
    slopes, sure = slopes_to_model(torque_rows)
    if plan.torque is None or not sure.any():
        return plan, []
    size = np.abs(slopes)
    middle = float(np.median(size[sure]))
    evidence = {"slopes": [float(s) if k else None for s, k in zip(slopes, sure, strict=True)]}
    told = ", ".join(f"{s:.3g}" if k else "?" for s, k in zip(slopes, sure, strict=True))
    spread = float(size[sure].max() / size[sure].min())
    if USUAL[0] <= middle <= USUAL[1] and spread < 4.0 and not _unscaled(plan):
        return plan, []
    if 400.0 <= middle <= 2500.0 and spread < 3.0 and plan.torque.unit == "N*m":
        sentence = (
            f"τ looks like mN·m: it is {told} times the model's torque, joint by joint; set unit "
            "= 'mN*m' under [torque]"
        )
        torque = replace(plan.torque, unit="mN*m")
        return plan.replace(torque=torque), [
            Finding("torque_unit", ERROR, sentence, evidence, trap=11)
        ]
    known = [float(s) for s, k in zip(size, sure, strict=True) if k]
    gains = [
        1.0 / s if k else 1.0 / float(np.median(known)) for s, k in zip(size, sure, strict=True)
    ]
    evidence["gains"] = [float(f"{g:.4g}") for g in gains]
    before = np.broadcast_to(np.asarray(plan.torque.gain or 1.0, dtype=float), size.shape)
    torque = replace(
        plan.torque,
        unit="A",
        gain=tuple(float(f"{g * b:.4g}") for g, b in zip(gains, before, strict=True)),
    )
    sentence = (
        f"τ is no torque at the joints in N·m: it is {told} times the model's, joint by joint, so "
        "motor currents or motor torques; give the gains from the data sheet (torque constant "
        "times gear ratio), or from one run with a known payload. Those proposed, "
        f"{', '.join(f'{g:.3g}' for g in gains)}, make the URDF's masses right and are no "
        "calibration: identified masses inherit their error"
    )
    return plan.replace(torque=torque), [Finding("torque_unit", ERROR, sentence, evidence, trap=11)]


def _unscaled(plan: Recipe) -> bool:
    """Amperes by the title, without a gain that anybody has given."""
    return plan.torque is not None and plan.torque.unit == "A" and plan.torque.gain == 1.0


def joint_signs(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """Some joints count τ the other way; where all do, `gravity` decides what is turned."""
    slopes, sure = slopes_to_model(torque_rows)
    against = np.flatnonzero(sure & (slopes < 0))
    inertial, falls = torque_rows.model_torque()
    heavy = sure & (np.mean(falls**2, axis=0) > np.mean(inertial**2, axis=0))
    if plan.torque is None or not against.size or (slopes[heavy] < 0).all():
        return plan, []
    n, where = torque_rows.lib.n_joints, [int(j) for j in against]
    sign = np.where(np.isin(np.arange(n), against), -1.0, 1.0)
    own = np.broadcast_to(np.asarray(plan.torque.sign, dtype=float), (n,))
    torque = replace(plan.torque, sign=tuple(float(s) for s in sign * own))
    return plan.replace(torque=torque), [
        Finding(
            "torque_sign",
            WARNING,
            f"τ runs against the model at {joint_list(torque_rows.lib.joint_names, where)} (slope "
            f"{', '.join(f'{slopes[j]:.2g}' for j in where)} on its torque) and with it elsewhere: "
            "the log counts these joints the other way; check the axis of q too, and set sign = "
            f"{[int(s) for s in sign * own]} under [torque]",
            {"joints": where, "slopes": [float(s) for s in slopes]},
            trap=3,
        )
    ]


def slopes_to_model(torque_rows: TorqueRows) -> tuple[Array, NDArray[np.bool_]]:
    """s per joint, and which of them are believed."""
    inertial, falls = torque_rows.model_torque()
    model = inertial + falls
    found = [_regressed(torque_rows, model, j, j) for j in range(torque_rows.lib.n_joints)]
    slopes, partial = np.array(found).T
    power = np.sqrt(np.mean(np.square(model), axis=0))
    return slopes, np.asarray((np.abs(partial) > SURE) & (power > LOADED * power.max()))


def _regressed(torque_rows: TorqueRows, model: Array, i: int, j: int) -> tuple[float, float]:
    """s and the partial correlation of column i of τ with the model's torque at joint j."""
    s = torque_rows.samples
    dq = s.dq[:, j]
    others = np.column_stack([dq, np.tanh(dq / EPSILON), np.ones_like(dq)])
    _, tau = least_squares(others, s.tau[:, i])
    _, own = least_squares(others, model[:, j])
    size = float(np.linalg.norm(own))
    if size <= 1e-6 * np.sqrt(len(own)):
        return 0.0, 0.0
    both = float(own @ tau)
    return both / size**2, both / max(size * float(np.linalg.norm(tau)), 1e-300)
