"""Basis functions and trajectories."""
