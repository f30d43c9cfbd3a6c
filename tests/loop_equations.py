"""Equations of random linkages against an independent projection, and their Taylor slopes."""

from functools import partial

import casadi as ca
import numpy as np
import pinocchio

from runtime.library import to_pinocchio_order
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.mechanism import mechanism_from_table
from symgen.make.facts import initial_parameters
from symgen.mechanics import dynamics
from symgen.mechanics.base_parameters import numeric_base, regrouped
from symgen.mechanics.closure import supplied
from symgen.mechanics.dynamics import forward_dynamics, mass_matrix
from symgen.mechanics.kinematics import all_positions
from symgen.mechanics.loop_range import within_loops
from tests.linkages import Linkage, Projection, planar, spatial
from tests.oracle import Array
from tests.taylor import TaylorSlope, taylor_slope

MAKERS = {
    "four-bar": partial(planar, kind="four-bar"),
    "parallelogram": partial(planar, kind="parallelogram"),
    "five-bar": partial(planar, kind="five-bar"),
    "spatial": spatial,
}


def chain_of(linkage: Linkage, **changes: object) -> Chain:
    table = linkage.mechanism | changes
    return read_chain(linkage.urdf, ChainOptions(mechanism=mechanism_from_table(table, "M")))


def states(chain: Chain, count: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """q within the ranges of the chain, or a turn of joints without end, brisk dq and ddq."""
    lower = np.array([-np.pi if j.lower is None else j.lower for j in chain.coordinates])
    upper = np.array([np.pi if j.upper is None else j.upper for j in chain.coordinates])
    n = len(lower)
    q = rng.uniform(lower, upper, (count, n))
    return q, rng.normal(0, 2, (count, n)), rng.normal(0, 5, (count, n))


def differences(linkage: Linkage, count: int, seed: int = 5) -> list[float]:
    """Largest differences of positions, τ, ddq, Y and base parameters, over the largest entries."""
    chain = within_loops(chain_of(linkage))
    n, links = len(chain.coordinates), len(chain.joints)
    q, dq, ddq, tau = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq", "tau"))
    pi, _ = initial_parameters(chain, False)
    p = ca.SX.sym("pi", 10 * links)
    results = [
        all_positions(chain, q),
        dynamics.inverse_dynamics(chain, q, dq, ddq, regrouped(chain, p)),
        forward_dynamics(chain, q, dq, tau, p, ca.SX(n, 1)),
        dynamics.regressor(chain, q, dq, ddq),
        mass_matrix(chain, q, regrouped(chain, p)),
    ]
    sizes = np.cumsum([0, *(r.numel() for r in results)])
    stacked = ca.vertcat(*(ca.vec(r.T) for r in map(ca.densify, results)))
    function = ca.Function("f", [q, dq, ddq, tau, p], [supplied(chain, stacked, q)], {"cse": True})
    oracle = Projection(linkage, tuple(j.name for j in chain.joints), np.array(chain.gravity))
    blocks = np.concatenate([np.arange(10 * k, 10 * k + 10) for k in oracle.at])
    mine, theirs, bodies = [], [], []
    for state in zip(*states(chain, count, np.random.default_rng(seed)), strict=True):
        x = oracle.pose(state[0])
        v, a = oracle.rates(x, state[1], state[2])
        torque = oracle.torque(x, v, a)
        full = pinocchio.computeJointTorqueRegressor(oracle.model, oracle.data, x, v, a)
        rows = oracle.projector(x) @ full.reshape(oracle.model.nv, -1)[:, blocks]
        theirs.append((x[oracle.at], torque, oracle.acceleration(x, v, torque), rows))
        parts = np.split(np.asarray(function(*state, torque, pi)).ravel(), sizes[1:-1])
        bodies.append(parts[3].reshape(n, -1))
        mine.append((*parts[:3], to_pinocchio_order(bodies[-1])))
        assert np.abs(oracle.gap(x)[0]).max() < 1e-10
    base = numeric_base(chain, dynamics.sampled_regressor(chain))
    y = np.array(bodies)
    lost = np.abs(y[:, :, list(base.columns)] @ base.matrix - y).max() / np.abs(y).max()
    compared = []
    for ours, other in zip(zip(*mine, strict=True), zip(*theirs, strict=True), strict=True):
        reference = np.array(other)
        compared.append(float(np.abs(np.array(ours) - reference).max() / np.abs(reference).max()))
    return [*compared, float(lost)]


def torque_slope(linkage: Linkage, rng: np.random.Generator) -> TaylorSlope:
    """Taylor slope of τ(q, dq, ddq) along the better of two random directions.

    Along one of fifty the term of h² is by chance far below that of h³.

    Args:
        linkage: of `MAKERS`.
        rng: source of state and direction.

    Returns:
        Slope and decades of the derivative by automatic differentiation, from steps of 0.01.
    """
    chain = within_loops(chain_of(linkage))
    n = len(chain.coordinates)
    x, pi = ca.SX.sym("x", 3 * n), initial_parameters(chain, False)[0]
    q, dq, ddq = ca.vertsplit(x, n)
    torque = dynamics.inverse_dynamics(chain, q, dq, ddq, regrouped(chain, ca.SX(ca.DM(pi))))
    tau = supplied(chain, torque, q)
    function = ca.Function("tau", [x], [tau, ca.jacobian(tau, x)], {"cse": True})
    state = np.concatenate([part[0] for part in states(chain, 1, rng)])
    jacobian = np.asarray(function(state)[1])

    def along(v: Array) -> TaylorSlope:
        return taylor_slope(
            lambda y: np.asarray(function(y)[0]).ravel(), state, v, jacobian @ v, largest=0.01
        )

    return max((along(v) for v in rng.normal(0, 1, (2, 3 * n))), key=lambda s: s.decades)
