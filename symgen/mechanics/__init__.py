"""Rigid-body mechanics of a kinematic chain, on CasADi symbols and numbers."""
