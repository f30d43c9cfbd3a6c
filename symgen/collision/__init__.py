"""Capsules that enclose the links: their placement, pairs that must keep a distance, their fit.

`model` holds the data, `tables` reads and writes them as TOML, `distance` gives distances and
gradients as expressions. `geometry`, `capsules`, `coverage` and `selection` fit the proxies of a
URDF and are imported only by the command `proxies`.
"""

from symgen.collision.model import BASE, MARGIN, CollisionModel, Pair, Proxy

__all__ = ["BASE", "MARGIN", "CollisionModel", "Pair", "Proxy"]
