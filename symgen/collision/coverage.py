"""Coverage of a link by its proxies, measured by coal: protruding parts and excess volume.

The corners of triangles with edges of at most `EDGE` are checked one by one. If all three corners
of a triangle lie in one capsule, so does the triangle, since a capsule is convex.
"""

from dataclasses import dataclass

import coal
import numpy as np
from numpy.typing import NDArray

from symgen.collision.geometry import LinkGeometry
from symgen.collision.model import Proxy

Array = NDArray[np.float64]

_POINT = 1e-9
"""Radius of the sphere that represents a point, m."""


@dataclass(frozen=True, slots=True)
class Coverage:
    """Coverage of one link.

    Attributes:
        link: moving link, or `BASE`.
        proxies: number of proxies.
        corners: number of corners of triangles.
        outside: largest distance by which a triangle protrudes from the proxy that holds it best,
            m.
        ratio: volume of the proxies over that of the convex hulls; NaN without angular shapes.
    """

    link: str
    proxies: int
    corners: int
    outside: float
    ratio: float


def coverage(geometry: LinkGeometry, proxies: tuple[Proxy, ...]) -> Coverage:
    """Measure how well proxies enclose a link."""
    ours = [proxy for proxy in proxies if proxy.link == geometry.link]
    corners, owner = np.unique(geometry.triangles.reshape(-1, 3), axis=0, return_inverse=True)
    outside = np.inf if len(corners) else 0.0
    if ours and len(corners):
        distance = np.stack([_distances(proxy, corners) for proxy in ours])  # (proxies, corners)
        per_triangle = distance[:, owner.reshape(-1, 3)].max(axis=2)  # (proxies, T)
        outside = float(per_triangle.min(axis=0).max())
    volume = sum(np.pi * p.radius**2 * (p.length + 4 / 3 * p.radius) for p in ours)
    ratio = float(volume / geometry.volume) if geometry.volume > 0 else float("nan")
    return Coverage(geometry.link, len(ours), len(corners), max(outside, 0.0), ratio)


def capsule_of(proxy: Proxy) -> tuple[coal.Capsule, coal.Transform3s]:
    """Capsule of a proxy and its placement in the frame of the link, as coal's types."""
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
    answer, place = coal.DistanceResult(), coal.Transform3s()
    distances = np.empty(len(points))
    for k, x in enumerate(points):
        place.setTranslation(x)
        answer.clear()
        distances[k] = coal.distance(capsule, placement, point, place, request, answer) + _POINT
    return distances
