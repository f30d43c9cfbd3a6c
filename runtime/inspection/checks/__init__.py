"""Checks of a log, one module per check."""
