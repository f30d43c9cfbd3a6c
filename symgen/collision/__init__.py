"""Capsules that enclose the links: where they are, which pairs must keep apart, how to fit them.

`model` holds the data, `tables` reads and writes them as TOML, `distance` gives distances and
gradients as expressions; `geometry`, `capsules`, `coverage` and `selection` make the proxies of
a URDF and are imported only by the command that does so.
"""

from symgen.collision.model import BASE, MARGIN, CollisionModel, Pair, Proxy

__all__ = ["BASE", "MARGIN", "CollisionModel", "Pair", "Proxy"]
