"""Capsules that enclose the links: their placement, pairs that must keep a distance, their fit.

`model` holds the data and their TOML tables, `distance` gives distances and gradients as
expressions. `geometry`, `capsules` and `selection` fit the proxies of a URDF.
"""
