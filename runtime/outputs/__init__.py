"""Outputs for users: reports, model files, the 3D viewer."""
