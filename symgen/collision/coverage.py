"""How well proxies hold a link, asked of coal: nothing sticks out, and how much air they take in.

The corners of triangles at most `EDGE` long are asked one by one. Where all three corners of a
triangle lie in one capsule, the whole triangle does, since a capsule is convex.
"""

from dataclasses import dataclass

import coal
import numpy as np
from numpy.typing import NDArray

from symgen.collision.geometry import LinkGeometry
from symgen.collision.model import Proxy

Array = NDArray[np.float64]

_POINT = 1e-9
"""m; radius of the sphere that stands for a point."""


@dataclass(frozen=True, slots=True)
class Coverage:
    """What the proxies of a link hold.

    Attributes:
        link: moving link, or `BASE`.
        proxies: how many.
        corners: of triangles, as many as were asked.
        outside: m; how far a triangle sticks out of the proxy that holds it best, at most.
        ratio: volume of the proxies over that of the convex hulls; NaN without angular shapes.
    """

    link: str
    proxies: int
    corners: int
    outside: float
    ratio: float


def coverage(geometry: LinkGeometry, proxies: tuple[Proxy, ...]) -> Coverage:
    """Ask coal for the distance of every corner to every proxy of the link."""
    own = [proxy for proxy in proxies if proxy.link == geometry.link]
    corners, owner = np.unique(geometry.triangles.reshape(-1, 3), axis=0, return_inverse=True)
    outside = np.inf if len(corners) else 0.0
    if own and len(corners):
        distance = np.stack([_distances(proxy, corners) for proxy in own])  # (proxies, corners)
        per_triangle = distance[:, owner.reshape(-1, 3)].max(axis=2)  # (proxies, T)
        outside = float(per_triangle.min(axis=0).max())
    volume = sum(np.pi * p.radius**2 * (p.length + 4 / 3 * p.radius) for p in own)
    ratio = float(volume / geometry.volume) if geometry.volume > 0 else float("nan")
    return Coverage(geometry.link, len(own), len(corners), max(outside, 0.0), ratio)


def capsule_of(proxy: Proxy) -> tuple[coal.Capsule, coal.Transform3s]:
    """coal's capsule and its placement in the frame of the link."""
    start, end = np.array(proxy.start), np.array(proxy.end)
    axis = (end - start) / proxy.length if proxy.length > 0 else np.array([0.0, 0.0, 1.0])
    side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    side /= np.linalg.norm(side)
    rotation = np.column_stack([side, np.cross(axis, side), axis])
    return coal.Capsule(proxy.radius, proxy.length), coal.Transform3s(rotation, (start + end) / 2)


def _distances(proxy: Proxy, points: Array) -> Array:
    """Signed distance of points to the surface of a proxy, as coal computes it."""
    capsule, placement = capsule_of(proxy)
    point, request = coal.Sphere(_POINT), coal.DistanceRequest()
    request.enable_signed_distance = True
    answer, there = coal.DistanceResult(), coal.Transform3s()
    found = np.empty(len(points))
    for k, x in enumerate(points):
        there.setTranslation(x)
        answer.clear()
        found[k] = coal.distance(capsule, placement, point, there, request, answer) + _POINT
    return found
