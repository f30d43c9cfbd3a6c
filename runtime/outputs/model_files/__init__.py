"""Identified parameters → URDF, MJCF, SDF, USD, franka_description YAML and a C header."""
