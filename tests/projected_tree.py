"""Equations of coupled joints by Pinocchio's full tree, projected to the independent joints."""

import casadi as ca
import numpy as np
import pinocchio

from runtime.library import to_pinocchio_order
from symgen.chain import Chain
from symgen.make.facts import initial_parameters
from symgen.mechanics import dynamics
from symgen.mechanics.base_parameters import regrouped
from symgen.mechanics.dynamics import forward_dynamics, mass_matrix
from tests.oracle import Array, pinocchio_model, random_states

STATES = 20


def projected(chain: Chain, count: int) -> tuple[tuple[Array, ...], Array, tuple[Array, ...]]:
    """States, π and Pinocchio's τ, Y, M and ddq of the full tree, projected by A."""
    pi, _ = initial_parameters(chain, True)
    model = pinocchio_model(chain.urdf, np.array(chain.gravity))
    ids = [model.getJointId(joint.name) for joint in chain.joints]
    for index, block in zip(ids, to_pinocchio_order(pi).reshape(-1, 10), strict=True):
        model.inertias[index] = pinocchio.Inertia.FromDynamicParameters(block)
    at = np.array([model.joints[index].idx_v for index in ids])
    blocks = np.concatenate([np.arange(10 * (i - 1), 10 * i) for i in ids])
    assert chain.coupling is not None
    A, b = np.array(chain.coupling.matrix), np.array(chain.coupling.offset)
    states, data = random_states(A.shape[1], count, 3), model.createData()
    tau, rows, mass, accel = [], [], [], []
    for q, dq, ddq in zip(*states, strict=True):
        x, v, a = (np.empty(len(at)) for _ in range(3))
        x[at], v[at], a[at] = A @ q + b, A @ dq, A @ ddq
        y = pinocchio.computeJointTorqueRegressor(model, data, x, v, a).reshape(model.nv, -1)
        full = np.triu(pinocchio.crba(model, data, x))
        mass.append(A.T @ (full + np.triu(full, 1).T)[np.ix_(at, at)] @ A)
        tau.append(A.T @ pinocchio.rnea(model, data, x, v, a)[at])
        rows.append(A.T @ y[np.ix_(at, blocks)])
        accel.append(ddq)
    return states, pi, tuple(map(np.array, (tau, rows, mass, accel)))


def differences(chain: Chain, count: int = STATES) -> list[float]:
    """Largest differences of τ, Y, M and ddq to the projected tree, over the largest entries."""
    states, pi, answers = projected(chain, count)
    n, links = len(chain.coordinates), len(chain.joints)
    q, dq, ddq, tau = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq", "tau"))
    p = ca.SX.sym("pi", 10 * links)
    function = ca.Function(
        "f",
        [q, dq, ddq, tau, p],
        [
            dynamics.inverse_dynamics(chain, q, dq, ddq, regrouped(chain, p)),
            dynamics.regressor(chain, q, dq, ddq),
            mass_matrix(chain, q, regrouped(chain, p)),
            forward_dynamics(chain, q, dq, tau, p, ca.SX(n, 1)),
        ],
    )
    mine: list[list[Array]] = [[], [], [], []]
    for k, state in enumerate(zip(*states, strict=True)):
        for kept, value in zip(mine, function(*state, answers[0][k], pi), strict=True):
            kept.append(np.asarray(value))
    ours = [np.array(values) for values in mine]
    ours[0], ours[3] = ours[0][:, :, 0], ours[3][:, :, 0]
    ours[1] = to_pinocchio_order(ours[1])
    return [
        float(np.abs(o - t).max() / np.abs(t).max()) for o, t in zip(ours, answers, strict=True)
    ]
