"""Joint friction, linear in its coefficients: columns of the motion times φ."""

from runtime.recording.friction.columns import (
    COLUMNS,
    LINEAR,
    Motion,
    add_columns,
    columns,
    completed,
    gravity_load,
    renewed_rotor,
    torque,
)
from runtime.recording.friction.coupled_motors import (
    Coupling,
    coupling_of,
    coupling_of_terms,
    directions,
    geared,
    spread,
)

__all__ = [
    "COLUMNS",
    "LINEAR",
    "Coupling",
    "Motion",
    "add_columns",
    "columns",
    "completed",
    "coupling_of",
    "coupling_of_terms",
    "directions",
    "geared",
    "gravity_load",
    "renewed_rotor",
    "spread",
    "torque",
]
