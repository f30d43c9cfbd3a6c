"""Linear couplings q_all = A q + b: rows, chains, cycles, and all equations against Pinocchio."""

from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio
import pytest

from runtime.library import to_pinocchio_order
from symgen.build.facts import initial_parameters
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.mechanism import mechanism_from_table, table_from_mechanism
from symgen.collision.distance import clearance
from symgen.collision.tables import collision_from_tables
from symgen.errors import UrdfError
from symgen.mechanics import dynamics, lagrange
from symgen.mechanics.base_parameters import numeric_base
from symgen.mechanics.coordinates import independent_mass
from symgen.mechanics.mass_matrix import forward_dynamics, mass_matrix
from symgen.mechanics.regrouping import regrouped
from tests.oracle import Array, pinocchio_model, random_states
from tests.robots import DATA

TREE = (DATA / "tree.urdf").read_text()
STATES = 20
ROUNDING = 1e-12
"""Recursions of a dozen bodies: thousands of roundings of 1e-16."""

WRIST = {
    "coupling": [
        {"joint": "left_roll", "of": {"trunk_turn": 0.5, "left_lift": -1.25}, "offset": 0.2},
        {"joint": "right_lift", "of": {"left_roll": 2.0}, "offset": -0.1},
    ]
}
"""A joint with two masters, and one that follows it: right = trunk − 2.5 lift + 0.3."""


def coupled(table: dict, urdf: str = TREE, **options: object) -> Chain:
    return read_chain(urdf, ChainOptions(mechanism=mechanism_from_table(table, "M"), **options))


def with_mimics(*mimics: tuple[str, str]) -> str:
    """The tree with <mimic> elements: joint, attributes."""
    text = TREE
    for joint, attributes in mimics:
        head, tail = text.split(f'<joint name="{joint}"', 1)
        text = f'{head}<joint name="{joint}"' + tail.replace(
            "</joint>", f"<mimic {attributes}/></joint>", 1
        )
    return text


def test_rows_are_substituted_along_chains() -> None:
    """Oracle: A and b by hand."""
    coupling = coupled(WRIST).coupling
    assert coupling is not None
    assert coupling.independent == (0, 1)
    np.testing.assert_array_equal(coupling.matrix, [[1, 0], [0, 1], [0.5, -1.25], [1, -2.5]])
    np.testing.assert_allclose(coupling.offset, [0, 0, 0.2, 0.3], atol=1e-16)


def test_mimic_and_table_say_the_same() -> None:
    """Property: <mimic> with multiplier and offset is a row of the table, which replaces it."""
    mimic = with_mimics(("left_roll", 'joint="left_lift" multiplier="-0.5" offset="0.25"'))
    row = {"joint": "left_roll", "of": {"left_lift": -0.5}, "offset": 0.25}
    assert read_chain(mimic).coupling == coupled({"coupling": [row]}).coupling
    assert coupled(WRIST, mimic).coupling == coupled(WRIST).coupling


def test_named_independent_joints_are_solved_for() -> None:
    """Property: the same mechanism by other coordinates: A x_w + b gives the same postures."""
    ours, others = (
        coupled(WRIST).coupling,
        coupled(WRIST | {"independent": ["left_roll", "left_lift"]}).coupling,
    )
    assert ours is not None
    assert others is not None
    assert others.independent == (2, 1)
    turned = coupled(WRIST | {"independent": ["left_lift", "trunk_turn"]}).coupling
    assert turned is not None
    np.testing.assert_array_equal(turned.matrix, np.array(ours.matrix)[:, ::-1])
    posture = np.array(ours.matrix) @ [0.3, -0.7] + ours.offset
    again = np.array(others.matrix) @ posture[list(others.independent)] + others.offset
    np.testing.assert_allclose(again, posture, atol=1e-15)


def test_a_follower_narrows_the_range_of_its_master() -> None:
    """Oracle: right_lift ∈ [−2, 1] = −2 left_lift + 0.5 leaves left_lift [−0.25, 1.25]; its speed
    limit 3 rad/s leaves 1.5 rad/s.
    """
    row = {"joint": "right_lift", "of": {"left_lift": -2.0}, "offset": 0.5}
    lift = coupled({"coupling": [row]}).coordinates[1]
    assert (lift.lower, lift.upper, lift.velocity) == (-0.25, 1.25, 1.5)


def test_a_locked_master_locks_its_followers() -> None:
    """Property: a follower of a locked joint stands still where the coupling puts it."""
    text = with_mimics(("right_lift", 'joint="left_lift" multiplier="2" offset="0.1"'))
    followed = read_chain(text, ChainOptions(locks={"left_lift": 0.3}))
    by_hand = read_chain(TREE, ChainOptions(locks={"left_lift": 0.3, "right_lift": 0.7}))
    assert followed.coupling is None
    assert followed.joints[0].mass == by_hand.joints[0].mass
    np.testing.assert_allclose(followed.joints[0].com, by_hand.joints[0].com, atol=1e-15)


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
    p = ca.Function("p", [q, dq], [lagrange.momentum(chain, q, dq, pi)])
    r = ca.Function("r", [q, dq], [lagrange.lagrange_force(chain, q, dq, pi)])
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
    model = collision_from_tables(proxies, pairs, "test")
    function = ca.Function("d", [q], list(clearance(chain, model, q)))
    x, h = np.array([0.4, -0.3]), 1e-5
    slopes = [float(function(x + h * e)[0] - function(x - h * e)[0]) / (2 * h) for e in np.eye(2)]
    np.testing.assert_allclose(slopes, np.asarray(function(x)[1]).ravel(), atol=1e-9)


