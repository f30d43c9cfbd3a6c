"""Drivers by name: the virtual robot, ROS 2, Franka arms by libfranka, arms of Universal Robots.

The libraries of the makers are imported when a driver is opened. Another package adds a driver by
an entry point of the group "symgen.drivers".
"""

from runtime.campaign.drivers.driver_kind import DriverKind
from runtime.registry import Registry

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
"""Drivers by name."""
