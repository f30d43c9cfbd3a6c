"""Springs and torque curves of a pendulum by hand."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from symgen.chain import read_chain
from symgen.chain.mechanism import KnownTorque, Spring
from symgen.errors import UrdfError
from symgen.mechanics.passive import known_torque, spring_columns
from tests.conftest import TINY_URDF

Q = np.array([-0.9, -0.2, 0.3, 0.7, 1.6])


def torque(springs: tuple[Spring, ...] = (), curves: tuple[KnownTorque, ...] = ()) -> np.ndarray:
    """Known torque of the pendulum and columns of its springs, (N, 1 + s)."""
    chain = read_chain(TINY_URDF)
    mechanism = chain.mechanism.replace(spring=springs, known_torque=curves)
    q = ca.SX.sym("q", 1)
    chain = replace(chain, mechanism=mechanism)
    both = ca.horzcat(known_torque(chain, q), spring_columns(chain, q))
    return np.asarray(ca.Function("both", [q], [both]).map(len(Q))(Q[None])).reshape(len(Q), -1)


def test_springs_along_a_joint() -> None:
    """Oracle: x = 2 q, so τ = k (2 q − rest) · 2; a column for the unknown k alone."""
    along = Spring("s", of={"swing": 2.0}, rest=0.4, stiffness=7.0)
    both = torque((along, along.replace(stiffness=None, rest=-0.1)))
    np.testing.assert_allclose(both[:, 0], 7.0 * (2 * Q - 0.4) * 2, rtol=1e-14)
    np.testing.assert_allclose(both[:, 1], (2 * Q + 0.1) * 2, rtol=1e-14)


def test_a_spring_between_points() -> None:
    """Oracle: law of cosines; the hinge is 0.5 m above the base, the rod's point 0.3 m up it.

    x² = a² + b² + 2 a b cos q of a point of the base that is a = 0.4 m below the hinge.
    """
    a, b = 0.4, 0.3
    between = Spring(
        "s", parent="base", child="rod", parent_xyz=(0.0, 0.0, 0.1), child_xyz=(0.0, 0.0, b),
        rest=0.2, stiffness=50.0,
    )  # fmt: skip
    x = np.sqrt(a**2 + b**2 + 2 * a * b * np.cos(Q))
    expected = 50.0 * (x - 0.2) * (-a * b * np.sin(Q) / x)
    np.testing.assert_allclose(torque((between,))[:, 0], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        (KnownTorque({"swing": 2.0}, polynomial=(1.0, -3.0, 0.5)), 1 - 3 * 2 * Q + 0.5 * 4 * Q**2),
        (
            KnownTorque({"swing": 2.0}, x=(-1.0, 0.0, 2.0), torque=(4.0, 1.0, 2.0)),
            np.interp(2 * Q, [-1.0, 0.0, 2.0], [4.0, 1.0, 2.0]),
        ),
    ],
    ids=["polynomial", "points"],
)
def test_curves(curve: KnownTorque, expected: np.ndarray) -> None:
    """Oracle: the polynomial, or numpy's interpolation that is constant beyond; ∂x/∂q = 2."""
    np.testing.assert_allclose(torque(curves=(curve,))[:, 0], 2 * expected, rtol=1e-12)


@pytest.mark.parametrize("child_xyz", [(0.0, 0.3, 0.0), (0.1, 0.2, 0.0)])
def test_a_distance_that_no_joint_changes_is_refused(child_xyz: tuple[float, ...]) -> None:
    """Property: a point of the base on the axis of the joint keeps its distance, whether the other
    point is on the axis, too, or turns about it.
    """
    on_axis = Spring(
        "s", parent="base", child="rod", parent_xyz=(0.0, 0.1, 0.5), child_xyz=child_xyz
    )
    with pytest.raises(UrdfError, match="whose distance no joint changes"):
        torque((on_axis,))
