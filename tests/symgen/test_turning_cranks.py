"""Cranks that turn without end: positions and equations repeat, branches stay, limits are kept."""

import casadi as ca
import numpy as np
import pytest

from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.mechanism import mechanism_from_table
from symgen.mechanics.closure import supplied
from symgen.mechanics.kinematics import all_positions
from symgen.mechanics.loop_equations import closed_chain, seed_values, values_from_last
from symgen.mechanics.loop_range import within_loops

TURN = 2 * np.pi
BODY = (
    '<inertial><origin xyz="0.1 0 0"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
    'ixy="0" ixz="0" iyz="0"/></inertial>'
)
LOOP = {
    "parent": "coupler",
    "child": "rocker_link",
    "parent_xyz": [0.42, 0.0, 0.0],
    "child_xyz": [0.3, 0.0, 0.0],
    "kind": "spherical",
}
ASSEMBLY = {"crank": 0.0, "pin": -0.7, "rocker": -1.2}


def four_bar(crank: float, limits: str = "") -> Chain:
    """A crank of this length [m] on a ground of 0.4, a coupler of 0.42 and a rocker of 0.3.

    Args:
        crank: length [m].
        limits: element of the pin.

    Returns:
        The chain, its range searched.
    """
    links = "".join(
        f'<link name="{name}">{BODY}</link>' for name in ("crank_link", "coupler", "rocker_link")
    )
    joints = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="0 1 0"/>{limit}</joint>'
        for name, kind, parent, child, x, limit in (
            ("crank", "continuous", "ground", "crank_link", 0.0, ""),
            ("pin", "revolute", "crank_link", "coupler", crank, limits),
            ("rocker", "continuous", "ground", "rocker_link", 0.4, ""),
        )
    )
    table = {"independent": ["crank"], "loop": [LOOP], "assembly": ASSEMBLY}
    urdf = f'<robot name="bars"><link name="ground"/>{links}{joints}</robot>'
    return within_loops(read_chain(urdf, ChainOptions(mechanism=mechanism_from_table(table, "M"))))


def positions(chain: Chain, at: np.ndarray) -> np.ndarray:
    """Positions of crank, pin and rocker at those of the crank, (N, 3)."""
    q = ca.SX.sym("q", 1)
    function = ca.Function("x", [q], [supplied(chain, all_positions(chain, q), q)])
    rows = np.asarray(function.map(len(at))(at[None])).T
    names = [joint.name for joint in chain.joints]
    return rows[:, [names.index(name) for name in ("crank", "pin", "rocker")]]


def test_a_crank_turns_without_end() -> None:
    """Oracle: trigonometry of the loop on the branch of the assembly; seven turns are continuous,
    the pin turns back once per turn and the rocker rocks. The last sample leads to the same.
    """
    chain = four_bar(0.12)
    (crank,) = chain.coordinates
    assert (crank.lower, crank.upper) == (None, None)
    assert chain.loops is not None
    line = np.linspace(-11, 31, 4001)
    x = positions(chain, line)
    assert np.abs(np.diff(x, axis=0)).max() < 0.05
    # Ends of the crank and of the rocker, 0.42 m apart: rotation about y takes x to (cos, −sin).
    end = 0.12 * np.column_stack([np.cos(line), -np.sin(line)])
    tip = [0.4, 0.0] + 0.3 * np.column_stack([np.cos(x[:, 2]), -np.sin(x[:, 2])])
    np.testing.assert_allclose(np.linalg.norm(tip - end, axis=1), 0.42, atol=1e-14)
    away = tip - end
    np.testing.assert_allclose(
        np.exp(1j * (x[:, 0] + x[:, 1])), (away[:, 0] - 1j * away[:, 1]) / 0.42, atol=1e-13
    )
    # One branch: the angle between coupler and rocker keeps its sign.
    assert np.ptp(np.sign(np.sin(x[:, 0] + x[:, 1] - x[:, 2]))) == 0
    turned = positions(chain, line + 40 * TURN) - x
    np.testing.assert_allclose(turned / TURN, np.tile([40, -40, 0], (len(x), 1)), atol=1e-13)
    q, d = ca.SX.sym("q", 1), ca.SX.sym("d", 2)
    assert chain.loops is not None
    step = ca.Function("next", [q, d], [values_from_last(closed_chain(chain), q, d)[0][:2]])
    order = [("crank", "pin", "rocker").index(chain.joints[k].name) for k in chain.loops.dependent]
    np.testing.assert_allclose(
        np.asarray(step(line[-1], x[-2, order])).ravel(), x[-1, order], atol=1e-13
    )


@pytest.mark.parametrize(
    ("length", "limits"),
    [
        (0.35, ""),  # the two bars become a straight line before a whole turn
        (0.12, '<limit lower="-9" upper="9" velocity="1" effort="1"/>'),  # the pin runs out
    ],
)
def test_other_cranks_keep_a_range(length: float, limits: str) -> None:
    """Property: a crank that meets a singular posture, or takes a joint to its limits after some
    turns, has finite limits, and NaN beyond the posture.
    """
    chain = four_bar(length, limits)
    (crank,) = chain.coordinates
    assert crank.lower is not None
    assert crank.upper is not None
    assert crank.upper - crank.lower <= TURN + 1e-4
    assert chain.loops is not None
    assert chain.loops.turns == ()
    q = ca.SX.sym("q", 1)
    values = ca.Function("v", [q], [seed_values(closed_chain(chain), q)[0]])
    assert np.isfinite(np.asarray(values(crank.upper))).all()
    if not limits:
        assert np.isnan(np.asarray(values(3.0))).any()
