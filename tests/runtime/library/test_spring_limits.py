"""Torque limits of designs for robots with springs and torque curves."""

import numpy as np
import pytest

from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.safety import SPRINGS, Safety, unchecked
from runtime.excitation.limits.torque_limits import KnownTorque, TorqueLimit
from runtime.excitation.proof.certificate import certificate_of
from runtime.library import Library
from tests.runtime.library.test_coupled_library import motion
from tests.taylor import taylor_slope

MOTION = np.stack([*motion(40)[1:], np.random.default_rng(5).normal(0, 20, (40, 2))])


def test_the_torque_of_springs_counts(wrist: Library) -> None:
    """Oracle: g is |Y π + p(q)| over the limit, which the design reads."""
    torque = next(c for c in constraints(wrist, wrist.home, Safety()) if c.kind == "torque")
    q, dq, ddq = MOTION[:3]
    tau = wrist.inverse_dynamics(q, dq, ddq, wrist.pi0) + wrist.known_torque(q)
    limit = 0.95 * wrist.limits()["effort"]
    assert np.abs(wrist.known_torque(q)).max() > 0.5
    np.testing.assert_allclose(torque.values(MOTION)[:, :2], tau / limit - 1, atol=1e-14)


@pytest.mark.parametrize("order", [0, 1])
def test_slopes_are_derivatives(wrist: Library, order: int) -> None:
    """Derivative: Taylor remainders of h² along random directions, springs included; of the rows
    whose curve has no corner nearby.
    """
    limit = np.array([3.0, 5.0])
    constraint = TorqueLimit(
        order, wrist, wrist.pi0, limit, np.zeros(2), wrist.joint_names, None, KnownTorque(wrist)
    )
    at = MOTION[:, 3:4]
    slopes = constraint.slopes(at)[0]
    step = np.random.default_rng(1).normal(size=(4, 1, 2))
    along = np.einsum("rok,ok->r", slopes, step[: slopes.shape[1], 0])
    decay = taylor_slope(lambda x: constraint.values(x)[0], at, step, along, 1e-2)
    assert decay.decades > 2


def test_the_certificate_holds_the_sum(wrist: Library) -> None:
    """Property: the bound is above the torque of dense samples by less than 1 %, and it is measured
    instead of proven; springs of unknown stiffness are named as not checked.
    """
    a = np.zeros((2, 3))
    a[:, 1] = 0.15, 0.2
    trajectory = Trajectory(wrist.home, a, 4.0)
    safety = Safety()
    proof = certificate_of(wrist, trajectory, safety)
    use = next(use for use in proof.uses if use.kind == "torque")
    q, dq, ddq = trajectory.at(wrist, np.linspace(0, 4, 8001))[:3]
    tau = wrist.inverse_dynamics(q, dq, ddq, wrist.pi0) + wrist.known_torque(q)
    dense = float(np.abs(tau / (0.95 * wrist.limits()["effort"])).max())
    assert dense <= use.bound < 1.01 * dense
    assert not use.is_proven
    assert SPRINGS in unchecked(wrist, safety)
