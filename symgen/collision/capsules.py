"""Capsules of small volume around the triangles of a link: one, two or three of them.

One capsule around points x_i: min log(π r² L + 4/3 π r³) with |x_i − segment| ≤ r, by SLSQP with
exact gradients from several axes. Several capsules: each triangle is assigned to the capsule that
it protrudes from least, and each capsule is fitted again, until the assignment is stable (Lloyd). A
further capsule is added only if it saves a sixth of the volume, since every capsule adds pairs.

The coverage of a link by its proxies is measured by coal, corner by corner. If all three corners of
a triangle lie in one capsule, so does the triangle, since a capsule is convex.
"""

from dataclasses import dataclass

import coal
import numpy as np
from scipy.optimize import minimize
from scipy.spatial import ConvexHull, QhullError

from symgen.collision.geometry import Capsule, LinkGeometry
from symgen.collision.model import Proxy
from symgen.kernel import Array

GRAIN = 1e-4  # grid of the ends and radii, m; radii are rounded up
LEAST_SAVING = 1 / 6  # part of the volume that one more capsule must save
_ROUNDS = 8  # largest number of reassignments of triangles; three or four suffice
_CONSTRAINED = 400  # most points for SLSQP; the radius is then checked with all of them
_POINT = 1e-9  # radius of the sphere that represents a point, m


@dataclass(frozen=True, slots=True)
class Coverage:
    """Coverage of one link."""

    link: str  # moving link, or `BASE`
    proxies: int  # number of proxies
    corners: int  # number of corners of triangles
    outside: float  # largest distance of a triangle outside the proxy that holds it best, m
    ratio: float  # volume of the proxies over that of the convex hulls; NaN without angular shapes


def fit_link(geometry: LinkGeometry, most: int) -> tuple[Proxy, ...]:
    """Return proxies that enclose a link."""
    capsules = [*geometry.rounds]
    if len(geometry.triangles):
        capsules += _fit_capsules(geometry.triangles, most)
    several = len(capsules) > 1
    return tuple(
        Proxy(
            f"{geometry.link}_{k}" if several else geometry.link,
            geometry.link,
            _point(c.start),
            _point(c.end),
            round(float(c.radius), 9),
        )
        for k, c in enumerate(capsules, 1)
    )


def _fit_capsules(triangles: Array, most: int) -> list[Capsule]:
    """Fit capsules to triangles, each triangle wholly inside one of them."""
    best = [_rounded(_enclosing(triangles), triangles)]
    for count in range(2, most + 1):
        more = _split(triangles, count)
        if sum(c.volume for c in more) > (1 - LEAST_SAVING) * sum(c.volume for c in best):
            break
        best = more
    return best


def _split(triangles: Array, count: int) -> list[Capsule]:
    """Lloyd's alternation, from slices of equal number along the longest axis."""
    centres = triangles.mean(axis=1)
    _, _, axes = np.linalg.svd(centres - centres.mean(axis=0), full_matrices=False)
    order = np.argsort(centres @ axes[0], kind="stable")
    owner = np.empty(len(triangles), dtype=int)
    owner[order] = np.arange(len(order)) * count // len(order)
    capsules: list[Capsule] = []
    for _ in range(_ROUNDS):
        parts = [triangles[owner == k] for k in range(count)]
        capsules = [_enclosing(part, starts=1) for part in parts if len(part)]
        count = len(capsules)
        away = [_to_segment(triangles, c.start, c.end)[0] - c.radius for c in capsules]
        fresh = np.stack([each.max(axis=1) for each in away]).argmin(axis=0)
        if (fresh == owner).all():
            break
        owner = fresh
    parts = [triangles[owner == k] for k in range(count)]
    return [_rounded(_enclosing(part), part) for part in parts if len(part)]


def _enclosing(triangles: Array, starts: int = 5) -> Capsule:
    """The smallest capsule around all corners, from axes of inertia and of the frame."""
    points = _extreme(triangles.reshape(-1, 3))
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    size = float(np.abs(points - centre).max()) or 1.0
    scaled = (points - centre) / size
    _, _, axes = np.linalg.svd(scaled - scaled.mean(axis=0), full_matrices=False)
    fits = [_minimised(scaled, axis) for axis in [*axes[:2], *np.eye(3)][:starts]]
    best = min(fits, key=lambda c: c.volume)
    return Capsule(centre + size * best.start, centre + size * best.end, size * best.radius)


