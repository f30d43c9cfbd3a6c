"""Bounds that hold at every instant of a motion."""
