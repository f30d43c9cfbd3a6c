"""Published URDFs and the bundled UR5e: read, and their equations against Pinocchio, uncompiled.

What is compiled is tested on fewer robots in `test_dynamics`, and on all by `scripts/check_models`.
"""

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio
import pytest

from runtime.library import to_pinocchio_order
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.errors import SymgenError
from symgen.inspect.inspection import inspect_file
from symgen.make import ROBOTS
from symgen.make.facts import initial_parameters
from symgen.make.request import BuildRequest, bundled_request
from symgen.mechanics.base_parameters import numeric_base, regrouped
from symgen.mechanics.dynamics import inverse_dynamics, mass_matrix, sampled_regressor
from symgen.mechanics.kinematics import end_effector
from tests.oracle import Array, pinocchio_model, random_states
from tests.robots import MORE

STATES = 20
ROUNDING = 1e-12
"""The reason stands beside the same number in `test_dynamics`."""


def numeric(chain: Chain, *outputs: Callable[[ca.SX, ca.SX], ca.SX]) -> ca.Function:
    """Functions of (chain's q, π) on numbers."""
    q, pi = ca.SX.sym("q", len(chain.joints)), ca.SX.sym("pi", 10 * len(chain.joints))
    return ca.Function("f", [q, pi], [output(q, pi) for output in outputs])


def worst_difference(request: BuildRequest) -> tuple[float, Chain]:
    """Largest difference to Pinocchio in τ, Y and M over the largest entry of each.

    τ and M come from π and from its regrouped form.
    """
    chain = read_chain(request.urdf, request.options)
    pi, _ = initial_parameters(chain, request.project)
    model = pinocchio_model(chain.urdf, np.array(chain.gravity))
    ids = [model.getJointId(joint.name) for joint in chain.joints]
    for index, block in zip(ids, to_pinocchio_order(pi).reshape(-1, 10), strict=True):
        model.inertias[index] = pinocchio.Inertia.FromDynamicParameters(block)
    at = np.array([model.joints[index].idx_v for index in ids])
    blocks = np.concatenate([np.arange(10 * (i - 1), 10 * i) for i in ids])
    states = random_states(len(ids), STATES, 3)
    y = sampled_regressor(chain)(*states)
    calculated = numeric(
        chain,
        lambda q, p: regrouped(chain, p),
        lambda q, p: mass_matrix(chain, q, p),
        lambda q, p: mass_matrix(chain, q, regrouped(chain, p)),
    )
    data, ours, theirs = model.createData(), ([], [], [], [], []), ([], [], [], [], [])
    for k, state in enumerate(zip(*states, strict=True)):
        x, v, a = (np.empty(len(at)) for _ in range(3))
        x[at], v[at], a[at] = state
        rows = pinocchio.computeJointTorqueRegressor(model, data, x, v, a)
        full = np.triu(pinocchio.crba(model, data, x))
        tau = pinocchio.rnea(model, data, x, v, a)[at]
        mass = (full + np.triu(full, 1).T)[np.ix_(at, at)]
        answers = (tau, tau, rows.reshape(model.nv, -1)[np.ix_(at, blocks)], mass, mass)
        fewer, *masses = (np.asarray(value) for value in calculated(state[0], pi))
        mine = (y[k] @ pi, y[k] @ fewer.ravel(), to_pinocchio_order(y[k]), *masses)
        for kept, new in zip((*ours, *theirs), (*mine, *answers), strict=True):
            kept.append(new)
    pairs = [(np.array(o), np.array(t)) for o, t in zip(ours, theirs, strict=True)]
    return max(float(np.abs(o - t).max() / np.abs(t).max()) for o, t in pairs), chain


@pytest.mark.parametrize("name", MORE)
def test_published_robots_move_like_pinocchio(name: str, shared_data: Path) -> None:
    """Oracle: τ, Y, M of locked grippers, sub-chains, walls, prismatic fingers, 2 to 8 joints."""
    error, _ = worst_difference(MORE[name].request(name, shared_data / "models"))
    assert error < ROUNDING


