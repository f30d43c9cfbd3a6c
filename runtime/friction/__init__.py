"""Joint friction, linear in its coefficients: columns of the motion times φ."""

from runtime.friction.columns import COLUMNS, Motion, add_columns, columns, renewed_rotor, torque
from runtime.friction.mechanics import gravity_load, separate_rotors

__all__ = [
    "COLUMNS",
    "Motion",
    "add_columns",
    "columns",
    "gravity_load",
    "renewed_rotor",
    "separate_rotors",
    "torque",
]
