"""Joint friction, linear in its coefficients: columns of the motion times φ."""

from runtime.recording.friction.columns import OFFSET, ROTOR, dahl_state, gravity_load, spring_names
from runtime.recording.friction.coupled_motors import (
    Coupling,
    coupling_of,
    coupling_of_terms,
    directions,
    geared,
    spread,
)
from runtime.recording.friction.model import (
    DRIVE,
    add_columns,
    columns,
    completed,
    default_terms,
    left_out_note,
    motion_of,
    renewed_rotor,
    torque,
    unresolved,
    without_columns,
)
from runtime.recording.settings import (
    COLUMNS,
    FrictionColumn,
    JointMotion,
    has_memory,
    names_where,
    signals_for,
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
    "has_memory",
    "left_out_note",
    "motion_of",
    "names_where",
    "renewed_rotor",
    "signals_for",
    "spread",
    "spring_names",
    "torque",
    "unresolved",
    "without_columns",
]