@pytest.mark.parametrize(
    ("file", "project", "sentence"),
    [
        ("franka_fer/fer.urdf", False, r"fer_link4.*--settings project=true"),
        ("kuka_lwr4/kuka_lwr4_gaz.urdf", False, r"lwr_1_link.*--settings project=true"),
        ("kuka_lwr4/kuka_lwr4_identified.urdf", False, r"lwr_._link.*--settings project=true"),
        ("staubli_tx40/tx40_mdh_modified.urdf", False, r"link_6.*--settings project=true"),
    ],
)
def test_what_does_not_load_says_how_it_would(
    file: str, project: bool, sentence: str, shared_data: Path
) -> None:
    """Real data: one sentence that names the culprit and the option."""
    with pytest.raises(SymgenError, match=sentence) as caught:
        initial_parameters(read_chain((shared_data / "models" / file).read_text()), project)
    assert "\n" not in str(caught.value)


# --- the UR5e, against the maker's table ---------------------------------------------------------

# a [m], d [m], alpha [rad], mass [kg], centre of mass in the DH frame [m]: Universal Robots, "DH
# parameters for calculations of kinematics and dynamics", UR5e.
TABLE = (
    (0.0, 0.1625, np.pi / 2, 3.761, (0.0, -0.02561, 0.00193)),
    (-0.425, 0.0, 0.0, 8.058, (0.2125, 0.0, 0.11336)),
    (-0.3922, 0.0, 0.0, 2.846, (0.15, 0.0, 0.0265)),
    (0.0, 0.1333, np.pi / 2, 1.37, (0.0, -0.0018, 0.01634)),
    (0.0, 0.0997, -np.pi / 2, 1.3, (0.0, 0.0018, 0.01634)),
    (0.0, 0.0996, 0.0, 0.365, (0.0, 0.0, -0.001159)),
)


def denavit_hartenberg(q: Array) -> list[Array]:
    """The six frames of the table in the base frame."""
    frames, T = [], np.eye(4)
    for angle, (a, d, alpha, *_) in zip(q, TABLE, strict=True):
        c, s, ca_, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
        T = T @ np.array(
            [
                [c, -s * ca_, s * sa, a * c],
                [s, c * ca_, -c * sa, a * s],
                [0, sa, ca_, d],
                [0, 0, 0, 1],
            ]
        )
        frames.append(T)
    return frames


def potential(q: Array) -> float:
    """Σ m g z of the table's centres of mass, J."""
    return sum(
        9.81 * mass * float((T @ np.array([*com, 1.0]))[2])
        for T, (_, _, _, mass, com) in zip(denavit_hartenberg(q), TABLE, strict=True)
    )


def test_ur5e_is_that_of_its_maker() -> None:
    """Oracle: tool and gravity's torque of the DH table; 36 base parameters; nothing suspicious."""
    chain = read_chain(bundled_request("ur5e").urdf)
    pi, _ = initial_parameters(chain, project=False)
    zero = ca.DM(6, 1)
    function = numeric(
        chain,
        lambda q, _: end_effector(chain, q),
        lambda q, p: inverse_dynamics(chain, q, zero, zero, p),
    )
    for q in random_states(6, 10, 4)[0]:
        pose, tau = (np.asarray(x) for x in function(q, pi))
        # Lengths of order one; π/2 with 17 digits.
        np.testing.assert_allclose(pose, denavit_hartenberg(q)[-1], rtol=0, atol=1e-14)
        step = 1e-5
        slopes = [
            (potential(q + step * e) - potential(q - step * e)) / (2 * step) for e in np.eye(6)
        ]
        # Central differences: h² of 100 J is 1e-8, rounding 1e-16 · 100 J / h is 1e-9.
        np.testing.assert_allclose(tau.ravel(), slopes, rtol=0, atol=2e-8)
    assert len(numeric_base(chain, sampled_regressor(chain)).columns) == 36
    assert not inspect_file(ROBOTS / "ur5e.urdf", with_base=False).findings


def test_ur5e_moves_like_pinocchio() -> None:
    """Oracle: τ, Y, M, standing and hanging on a wall."""
    request = bundled_request("ur5e")
    assert worst_difference(request)[0] < ROUNDING
    wall = BuildRequest("wall", request.urdf, ChainOptions(gravity=(9.81, 0.0, 0.0)))
    assert worst_difference(wall)[0] < ROUNDING
