"""Coal's distances between the bodies of a generated robot, moved by Pinocchio."""

from collections.abc import Iterator, Mapping, Sequence

import coal
import numpy as np
import pinocchio
from numpy.typing import NDArray

from runtime.library import ProxyFacts

TABLE = "table"
"""Name of the plane z = height in a pair."""

Placed = tuple[int, coal.CollisionGeometry, pinocchio.SE3]
"""Joint of Pinocchio that carries a shape, the shape, and its pose in the frame of the joint."""


def capsule_of(proxy: ProxyFacts) -> tuple[coal.CollisionGeometry, pinocchio.SE3]:
    """Coal's capsules lie along z around the origin; a capsule without length is a sphere."""
    start, end = np.array(proxy.start), np.array(proxy.end)
    length = float(np.linalg.norm(end - start))
    axis = end - start if length > 0 else np.array([0.0, 0.0, 1.0])
    turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis)
    shape = coal.Capsule(proxy.radius, length)
    return shape, pinocchio.SE3(turn.matrix(), (start + end) / 2)


def pair_distances(
    model: pinocchio.Model,
    placed: Mapping[str, Placed],
    height: float,
    positions: NDArray[np.float64],
    pairs: Sequence[tuple[str, str]],
) -> Iterator[list[float]]:
    """Distance of every pair at every position, m; the second of a pair may be the table."""
    data, request, answer = model.createData(), coal.DistanceRequest(), coal.DistanceResult()
    plane = coal.Halfspace(np.array([0.0, 0.0, 1.0]), height)
    names = {name for pair in pairs for name in pair} - {TABLE}
    for q in positions:
        pinocchio.forwardKinematics(model, data, q)
        where = {TABLE: (plane, coal.Transform3s.Identity())}
        for name in names:
            joint, shape, placement = placed[name]
            pose = data.oMi[joint] * placement
            where[name] = shape, coal.Transform3s(pose.rotation, pose.translation)
        row = []
        for one, other in pairs:
            answer.clear()
            row.append(coal.distance(*where[one], *where[other], request, answer))
        yield row
