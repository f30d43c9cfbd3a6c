"""Robots whose parameters are known, at two distances from reality.

`ideal` and `closed_loop` are quick: physics of the robot's compiled library, white noise. `record`
simulates a real log: physics of MuJoCo, friction beyond the models that are fitted, sensors and a
drive with the faults of real ones.
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
