"""Friction columns among which the default friction model is chosen."""

from runtime.recording.friction_column import SPRING

DEFAULT_COLUMNS = ("offset", "viscous", "coulomb", "rotor")
"""Columns of the candidates without memory."""
MEMORY = "dahl"
"""Column that replaces "coulomb" where friction depends on the path."""
SPRINGS = SPRING
"""Word for the columns of all springs of unknown stiffness, which every candidate has."""
USABLE = (*DEFAULT_COLUMNS, MEMORY, SPRINGS)
"""Columns of a method that can use all of them."""
