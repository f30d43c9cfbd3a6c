"""Poses at rest that determine the gravity parameters of a robot."""
