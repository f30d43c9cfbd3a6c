"""Motion of a free base: rows of an uneven clock come onto a uniform one, others stay."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from runtime.recording import Recording
from runtime.recording.free_base import Contacts, FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import (
    _base_rates,
    _unknown_between,
    _with_lag,
    motion_of,
)


def swaying(t: np.ndarray) -> FreeBaseRecording:
    """A base on a sine of 0.5 Hz without turning; its one wrench is known until 3 s."""
    wave = np.sin(np.pi * t)
    wrench = np.where(t[:, None] < 3.0, wave[:, None] * np.ones(6), np.nan)
    contacts = Contacts(("foot",), np.zeros((1, 3)), wrench[:, None], "link")
    turns = np.tile(np.eye(3), (len(t), 1, 1))
    return FreeBaseRecording(
        "log", t, wave[:, None], (), turns, np.outer(wave, [1.0, 0.0, 2.0]), contacts
    )


@pytest.mark.parametrize("jitter", [2e-3, 2e-4])
@pytest.mark.parametrize("cutoff", [None, 10.0])
def test_an_uneven_clock_becomes_uniform(cutoff, jitter):
    """Oracle: the sine at the instants of the new clock; unknown wrenches stay unknown.

    Steps deviate by up to 40 or 4 %, where 1 % is allowed.
    Straight lines between samples 10 ms apart miss (ω h)²/8 = 1.2e-4 of a sine of 0.5 Hz.
    """
    t = np.arange(601) / 100.0
    t[1:-1] += np.random.default_rng(1).uniform(-jitter, jitter, 599)
    motion = motion_of(swaying(t), ("joint",), cutoff)
    np.testing.assert_allclose(motion.t, np.arange(601) / 100.0, atol=1e-9)
    wave = np.sin(np.pi * motion.t[:, None])
    inner = slice(60, -60)
    np.testing.assert_allclose(motion.q[inner][:, [0, 6]], wave[inner] * [1, 1], atol=5e-4)
    unknown = np.isnan(motion.contacts.wrench[:, 0, 0])
    # The nearest logged row decides, 2 ms before or after its place.
    np.testing.assert_array_equal(unknown[:299], False)
    np.testing.assert_array_equal(unknown[302:], True)


def test_a_uniform_clock_stays():
    """Oracle: rows of a uniform clock, stamped within 1 % of a step, come out as they are."""
    t = np.arange(601) / 100.0 + 4e-5 * (np.arange(601) % 2)
    log = swaying(t)
    motion = motion_of(log, ("joint",))
    np.testing.assert_array_equal(motion.t, t)
    np.testing.assert_array_equal(motion.q[:, :3], log.position)
    np.testing.assert_array_equal(motion.contacts.wrench, log.contacts.wrench)


def stepping(t: np.ndarray, lifted: slice | np.ndarray) -> FreeBaseRecording:
    """A base that stands on a foot without a sensor; its torque is 1, and −1 while it is lifted."""
    log = swaying(t)
    wrench = np.full((len(t), 1, 6), np.nan)
    wrench[lifted] = 0.0
    tau = np.ones((len(t), 1))
    tau[lifted] = -1.0
    contacts = replace(log.contacts, wrench=wrench, sensed=np.ones((len(t), 1)))
    return replace(log, contacts=contacts, tau=tau)


@pytest.mark.parametrize("uneven", [False, True])
def test_no_filter_crosses_a_change_of_what_is_unknown(uneven):
    """Oracle: a force that the equations do not contain stays out of rows of another contact state.

    Tolerance: constants pass the zero-phase filter to rounding.
    """
    t = np.arange(601) / 100.0
    if uneven:
        t[1:-1] += np.random.default_rng(1).uniform(-2e-3, 2e-3, 599)
    motion = motion_of(stepping(t, (t > 2.0) & (t < 4.0)), ("joint",), 10.0)
    unknown = np.isnan(motion.contacts.wrench[:, 0, 0])
    assert len(motion) == 601
    np.testing.assert_allclose(motion.tau[~unknown], -1.0, atol=1e-9)
    if not uneven:  # rows interpolated between two states count as unknown
        np.testing.assert_allclose(motion.tau[unknown], 1.0, atol=1e-9)
    known = swaying(np.arange(601) / 100.0)
    motion = motion_of(known, ("joint",), 10.0)
    kept = ~np.isnan(motion.contacts.wrench[:, 0, 0])
    # A sine of 0.5 Hz passes 10 Hz unchanged; odd extension at the border keeps value and slope.
    np.testing.assert_allclose(
        motion.contacts.wrench[kept, 0, 0], np.sin(np.pi * motion.t[kept]), atol=2e-3
    )


def test_short_stretches_between_gaps_are_left_out():
    """Oracle: the log without the three rows between two gaps."""
    whole = np.arange(601) / 100.0
    t = np.concatenate([whole[:250], whole[300:303], whole[350:]])
    lone = np.concatenate([whole[:250], whole[350:]])
    motion = motion_of(swaying(t), ("joint",), 10.0)
    expected = motion_of(swaying(lone), ("joint",), 10.0)
    np.testing.assert_allclose(motion.t, expected.t, atol=1e-9)
    np.testing.assert_allclose(motion.q, expected.q, atol=1e-9)
    np.testing.assert_array_equal(motion.contacts.wrench, expected.contacts.wrench)


def test_an_uneven_clock_needs_memory_of_the_log_only():
    """Property: 6000 rows take less than 2 kB each; a table of all pairs of rows takes 288 MB."""
    t = np.arange(6000) / 100.0
    t[1:-1] += np.random.default_rng(1).uniform(-2e-3, 2e-3, 5998)
    log = swaying(t)
    tracemalloc.start()
    try:
        motion_of(log, ("joint",))
        assert tracemalloc.get_traced_memory()[1] < 2000 * 6000
    finally:
        tracemalloc.stop()


def test_twist_of_a_turning_base() -> None:
    """Oracle: Ṙ = R [ω×], R̈ = R ([ω×]² + [α×]), ṗ = R v, p̈ = R (v̇ + ω × v)."""
    w, a, v, dv = np.random.default_rng(0).normal(size=(4, 5, 3))
    turn = Rotation.random(5, random_state=0).as_matrix()
    cross_w, cross_a = (np.cross(x[:, None], np.eye(3)).swapaxes(1, 2) for x in (w, a))
    velocity = np.einsum("nij,nj->ni", turn, v)
    acceleration = np.einsum("nij,nj->ni", turn, dv + np.cross(w, v))
    rates = turn @ cross_w, turn @ (cross_w @ cross_w + cross_a)
    twist, change = _base_rates(turn, *rates, velocity, acceleration)
    np.testing.assert_allclose(twist, np.hstack([v, w]), atol=1e-13)
    np.testing.assert_allclose(change, np.hstack([dv, a]), atol=1e-13)


def test_an_instant_between_rows_is_unknown_where_either_row_is() -> None:
    """Oracle: by hand; an instant on a row takes that row alone."""
    t, unknown = np.array([1.0, 2.0, 3.0]), np.array([[True], [False], [False]])
    for order in (1, -1):
        found = _unknown_between(t, unknown[::order], np.arange(1.0, 3.1, 0.5))
        assert found[::order, 0].tolist() == [True, True, False, False, False]


def test_motion_and_torques_have_the_lag_of_the_sensors() -> None:
    """Oracle: behind a first-order low-pass a ramp is late by 1 / (2 π f); the readings are not.

    Bilinear: (π f h)²/3 = 3e-4 of the lag.
    """
    t = np.arange(600) / 100.0
    contacts = replace(swaying(t).contacts, cutoff_hz=1.0)
    ramps = np.outer(t, [1.0, -2.0, 3.0, -4.0, 5.0])
    blocks = {
        "q": ramps[:, :2],
        "wrench": ramps[:, 2:3],
        "sensed": ramps[:, 3:4],
        "tau": ramps[:, 4:],
    }
    late = _with_lag(contacts, Recording(t, ramps), blocks)
    lag = np.array([1.0, 1.0, 0.0, 0.0, 1.0]) / (2 * np.pi)
    np.testing.assert_allclose(late[-1], ramps[-1] * (1 - lag / t[-1]), rtol=3e-5)
