"""Robots whose parameters are known, at two distances from reality.

`ideal` and `closed_loop` are quick: the compiled library and white noise. `record` simulates a real
log: MuJoCo, friction beyond the models that are fitted, faults of real sensors and drives.
"""

from runtime.excitation.motion.trajectory import sample_times
from runtime.simulation.box_payload import Box, read_payload
from runtime.simulation.closed_loop import closed_loop, ideal
from runtime.simulation.plant import Controller, Plant
from runtime.simulation.settings import settings_of
from runtime.simulation.virtual_robot import record

__all__ = [
    "Box",
    "Controller",
    "Plant",
    "closed_loop",
    "ideal",
    "read_payload",
    "record",
    "sample_times",
    "settings_of",
]
