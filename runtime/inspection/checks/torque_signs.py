"""Checks of order, sign and unit of τ, by regression on the torque of the URDF.

    τ_i = s τ̂_j + v dq_j + c tanh(dq_j / ε) + b

s is 1 where τ is the torque at the joint in N·m, and −1 where the log has the opposite sign. One
factor for all joints is a unit; different factors are motor currents or motor torques. The torque
of the URDF errs by 10 to 20 %, so that gains computed from it are a start, not a calibration.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from runtime.estimators.regression.posterior import least_squares
from runtime.inspection.checks.torque_rows import EPSILON, TorqueRows
from runtime.inspection.finding import ERROR, WARNING, Finding, joint_list
from runtime.library import Array
from runtime.recording import Recipe

SURE = 0.7
"""Partial correlation of τ with the model's torque above which a slope is used."""
LOADED = 0.05
"""RMS of the model's torque over the largest one, above which a joint is used."""
NEW, GAINED = 0.75, 0.3
"""Share of τ that the model explains in a better order, and its gain over the present order, for
each column that changes its place; wrist joints of little torque reach 0.6 by chance."""
USUAL = (0.5, 2.0)
"""Slopes that the errors of a URDF explain."""


def torque_order(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """Order of the columns of τ.

    Measured: share of each column of τ that the model's torque of each joint explains.
    """
    inertial, falls = torque_rows.model_torque()
    model = inertial + falls
    n = torque_rows.lib.n_joints
    share = np.array(
        [[_regressed(torque_rows, model, i, j)[1] for j in range(n)] for i in range(n)]
    )
    columns, joints = linear_sum_assignment(-(share**2))
    order = columns[np.argsort(joints)]
    present, best = np.diag(share) ** 2, share[order, np.arange(n)] ** 2
    moved = np.flatnonzero(order != np.arange(n))
    if plan.torque is None or not moved.size:
        return plan, []
    if np.median(best[moved]) < NEW or np.median(best[moved] - present[moved]) < GAINED:
        return plan, []
    columns_in_order = ", ".join(map(str, order))
    base = plan.torque.order or tuple(range(n))
    torque = replace(plan.torque, order=tuple(int(base[k]) for k in order))
    return plan.replace(torque=torque), [
        Finding(
            "torque_order",
            WARNING,
            "the columns of τ are in another order than those of q: in the order "
            f"{columns_in_order} (counted from 0) the model explains "
            f"{100 * best[moved].mean():.0f} % of the columns that change place, in the present "
            f"order {100 * present[moved].mean():.0f} %; set order = [{columns_in_order}] under "
            "[torque]",
            {
                "order": order.tolist(),
                "explained": best.tolist(),
                "explained_as_is": present.tolist(),
            },
        )
    ]


def scale(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """Unit and gains of τ, from the slopes of the joints that gravity or inertia load."""
    slopes, is_used = slopes_to_model(torque_rows)
    if plan.torque is None or not is_used.any():
        return plan, []
    size = np.abs(slopes)
    middle = float(np.median(size[is_used]))
    evidence = {"slopes": [float(s) if k else None for s, k in zip(slopes, is_used, strict=True)]}
    factors = ", ".join(f"{s:.3g}" if k else "?" for s, k in zip(slopes, is_used, strict=True))
    spread = float(size[is_used].max() / size[is_used].min())
    if USUAL[0] <= middle <= USUAL[1] and spread < 4.0 and not _unscaled(plan):
        return plan, []
    if 400.0 <= middle <= 2500.0 and spread < 3.0 and plan.torque.unit == "N*m":
        sentence = (
            f"τ looks like mN·m: it is {factors} times the model's torque, joint by joint; set "
            "unit = 'mN*m' under [torque]"
        )
        torque = replace(plan.torque, unit="mN*m")
        return plan.replace(torque=torque), [Finding("torque_unit", ERROR, sentence, evidence)]
    known = [float(s) for s, k in zip(size, is_used, strict=True) if k]
    gains = [
        1.0 / s if k else 1.0 / float(np.median(known)) for s, k in zip(size, is_used, strict=True)
    ]
    evidence["gains"] = [float(f"{g:.4g}") for g in gains]
    before = np.broadcast_to(np.asarray(plan.torque.gain or 1.0, dtype=float), size.shape)
    torque = replace(
        plan.torque,
        unit="A",
        gain=tuple(float(f"{g * b:.4g}") for g, b in zip(gains, before, strict=True)),
    )
    sentence = (
        f"τ is not the joint torque in N·m: it is {factors} times the model's torque, joint by "
        "joint, as motor currents or motor torques are; give the gains from the data sheet "
        "(torque constant times gear ratio), or from two runs with and without a known payload. "
        f"The proposed gains {', '.join(f'{g:.3g}' for g in gains)} reproduce the masses of the "
        "URDF and are not a calibration: identified masses inherit their error"
    )
    return plan.replace(torque=torque), [Finding("torque_unit", ERROR, sentence, evidence)]


def _unscaled(plan: Recipe) -> bool:
    """Whether τ is in amperes by its title and no gain is given."""
    return plan.torque is not None and plan.torque.unit == "A" and plan.torque.gain == 1.0


def joint_signs(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """Sign of τ, joint by joint.

    Measured: sign of the slope of τ on the model's torque. Where every joint that gravity loads has
    the opposite sign, `gravity` decides between the sign of τ and the direction of gravity.
    """
    slopes, is_used = slopes_to_model(torque_rows)
    against = np.flatnonzero(is_used & (slopes < 0))
    inertial, falls = torque_rows.model_torque()
    heavy = is_used & (np.mean(falls**2, axis=0) > np.mean(inertial**2, axis=0))
    if plan.torque is None or not against.size or (slopes[heavy] < 0).all():
        return plan, []
    n, where = torque_rows.lib.n_joints, [int(j) for j in against]
    sign = np.where(np.isin(np.arange(n), against), -1.0, 1.0)
    present = np.broadcast_to(np.asarray(plan.torque.sign, dtype=float), (n,))
    torque = replace(plan.torque, sign=tuple(float(s) for s in sign * present))
    return plan.replace(torque=torque), [
        Finding(
            "torque_sign",
            WARNING,
            f"τ is opposite to the model at {joint_list(torque_rows.lib.joint_names, where)} "
            f"(slope {', '.join(f'{slopes[j]:.2g}' for j in where)} on its torque) and agrees "
            "elsewhere: the log has the opposite sign at these joints; check the direction of q "
            "too, and set sign = "
            f"{[int(s) for s in sign * present]} under [torque]",
            {"joints": where, "slopes": [float(s) for s in slopes]},
        )
    ]


def slopes_to_model(torque_rows: TorqueRows) -> tuple[Array, NDArray[np.bool_]]:
    """Slope s of τ on the model's torque per joint, (n,), and whether it is used, (n,) booleans."""
    inertial, falls = torque_rows.model_torque()
    model = inertial + falls
    pairs = [_regressed(torque_rows, model, j, j) for j in range(torque_rows.lib.n_joints)]
    slopes, partial = np.array(pairs).T
    power = np.sqrt(np.mean(np.square(model), axis=0))
    return slopes, np.asarray((np.abs(partial) > SURE) & (power > LOADED * power.max()))


def _regressed(torque_rows: TorqueRows, model: Array, i: int, j: int) -> tuple[float, float]:
    """s and the partial correlation of column i of τ with the model's torque at joint j."""
    s = torque_rows.samples
    dq = s.dq[:, j]
    others = np.column_stack([dq, np.tanh(dq / EPSILON), np.ones_like(dq)])
    _, tau = least_squares(others, s.tau[:, i])
    _, rigid = least_squares(others, model[:, j])
    size = float(np.linalg.norm(rigid))
    if size <= 1e-6 * np.sqrt(len(rigid)):
        return 0.0, 0.0
    both = float(rigid @ tau)
    return both / size**2, both / max(size * float(np.linalg.norm(tau)), 1e-300)
