"""Limits of a motion as constraint rows and as checks."""
