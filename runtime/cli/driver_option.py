"""The option --driver: the robot that a command runs on."""

import numpy as np

from runtime.campaign.driver import Driver
from runtime.campaign.drivers import DRIVERS
from runtime.campaign.drivers.driver_kind import DriverSettings
from runtime.cli.common import numbers_option
from runtime.library import Library


def opened_driver(
    lib: Library, text: str, gains: str | None, seed: int = 0, truth_seed: int = 0
) -> Driver:
    """Driver of --driver.

    Args:
        lib: the robot.
        text: NAME or NAME:ADDRESS.
        gains: value of --gains, one number per joint with commas [N·m/A].
        seed: of the noise of the virtual robot.
        truth_seed: of its links and sensors.

    Returns:
        The driver, connected.

    Raises:
        RuntimeFault: the name is unknown, a library is missing, or the robot does not answer.
    """
    name, _, address = text.partition(":")
    known = None if gains is None else np.array(numbers_option(gains, lib.n_joints, "--gains"))
    return DRIVERS[name].open(lib, DriverSettings(address, seed, truth_seed, known))
