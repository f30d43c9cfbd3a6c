"""Equations of coupled joints against Pinocchio, base parameters, momentum, distances."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from symgen.chain import ChainOptions, read_chain
from symgen.collision.distance import clearance
from symgen.errors import UrdfError
from symgen.make.config import config_from_table
from symgen.make.facts import initial_parameters
from symgen.mechanics import dynamics
from symgen.mechanics.base_parameters import numeric_base
from symgen.mechanics.kinematics import independent_mass
from tests.coupled_chains import TREE, WRIST, coupled
from tests.oracle import random_states
from tests.projected_tree import STATES, differences

ROUNDING = 1e-12
"""Recursions of a dozen bodies: thousands of roundings of 1e-16."""


@pytest.mark.parametrize("independent", [[], ["left_roll", "left_lift"]])
def test_equations_are_those_of_the_projected_tree(independent: list[str]) -> None:
    """Oracle: τ, Y, M and ddq of a chain of couplings with two masters equal Aᵀ … A of Pinocchio's
    tree; ddq up to the condition of M.
    """
    *exact, accel = differences(coupled(WRIST | {"independent": independent}))
    assert max(exact) < ROUNDING
    assert accel < 1e3 * ROUNDING


@pytest.mark.parametrize(
    ("file", "tip"),
    [("franka_fr3/fr3_hand.urdf", None), ("panda_erd/panda.urdf", "panda_rightfinger")],
)
def test_published_grippers_move_like_the_projected_tree(
    file: str, tip: str | None, shared_data: Path
) -> None:
    """Oracle: fingers with <mimic> build, and their equations are those of Pinocchio."""
    urdf = (shared_data / "models" / file).read_text()
    if tip:  # the two fingers hang beside each other: cutting one would cut its master
        with pytest.raises(UrdfError, match="'panda_finger_joint1', which is not a moving joint"):
            read_chain(urdf, ChainOptions(tip=tip))
    chain = read_chain(urdf)
    assert len(chain.coordinates) == 8
    *exact, accel = differences(chain)
    assert max(exact) < ROUNDING
    assert accel < 1e6 * ROUNDING  # condition of M: 1 kg m² at the shoulder, 0.03 kg of a finger


def test_a_follower_without_mass_is_a_speck() -> None:
    """Property: a massless link whose joint follows others builds; its torque stays the same."""
    bare = TREE.replace('<mass value="0.6"/>', '<mass value="0"/>')
    with pytest.raises(UrdfError, match=r"link 'left_hand' moves .* has no mass"):
        read_chain(bare, ChainOptions(masses={}))
    chain = coupled(WRIST, bare, masses={})
    assert chain.assumed == {"left_hand": "no mass"}
    assert chain.joints[2].mass == 1e-9
    *exact, _ = differences(chain, 5)
    assert max(exact) < ROUNDING


def test_base_parameters_explain_the_torque() -> None:
    """Property: Y = Y_b K at new states; K has full row rank."""
    chain = coupled(WRIST)
    sample = dynamics.sampled_regressor(chain)
    base = numeric_base(chain, sample)
    y = sample(*random_states(2, STATES, 8))
    np.testing.assert_allclose(y[:, :, list(base.columns)] @ base.matrix, y, atol=1e-9)
    assert np.linalg.matrix_rank(base.matrix) == len(base.columns)


def test_momentum_and_lagrange_force_are_those_of_the_torque() -> None:
    """Derivative: τ = dp/dt − ∂(T − U)/∂q along a motion, central differences of second order."""
    chain = coupled(WRIST)
    pi = ca.DM(initial_parameters(chain, False)[0])
    q, dq, ddq = (ca.SX.sym(name, 2) for name in ("q", "dq", "ddq"))
    p = ca.Function("p", [q, dq], [dynamics.momentum(chain, q, dq, pi)])
    r = ca.Function("r", [q, dq], [dynamics.lagrange_force(chain, q, dq, pi)])
    tau = ca.Function("t", [q, dq, ddq], [dynamics.inverse_dynamics(chain, q, dq, ddq, pi)])
    x, v, a = np.array([0.3, -0.6]), np.array([1.0, -2.0]), np.array([3.0, 1.0])
    errors = []
    for h in (1e-2, 1e-3):
        ahead, back = (p(x + s * h * v + h * h * a / 2, v + s * h * a) for s in (1, -1))
        rate = np.asarray(ahead - back) / (2 * h)
        errors.append(np.abs(rate - np.asarray(r(x, v)) - np.asarray(tau(x, v, a))).max())
    assert errors[1] < errors[0] / 50


def test_distances_and_their_gradients_follow_the_coupling() -> None:
    """Derivative: the gradient of a distance in q is that of central differences."""
    chain = coupled(WRIST)
    proxies = [
        {"name": k, "link": k, "start": [0, 0, 0], "end": [0.2, 0.1, 0], "radius": 0.02}
        for k in ("left_hand", "right_arm")
    ]
    pairs = [{"first": "left_hand", "second": "right_arm", "margin": 0.0}]
    q = ca.SX.sym("q", 2)
    model = config_from_table({"proxy": proxies, "pair": pairs}, "test").collision
    function = ca.Function("d", [q], list(clearance(chain, model, q)))
    x, h = np.array([0.4, -0.3]), 1e-5
    slopes = [float(function(x + h * e)[0] - function(x - h * e)[0]) / (2 * h) for e in np.eye(2)]
    np.testing.assert_allclose(slopes, np.asarray(function(x)[1]).ravel(), atol=1e-9)


def test_mass_of_independent_joints_is_projected() -> None:
    """Oracle: Aᵀ M A by numpy, both triangles the same to the bit."""
    chain = coupled(WRIST)
    root = np.random.default_rng(0).normal(size=(4, 4))
    a = np.array(chain.coupling.matrix)
    mass = np.array(ca.DM(independent_mass(chain, ca.SX.sym("q", 2), ca.DM(root @ root.T))))
    np.testing.assert_allclose(mass, a.T @ root @ root.T @ a, rtol=1e-12)
    np.testing.assert_array_equal(mass, mass.T)
