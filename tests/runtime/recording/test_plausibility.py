"""plausibility: recordings that contradict the robot are refused, the others pass."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.library import Library
from runtime.recording.consistency import BEYOND_LIMIT, require_plausible


def test_good_recordings_pass(
    lib: Library, noisy: Recording, ideal_runs: tuple[Recording, ...], panda: Recording
) -> None:
    """Property, real data: nothing is said about recordings that are as they should be."""
    for recording in (noisy, *ideal_runs, panda):
        require_plausible(recording, lib)


def changed(recording: Recording, **factors: float) -> Recording:
    return recording.replace(**{k: f * getattr(recording, k) for k, f in factors.items()})


def test_degrees_in_all_signals(lib: Library, noisy: Recording) -> None:
    """Property: where q and dq agree with each other, the limits still tell degrees."""
    degree = 180 / np.pi
    with pytest.raises(IdentificationError, match=r"'fr3_joint6' moves from 3\d.* state unit"):
        require_plausible(changed(noisy, q=degree, dq=degree, ddq=degree), lib)


def test_one_joint_with_an_offset(lib: Library, noisy: Recording) -> None:
    """Property: the joint that lies farthest outside is the one that is named."""
    q = noisy.q.copy()
    q[:, 1] += np.pi
    with pytest.raises(IdentificationError, match="joint 'fr3_joint2' moves from"):
        require_plausible(noisy.replace(q=q), lib)


@given(st.floats(0.0, 2.0), st.booleans())
def test_limits_may_be_overrun_by_a_little(
    lib: Library, noisy: Recording, beyond: float, upper: bool
) -> None:
    """Property: refused exactly beyond BEYOND_LIMIT, on both sides."""
    limits, q = lib.limits(), np.tile(lib.home, (len(noisy), 1))
    q[-1, 0] = limits["upper"][0] + beyond if upper else limits["lower"][0] - beyond
    recording = noisy.replace(q=q, tau=lib.inverse_dynamics(q, 0 * q, 0 * q, lib.pi0))
    if abs(beyond - BEYOND_LIMIT) < 1e-9:
        return
    if beyond > BEYOND_LIMIT:
        with pytest.raises(IdentificationError, match="'fr3_joint1' moves"):
            require_plausible(recording, lib)
    else:
        require_plausible(recording, lib)


def test_negated_torque(lib: Library, noisy: Recording, panda: Recording) -> None:
    """Property, real data: torque against gravity is told as a sign, simulated or measured."""
    for recording in (noisy, panda):
        with pytest.raises(IdentificationError, match=r"opposite sign \(set sign = -1"):
            require_plausible(changed(recording, tau=-1.0), lib)


def test_a_torque_without_sign(lib: Library, noisy: Recording) -> None:
    """Property: a torque against gravity that is never positive has lost its sign."""
    with pytest.raises(IdentificationError, match="7 joints is ever positive: the register or"):
        require_plausible(noisy.replace(tau=np.minimum(-noisy.required("tau"), 0.0)), lib)


def test_other_joints_and_no_torque(lib: Library, noisy: Recording) -> None:
    """Property: joint count, missing torque and silent torque are one sentence each."""
    q = noisy.q[:, :6]
    with pytest.raises(IdentificationError, match="6 joints, the robot 'fr3' has 7"):
        require_plausible(Recording(noisy.t, q, tau=q), lib)
    with pytest.raises(IdentificationError, match="has no torque"):
        require_plausible(noisy.replace(tau=None), lib)
    with pytest.raises(IdentificationError, match="is 0 throughout"):
        require_plausible(changed(noisy, tau=0.0), lib)


def test_a_clock_too_slow_to_differentiate(lib: Library, noisy: Recording) -> None:
    """Property: milliseconds taken for seconds are told even where no dq contradicts them."""
    slow = noisy.replace(t=1000 * noisy.t, dq=None, ddq=None)
    with pytest.raises(IdentificationError, match=r"rate of 0.1 Hz .* time is in ms"):
        require_plausible(slow, lib)
    require_plausible(noisy.replace(dq=None, ddq=None), lib)


def test_recordings_of_a_robot_without_gravity_torque_pass(lib: Library, noisy: Recording) -> None:
    """Property: torque that is not like gravity at all says nothing about its sign."""
    rng = np.random.default_rng(0)
    require_plausible(noisy.replace(tau=rng.normal(size=noisy.q.shape)), lib)
