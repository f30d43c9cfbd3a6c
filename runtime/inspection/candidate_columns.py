"""Friction columns among which the default friction model is chosen."""

DEFAULT_COLUMNS = ("offset", "viscous", "coulomb", "rotor")
"""Columns of the candidates without memory."""
MEMORY = "dahl"
"""Column that replaces "coulomb" where friction depends on the path."""
