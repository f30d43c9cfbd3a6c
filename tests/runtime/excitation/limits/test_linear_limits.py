"""Limits that are linear in the coefficients: home, grid, shares; limits that are not checked."""

from types import SimpleNamespace

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import Limits
from runtime.excitation.limits.distance_limits import TipBox, TipSpeed
from runtime.excitation.limits.nonlinear_limits import DependentJoints
from runtime.excitation.limits.safety import RATE, unchecked
from runtime.excitation.motion.trajectory import COSINE
from runtime.library import Library


def test_a_home_on_its_limit_is_refused(lib: Library) -> None:
    """Property: from an end of its range a joint cannot move to both sides."""
    for key in ("lower", "upper"):
        home = lib.home.copy()
        home[3] = lib.limits()[key][3]
        with pytest.raises(IdentificationError, match=f"of joint '{lib.joint_names[3]}' is not"):
            Limits(lib, home, 2, 4.0)


def test_the_share_of_the_limits_on_the_grid_of_the_document(lib: Library) -> None:
    """Oracle: largest shares over 41 instants, a tenth of a second apart, as Sec. 3.4.2 states."""
    a = 0.1 * np.random.default_rng(0).normal(size=(lib.n_joints, 2))
    limits = lib.limits()
    phi = COSINE.at(lib, 2, np.linspace(0.0, 4.0, 41), 4.0)
    q, dq, ddq = (phi[..., k] @ a.T for k in range(3))
    room = np.where(q > 0, limits["upper"] - lib.home, lib.home - limits["lower"])
    share = Limits(lib, lib.home, 2, 4.0).use(a)
    np.testing.assert_allclose(share["position"], (np.abs(q) / room).max(axis=0), rtol=1e-14)
    np.testing.assert_allclose(share["velocity"], np.abs(dq).max(axis=0) / limits["velocity"])
    fastest = np.abs(ddq).max(axis=0)
    np.testing.assert_allclose(share["acceleration"], fastest / limits["acceleration"])


def test_one_stated_torque_rate_is_named_where_it_is_not_checked() -> None:
    """Property: without `safety` every limit that a joint states is named as not checked."""
    for rate, is_named in (([np.inf, 10.0], True), ([np.inf, np.inf], False)):
        limits = {"torque_rate": np.array(rate), "tip_speed": np.inf}
        robot = SimpleNamespace(
            limits=lambda limits=limits: limits,
            braking=None,
            manifest=SimpleNamespace(coupling=None),
        )
        assert (RATE in unchecked(robot, None)) == is_named


def test_the_rise_of_a_tip_at_rest_is_finite() -> None:
    """Oracle: rise of (v² − 1)/2 by v · d²v/dt² + (dv/dt)² over the squared limit, at rest too."""
    v, dv, ddv = np.array([0.0, 1.0]), np.array([0.5, 0.5]), np.array([3.0, 3.0])
    bounds = SimpleNamespace(tip=(None, v, dv, ddv), bend=lambda second: second)
    rise = TipSpeed.rise(SimpleNamespace(limit=2.0), bounds)
    np.testing.assert_allclose(rise, [[0.25 / 4], [3.25 / 4]], rtol=1e-9)


def test_a_value_of_the_box_of_the_tip_as_a_coordinate(lib: Library) -> None:
    """Oracle: the tip of the library, at each of the six sides."""
    q = lib.home[None] + 0.3
    tip, ends = lib.tip_motion(q, 0 * q)[0][0], np.array([0.4, 0.5, 0.6])
    box = TipBox(lib, tip - ends, tip + 2 * ends)
    for row, g in enumerate(box.values(np.stack([q, 0 * q]))[0]):
        place, end, unit = box.measured(row, g)
        assert place == pytest.approx(tip[row % 3], abs=1e-12)
        assert (end, unit) == (np.concatenate([box.upper, box.lower])[row], "m")


def test_slopes_of_a_joint_that_follows_a_product() -> None:
    """Closed form: x = q1 q2 has ∂x/∂q = (q2, q1) and ∂(dx/dt)/∂q = (dq2, dq1)."""

    def product(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> tuple[np.ndarray, ...]:
        other = slice(None, None, -1)
        ddx = np.sum(ddq * q[:, other] + dq * dq[:, other], axis=1)
        return q.prod(axis=1)[:, None], np.sum(dq * q[:, other], axis=1)[:, None], ddx[:, None]

    q, dq = np.random.default_rng(0).normal(size=(2, 5, 2))
    slopes = DependentJoints(SimpleNamespace(motion_or_nan=product), (0,)).slopes(q, dq)
    np.testing.assert_allclose(slopes[:, 0, 1], q[:, ::-1], rtol=1e-12)
    np.testing.assert_allclose(slopes[:, 0, 0], dq[:, ::-1], rtol=1e-12)
