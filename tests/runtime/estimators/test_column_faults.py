"""Faults of the columns of a log, compared by what each explains."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.estimators import column_faults as faults
from runtime.estimators.column_faults import column_faults
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

WRIST = 6


@pytest.fixture(scope="module")
def samples(lib: Library) -> Samples:
    """Twenty seconds of an FR3 with friction, gains that are off, and noise."""
    rng = np.random.default_rng(3)
    t = np.arange(400)[:, None] * 0.05
    waves = rng.uniform(1.0, 3.0, lib.n_joints)
    q = lib.home + 0.5 * np.sin(waves * t + np.arange(lib.n_joints))
    dq = 0.5 * waves * np.cos(waves * t + np.arange(lib.n_joints))
    ddq = -(waves**2) * (q - lib.home)
    tau = rng.uniform(0.6, 1.5, lib.n_joints) * lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    tau += 0.3 * np.tanh(dq / 0.05) + 0.1 * dq + 0.1 * rng.normal(size=q.shape)
    return Samples(q, dq, ddq, tau, np.zeros((*q.shape, 0)))


def signed(samples: Samples, *joints: int) -> Array:
    return np.where(np.isin(np.arange(samples.q.shape[1]), joints), -1.0, 1.0)


def test_the_log_as_it_is(lib: Library, samples: Samples) -> None:
    """Property: no fault, and every sign of the wrist would be seen."""
    seen = column_faults(lib, samples)
    assert seen.named == ()
    assert not [f for f in seen.hidden if f.kind == faults.TORQUE_SIGN]
    assert np.nanmax(seen.left) < faults.GOOD


@pytest.mark.parametrize("joints", [(WRIST,), (1, 4)])
def test_signs_of_torques(lib: Library, samples: Samples, joints: tuple[int, ...]) -> None:
    """Property: also of a wrist joint whose torque is friction, and of two joints at once."""
    seen = column_faults(lib, replace(samples, tau=samples.tau * signed(samples, *joints)))
    assert {f.kind for f in seen.named} == {faults.TORQUE_SIGN}
    assert sorted(j for f in seen.named for j in f.joints) == list(joints)


def test_sign_of_a_position(lib: Library, samples: Samples) -> None:
    """Property: the torques of other joints tell it from the sign of a torque."""
    sign = signed(samples, 4)
    parts = {key: getattr(samples, key) * sign for key in ("q", "dq", "acceleration")}
    seen = column_faults(lib, replace(samples, **parts))
    assert [(f.kind, f.joints) for f in seen.named] == [(faults.POSITION_SIGN, (4,))]


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4, 6, 5], [1, 2, 3, 0, 4, 5, 6]])
def test_orders_of_torques(lib: Library, samples: Samples, order: list[int]) -> None:
    """Property: wrist joints exchanged, and four columns moved on by one."""
    seen = column_faults(lib, replace(samples, tau=samples.tau[:, np.argsort(order)]))
    assert [(f.kind, f.order) for f in seen.named] == [(faults.TORQUE_ORDER, tuple(order))]


def test_what_a_log_does_not_show(lib: Library, samples: Samples) -> None:
    """Property: a joint at rest has no sign, a torque that is noise accuses nobody."""
    still = np.where(np.arange(lib.n_joints) == WRIST, 0.0, 1.0)
    tau = samples.tau.copy()
    tau[:, 4] = np.random.default_rng(0).normal(size=len(tau))
    parts = {"dq": samples.dq * still, "acceleration": samples.ddq * still, "tau": tau}
    seen = column_faults(lib, replace(samples, **parts))
    assert seen.named == ()
    assert np.isnan(seen.left[:, WRIST]).all()
    assert (seen.left[:, 4] > faults.GOOD).all()
