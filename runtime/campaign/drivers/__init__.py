"""Drivers by name: the virtual robot, ROS 2, Franka arms by libfranka, arms of Universal Robots.

The libraries of the makers are imported when a driver is opened. Another package adds a driver by
an entry point of the group "symgen.drivers".
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

import numpy as np

from runtime.campaign.driver import Driver
from runtime.errors import SimulationError
from runtime.library import Array, Library
from runtime.registry import Registry


@dataclass(frozen=True, slots=True)
class DriverSettings:
    """Settings with which a driver is opened."""

    address: str = ""  # text after the colon of --driver; empty for the default
    seed: int = 0  # of the noise of the virtual robot
    truth_seed: int = 0  # of its links and sensors
    gains: Array | None = None  # (n,) N·m/A of drives with measured currents; None if not given


@dataclass(frozen=True, slots=True)
class DriverKind:
    """A driver as users select it."""

    name: str  # word of --driver
    sentence: str  # what it connects to, for help texts
    open: Callable[[Library, DriverSettings], Driver]  # connects to the robot of a library


def imported(module: str, driver: str, remedy: str) -> ModuleType:
    """Module of a maker's library."""
    try:
        return import_module(module)
    except ImportError as error:
        raise SimulationError(
            f"the driver '{driver}' needs {module}, which cannot be imported ({error}); {remedy}"
        ) from None


def require_address(settings: DriverSettings, driver: str, example: str) -> str:
    """Address of the robot."""
    if not settings.address:
        raise SimulationError(
            f"the driver '{driver}' needs the address of the robot; give --driver "
            f"{driver}:{example}"
        )
    return settings.address


def row_of(values: object, lib: Library, what: str) -> Array:
    """Numbers of all joints, as a robot sends them."""
    row = np.array(values, dtype=float)
    if row.shape != (lib.n_joints,):
        raise SimulationError(
            f"expected {lib.n_joints} values of {what} for '{lib.name}', the robot sent "
            f"{row.size}; give the --robot that is connected"
        )
    return row


DRIVERS = Registry(
    "symgen.drivers",
    DriverKind,
    "driver",
    {
        "virtual": "runtime.campaign.drivers.virtual:VIRTUAL",
        "ros2": "runtime.campaign.drivers.ros2:ROS2",
        "libfranka": "runtime.campaign.drivers.libfranka:LIBFRANKA",
        "ur": "runtime.campaign.drivers.ur:UR",
    },
)
