"""The robot moved to the start of a motion, under guards."""

from collections.abc import Callable

import numpy as np

from runtime.campaign.driver import START, Driver
from runtime.campaign.guards import usual_guards
from runtime.errors import IdentificationError
from runtime.excitation import Safety
from runtime.excitation.approach.way import way_to
from runtime.excitation.proof.certified_motion import slowed
from runtime.library import Array

NEAR = START / 2
"""Distance from the start below which a robot stays where it is [rad, m]."""


def move_to(
    driver: Driver,
    start: Array,
    safety: Safety,
    speed: float = 0.1,
    say: Callable[[str], None] = lambda _: None,
) -> None:
    """Let the robot follow a certified way from where it stands.

    start (n,) [rad, m].
    """
    here = driver.state().q
    if not np.abs(here - start).max() > NEAR:
        return
    way = way_to(driver.lib, here, start, safety).trajectory
    if way is None:
        return
    slow = slowed(way, speed)
    say(f"the robot moves to the start, {slow.duration:.3g} s at {100 * speed:g} % speed")
    done = driver.stream(slow, guards=usual_guards(driver.lib, driver.rate_hz))
    if done.stop is not None:
        raise IdentificationError(
            f"the way to the start was stopped after {done.stop.seconds:.3f} s by "
            f"{done.stop.guard} ({done.stop.sentence}); clear the way and repeat the command"
        )
