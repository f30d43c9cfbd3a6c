"""Drives: delay of the torque, encoder biases, rotor inertia and friction with their posterior."""
