"""Columns of q and dq that belong to another joint or have the opposite sign, by the torque (3, 9).

    share(P) = mean over loaded joints of the partial correlation² of τ_j with τ̂_j(P q, P dq, P ddq)

over the present columns, every single sign −1 and every exchange of two joints; τ̂ is the torque of
the URDF, and friction is regressed out. Neither gains nor signs of τ matter.
"""

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.regression.posterior import least_squares
from runtime.inspection.checks.torque_rows import EPSILON, TorqueRows
from runtime.inspection.finding import WARNING, Finding
from runtime.library import Array
from runtime.recording import Recipe
from runtime.recording.recipes.recipe import Signal

Order = NDArray[np.int64]

ROWS = 300
"""Rows of the regressions: the shares differ by tenths."""
LOADED = 0.05
"""RMS torque of the URDF over the largest one, above which a joint is used."""
GOOD, GAINED = 0.7, 0.15
"""Share that other columns must reach, and must gain; the URDF of a right log reaches 0.9."""


def position_columns(torque_rows: TorqueRows, plan: Recipe) -> tuple[Recipe, list[Finding]]:
    """Sign and order of the positions and velocities, by the torque of the URDF."""
    n, names = torque_rows.lib.n_joints, torque_rows.lib.joint_names
    still = np.arange(n)
    present = _share(torque_rows, still, np.ones(n))
    if present > GOOD or plan.position is None or plan.gear:
        return plan, []
    flips = [np.where(still == j, -1.0, 1.0) for j in range(n)]
    swaps = [_exchanged(n, *pair) for pair in itertools.combinations(range(n), 2)]
    by_sign = [_share(torque_rows, still, sign) for sign in flips]
    by_order = [_share(torque_rows, order, np.ones(n)) for order in swaps]
    best = max([*by_sign, *by_order])  # a robot of one joint has no order
    if best < GOOD or best < present + GAINED:
        return plan, []
    shares = (
        f"the URDF then explains {100 * best:.0f} % of the torque of the joints that it loads, "
        f"{100 * present:.0f} % as it is"
    )
    evidence = {"share": best, "share_as_is": present}
    if max(by_sign) == best:
        j = int(np.argmax(by_sign))
        sign = flips[j]
        changes = {kind: _negated(each, sign) for kind, each in _motion(plan).items()}
        value = [int(s) for s in np.broadcast_to(np.asarray(changes["position"].sign), (n,))]
        sentence = (
            f"the position of {names[j]} has the opposite sign of the model's joint ({shares}): "
            f"set sign = {value} under [position] and [velocity], or turn the axis in the URDF"
        )
        return plan.replace(**changes), [
            Finding("position_sign", WARNING, sentence, evidence | {"joints": [j]})
        ]
    order = swaps[int(np.argmax(by_order))]
    moved = [int(j) for j in np.flatnonzero(order != still)]
    columns = ", ".join(map(str, order))
    sentence = (
        f"the positions of {' and '.join(names[j] for j in moved)} are exchanged, or their torques "
        f"({shares}): compare with the logger and set order = [{columns}] under [position] and "
        "[velocity]"
    )
    changes = {kind: _ordered(each, order) for kind, each in _motion(plan).items()}
    return plan.replace(**changes), [
        Finding("position_order", WARNING, sentence, evidence | {"order": order.tolist()})
    ]


def _share(torque_rows: TorqueRows, order: Order, sign: Array) -> float:
    """Mean partial correlation² of the loaded joints with these columns of the motion."""
    s, lib = torque_rows.samples, torque_rows.lib
    few = s.rows(slice(None, None, max(1, len(s) // ROWS)))
    q, dq, ddq = (part[:, order] * sign for part in (few.q, few.dq, few.ddq))
    model = lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    power = np.sqrt(np.mean(model**2, axis=0))
    return float(
        np.mean(
            [
                _explained(few.tau[:, j], model[:, j], dq[:, j])
                for j in np.flatnonzero(power > LOADED * power.max())
            ]
        )
    )


def _explained(tau: Array, model: Array, dq: Array) -> float:
    """Partial correlation² of τ with the model's torque, friction and offset regressed out."""
    others = np.column_stack([dq, np.tanh(dq / EPSILON), np.ones_like(dq)])
    _, both = least_squares(others, np.column_stack([tau, model]))
    sizes = np.linalg.norm(both, axis=0)
    return float((both[:, 0] @ both[:, 1] / max(float(sizes.prod()), 1e-300)) ** 2)


def _exchanged(n: int, a: int, b: int) -> Order:
    order = np.arange(n)
    order[[a, b]] = b, a
    return order


def _motion(plan: Recipe) -> dict[str, Signal]:
    """Signals of the motion, without the torque."""
    return {kind: each for kind, each in plan.signals().items() if kind != "torque"}


def _negated(signal: Signal, sign: Array) -> Signal:
    """The signal with other signs; offsets are added after the sign and change theirs."""
    present = np.broadcast_to(np.asarray(signal.sign, dtype=float), sign.shape)
    offset = np.broadcast_to(np.asarray(signal.offset, dtype=float), sign.shape) * sign
    return replace(
        signal,
        sign=tuple(float(x) for x in present * sign),
        offset=tuple(float(x) for x in offset) if offset.any() else 0.0,
    )


def _ordered(signal: Signal, order: Order) -> Signal:
    """The signal with its columns in another order."""
    present = signal.order or tuple(range(len(order)))
    return replace(signal, order=tuple(int(present[k]) for k in order))
