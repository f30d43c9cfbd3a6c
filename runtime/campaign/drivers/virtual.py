"""The virtual robot as a driver by name."""

from runtime.campaign.driver import Driver
from runtime.campaign.drivers.driver_kind import DriverKind, DriverSettings
from runtime.errors import SimulationError
from runtime.library import Library


def _open(lib: Library, settings: DriverSettings) -> Driver:
    if settings.address:
        raise SimulationError(
            f"the virtual robot has no address, got '{settings.address:.40}'; give --driver virtual"
        )
    from runtime.campaign.virtual_driver import VirtualDriver

    return VirtualDriver(lib, seed=settings.seed, truth_seed=settings.truth_seed)


VIRTUAL = DriverKind("virtual", "the virtual robot, the default", _open)
