"""Joint friction, linear in its coefficients: columns of the motion times φ."""

from runtime.recording.friction.columns import OFFSET, ROTOR, gravity_load
from runtime.recording.friction.coupled_motors import (
    Coupling,
    coupling_of,
    coupling_of_terms,
    directions,
    geared,
    spread,
)
from runtime.recording.friction.dahl import dahl_state
from runtime.recording.friction.drive_columns import DRIVE, default_terms
from runtime.recording.friction.model import (
    add_columns,
    columns,
    completed,
    renewed_rotor,
    torque,
)
from runtime.recording.friction.resolution import left_out_note, unresolved, without_columns
from runtime.recording.friction.springs import spring_names
from runtime.recording.friction_column import (
    COLUMNS,
    FrictionColumn,
    JointMotion,
    names_where,
)

__all__ = [
    "COLUMNS",
    "DRIVE",
    "OFFSET",
    "ROTOR",
    "Coupling",
    "FrictionColumn",
    "JointMotion",
    "add_columns",
    "columns",
    "completed",
    "coupling_of",
    "coupling_of_terms",
    "dahl_state",
    "default_terms",
    "directions",
    "geared",
    "gravity_load",
    "left_out_note",
    "names_where",
    "renewed_rotor",
    "spread",
    "spring_names",
    "torque",
    "unresolved",
    "without_columns",
]