def _extreme(points: Array) -> Array:
    """Corners of the convex hull: a capsule that contains them contains all points."""
    points = np.unique(points, axis=0)
    try:
        points = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return points  # flat: no hull
    # Too many for SLSQP: the extreme points in directions of a Fibonacci sphere.
    if len(points) > _CONSTRAINED:
        golden = np.pi * (1 + 5**0.5) * np.arange(_CONSTRAINED)
        height = 1 - (2 * np.arange(_CONSTRAINED) + 1) / _CONSTRAINED
        around = np.sqrt(1 - height**2)
        towards = np.stack([around * np.cos(golden), around * np.sin(golden), height])
        points = points[np.unique((points @ towards).argmax(axis=0))]
    return points


def _minimised(points: Array, axis: Array) -> Capsule:
    """SLSQP on (start, end, radius) from a capsule along `axis`."""
    along = points @ axis
    radius = float(np.linalg.norm(points - np.outer(along, axis), axis=1).max())
    middle, half = (along.min() + along.max()) / 2, (along.max() - along.min()) / 2
    half = max(half - radius, 0.1 * half)
    start = np.concatenate([(middle - half) * axis, (middle + half) * axis, [radius + half]])

    # x = (start, end, radius); cost log volume, constraints r − |x_i − segment| ≥ 0.
    def cost(x: Array) -> tuple[float, Array]:
        d, r = x[3:6] - x[:3], x[6]
        length = np.sqrt(d @ d) + 1e-9
        volume = r * r * (length + 4 / 3 * r)
        slope = np.concatenate([-r * r * d / length, r * r * d / length, [0.0]])
        slope[6] = 2 * r * length + 4 * r * r
        return float(np.log(volume)), slope / volume

    def room(x: Array) -> Array:
        return x[6] - _to_segment(points, x[:3], x[3:6])[0]

    def room_slope(x: Array) -> Array:
        distance, s, away = _to_segment(points, x[:3], x[3:6])
        normal = away / np.maximum(distance, 1e-9)[:, None]
        ones = np.ones((len(points), 1))
        return np.hstack([(1 - s)[:, None] * normal, s[:, None] * normal, ones])

    answer = minimize(
        cost,
        start,
        jac=True,
        method="SLSQP",
        bounds=[(None, None)] * 6 + [(1e-3, None)],
        constraints=[{"type": "ineq", "fun": room, "jac": room_slope}],
        options={"maxiter": 100, "ftol": 1e-7},
    )
    # Whatever SLSQP returns, the radius is that of the farthest point: the capsule encloses all.
    x = answer.x if np.isfinite(answer.x).all() else start
    return Capsule(x[:3], x[3:6], float(_to_segment(points, x[:3], x[3:6])[0].max()))


def _to_segment(points: Array, start: Array, end: Array) -> tuple[Array, Array, Array]:
    """Distance (…), parameter s ∈ [0, 1] (…) and offset (…, 3) of points from a segment."""
    direction = end - start
    s = np.clip((points - start) @ direction / max(float(direction @ direction), 1e-30), 0, 1)
    away = points - start - s[..., None] * direction
    return np.linalg.norm(away, axis=-1), s, away


def _rounded(capsule: Capsule, triangles: Array) -> Capsule:
    """Ends rounded to the grain, radius rounded up, so that every corner is inside."""
    start, end = (np.round(p / GRAIN) * GRAIN for p in (capsule.start, capsule.end))
    reach = float(_to_segment(triangles, start, end)[0].max())
    return Capsule(start, end, float(np.ceil(reach / GRAIN + 1e-6) * GRAIN))


def _point(x: Array) -> tuple[float, float, float]:
    """Coordinates without the rounding of binary fractions, and without −0."""
    a, b, c = (round(float(value), 9) + 0.0 for value in x)
    return a, b, c


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