def test_a_mechanism_survives_the_manifest() -> None:
    """Property: the table of the manifest reads as the mechanism it was written from."""
    table = {
        "coupling": [{"joint": "j", "of": {"k": 2.0}, "offset": 0.1}],
        "independent": ["k"],
        "friction": [{"name": "jaw", "of": {"k": 1.0, "l": -1.0}}],
        "spring": [
            {"name": "a", "joint": "k", "rest": 0.2},
            {"parent": "A", "child": "B", "parent_xyz": [1, 2, 3], "child_xyz": [0, 0, 1]},
        ],
        "known_torque": [
            {"of": {"k": 1.0}, "polynomial": [0.5, 1.0]},
            {"joint": "k", "x": [0.0, 1.0], "torque": [2.0, 3.0]},
        ],
    }
    mechanism = mechanism_from_table(table, "M")
    assert mechanism_from_table(table_from_mechanism(mechanism), "again") == mechanism


REFUSED = {
    "cycle of mimics": (
        with_mimics(("left_roll", 'joint="right_lift"'), ("right_lift", 'joint="left_roll"')),
        {},
        "the couplings form a cycle: 'left_roll' follows 'right_lift', 'right_lift' follows "
        "'left_roll'",
    ),
    "mimic of itself": (
        with_mimics(("left_roll", 'joint="left_roll"')),
        {},
        "cycle: 'left_roll' follows 'left_roll'",
    ),
    "unknown master": (
        with_mimics(("left_roll", 'joint="nobody"')),
        {},
        "'left_roll' names 'nobody', which is not a moving joint",
    ),
    "mimic without a joint": (
        with_mimics(("left_roll", 'multiplier="2"')),
        {},
        "the <mimic> of joint 'left_roll' names no joint",
    ),
    "multiplier": (
        with_mimics(("left_roll", 'joint="left_lift" multiplier="two"')),
        {},
        "'left_roll': mimic multiplier",
    ),
    "infinite offset": (
        with_mimics(("left_roll", 'joint="left_lift" offset="inf"')),
        {},
        "'left_roll': mimic offset",
    ),
    "unknown joint": (TREE, {"coupling": [{"joint": "x", "of": {"left_lift": 1}}]}, "names 'x'"),
    "two rows": (TREE, {"coupling": [WRIST["coupling"][0]] * 2}, "'left_roll' has two couplings"),
    "all dependent": (
        TREE,
        {
            "coupling": [
                {"joint": a, "of": {b: 1.0}}
                for a, b in zip(
                    ("trunk_turn", "left_lift", "left_roll", "right_lift"),
                    ("left_lift", "left_roll", "right_lift", "trunk_turn"),
                    strict=True,
                )
            ]
        },
        "every joint follows another one: 'trunk_turn' follows 'left_lift'",
    ),
    "no factors": (TREE, {"coupling": [{"joint": "left_roll", "of": {}}]}, "needs of = "),
    "word as factor": (
        TREE,
        {"coupling": [{"joint": "left_roll", "of": {"left_lift": "1"}}]},
        "needs of = ",
    ),
    "unknown key": (TREE, {"couplings": []}, "unknown key 'couplings'"),
    "table, not tables": (TREE, {"coupling": {"joint": "a"}}, r"expected tables \[\[coupling\]\]"),
    "singular choice": (
        TREE,
        WRIST | {"independent": ["left_roll", "right_lift"]},
        "'?left_roll, right_lift'? do not determine the others",
    ),
    "unknown independent": (TREE, WRIST | {"independent": ["a", "b"]}, "independent names 'a'"),
    "curve by polynomial and by points": (
        TREE,
        {"known_torque": [{"joint": "left_lift", "polynomial": [1.0], "x": [0.0, 1.0]}]},
        "has a polynomial and points",
    ),
    "independent without coupling": (TREE, {"independent": ["left_lift"]}, "no coupling"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_coupling_is_refused_in_a_sentence(case: str) -> None:
    """Property: one sentence that names the joint or the key."""
    urdf, table, sentence = REFUSED[case]
    with pytest.raises(UrdfError, match=sentence) as caught:
        coupled(table, urdf)
    assert "\n" not in str(caught.value)


def test_mass_of_independent_joints_is_projected() -> None:
    """Oracle: Aᵀ M A by numpy, both triangles the same to the bit."""
    chain = coupled(WRIST)
    root = np.random.default_rng(0).normal(size=(4, 4))
    a = np.array(chain.coupling.matrix)
    mass = np.array(ca.DM(independent_mass(chain, ca.SX.sym("q", 2), ca.DM(root @ root.T))))
    np.testing.assert_allclose(mass, a.T @ root @ root.T @ a, rtol=1e-12)
    np.testing.assert_array_equal(mass, mass.T)
