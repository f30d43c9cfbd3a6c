"""Gains of torque sensors and drives, from a run without and a run with a known payload."""
