"""The driver of Universal Robots by the maker's protocol: ur_rtde itself against a socket."""

import os
from contextlib import ExitStack

import numpy as np
import pytest

from runtime.campaign.driver import Driver
from runtime.campaign.drivers import DRIVERS, DriverSettings
from runtime.campaign.guards import ClockGuard
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import Trajectory, sample_times
from runtime.excitation.way import way_to
from runtime.library import Library, load
from tests.runtime.rtde_server import Served, controller

for module in ("rtde_control", "rtde_receive"):
    pytest.importorskip(module)

GAINS = np.array([11.0, 11.0, 11.0, 7.5, 7.5, 7.5])
SERVO_STOP, STOP_SCRIPT = 16, 255
"""Commands of the program of ur_rtde 1.6."""


@pytest.fixture(scope="module")
def arm() -> Library:
    return load("ur5e")


@pytest.fixture(scope="module")
def motion(arm: Library) -> Trajectory:
    """0.1 rad of the last joint, 0.6 s."""
    aside = np.where(np.arange(6) == 5, 0.1, 0.0)
    way = way_to(arm, arm.home, arm.home + aside, Safety(), 0.5).trajectory
    assert way is not None
    return way


@pytest.fixture
def opened(arm: Library):
    """Opens the driver on a controller whose address no other process of the tests has."""
    made = []

    def make(**words: int) -> tuple[Driver, Served]:
        address = f"127.{os.getpid() % 250 + 1}.{os.getpid() // 250 % 250}.{len(made) + 7}"
        served = stack.enter_context(controller("ur5e", address, GAINS, **words))
        made.append(DRIVERS["ur"].open(arm, DriverSettings(address, gains=GAINS)))
        return made[-1], served

    with ExitStack() as stack:
        yield make
        # Before the controllers go away, at which a thread of ur_rtde would end the process.
        for driver in made:
            if driver._receive.isConnected():
                driver.close()


def test_set_points_and_states_are_those_of_the_protocol(opened, arm, motion) -> None:
    """Oracle: registers decoded by the published protocol; τ is that of the sampled state."""
    driver, served = opened()
    assert driver.rate_hz == 500.0
    done = driver.stream(motion)
    assert done.stop is None
    driver.close()
    points, calls = served.received()
    wanted = motion.at(arm, sample_times(motion.duration, 500.0))[0]
    np.testing.assert_array_equal(points, wanted)  # doubles on both sides
    assert calls[-2:] == [SERVO_STOP, STOP_SCRIPT]
    q, dq, tau = (np.array([getattr(s, k) for s in done.samples]) for k in ("q", "dq", "tau"))
    known = {row.tobytes() for row in (arm.home, *wanted)}
    assert {row.tobytes() for row in q} <= known
    # K (τ / K): one rounding each.
    np.testing.assert_allclose(tau, arm.bias_forces(q, dq, arm.pi0), rtol=1e-13, atol=1e-13)
    # On a loaded computer states come late, and some of them twice.
    assert (np.diff([s.t for s in done.samples]) >= 0).all()


def test_a_protective_stop_ends_the_motion(opened, motion) -> None:
    """Property: the sentence names the pendant, and samples up to the stop are kept."""
    driver, _ = opened(protective_at=100)
    done = driver.stream(motion)
    assert done.stop is not None
    assert done.stop.guard == "connection"
    assert "see the message on its teach pendant" in done.stop.sentence
    # The stop is seen in the state of the next period, or of the one after.
    assert 90 <= len(done.samples) <= 110


def test_data_that_cease_are_stale(opened, motion) -> None:
    """Property: with the connection open, the clock that stands is refused."""
    driver, _ = opened(silent_at=100)
    done = driver.stream(motion, guards=[ClockGuard(driver.rate_hz, late=1e9)])
    assert done.stop is not None
    assert (done.stop.guard, len(done.samples) <= 110) == ("clock", True)
    assert "expected a newer sample" in done.stop.sentence


class Lost:
    """Control interface of ur_rtde that cannot connect again: it raises what the dashboard said."""

    def __getattr__(self, name: str):
        def call(*_: object) -> bool:
            if name in ("servoJ", "servoStop"):
                raise RuntimeError("20225500001")
            return True

        return call


def test_a_reconnection_that_fails(opened, motion) -> None:
    """Property: what ur_rtde raises then is a stop with one sentence, and braking raises nothing.

    Seen with ur_rtde 1.6.5, whose reconnection reads the answer to another question.
    """
    driver, _ = opened()
    control, driver._control = driver._control, Lost()
    done = driver.stream(motion)
    driver._control = control
    assert done.stop is not None
    assert done.stop.sentence.startswith("the connection by RTDE was lost (20225500001)")
