"""The option --driver: the robot that a command runs on."""

import numpy as np

from runtime.campaign.driver import Driver
from runtime.campaign.drivers import DRIVERS, DriverSettings
from runtime.cli.common import numbers_option
from runtime.library import Library


def opened_driver(
    lib: Library, text: str, gains: str | None, seed: int = 0, truth_seed: int = 0
) -> Driver:
    """Driver of --driver."""
    name, _, address = text.partition(":")
    known = None if gains is None else np.array(numbers_option(gains, lib.n_joints, "--gains"))
    return DRIVERS[name].open(lib, DriverSettings(address, seed, truth_seed, known))
