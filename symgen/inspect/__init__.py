"""Check of a robot model file: consistency, plausibility, and the nearest consistent file."""
