"""Gains of torque sensors and drives, from a run without and a run with a known payload."""

from runtime.identification.sensor_gains.estimate import Gains, identify_gains

__all__ = ["Gains", "identify_gains"]
