"""Rigid-body mechanics on CasADi symbols and numbers."""
