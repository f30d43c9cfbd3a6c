"""Settings of virtual robots for tests."""

from dataclasses import replace

import numpy as np

from runtime.simulation.settings import VirtualFriction, VirtualRobotSettings


def frictionless(settings: VirtualRobotSettings) -> VirtualRobotSettings:
    """The settings without friction; speeds and strokes that divide stay above zero."""
    n = len(settings.rotor)
    none = {key: np.zeros(n) for key in VirtualFriction.__dataclass_fields__}
    none |= {"stribeck_speed": np.ones(n), "dahl_stroke": np.ones(n)}
    return replace(settings, friction=VirtualFriction(**none))
