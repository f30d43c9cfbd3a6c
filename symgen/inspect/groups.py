"""Links that are fixed to each other, as one body: motion and simulators know only their sum.

P = Σ_k T_k P_k T_kᵀ,  T_k from the frame of link k to that of the heaviest one. Files divide one
part into several links (a drive, its cover, a camera), with placeholders of a gram in some of them.
"""

from dataclasses import dataclass

import numpy as np

from symgen.inspect.geometry import Extent
from symgen.inspect.model import Array, Body, Model


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """A body of links that are fixed to each other, in the frame of its heaviest link.

    Attributes:
        where: place for findings.
        body: sum of the consistent bodies.
        extent: space of the shapes of all links; None where one is unknown, or without shapes.
        reach: largest distance from the frame to the joints of the group and its centre, m.
    """

    where: str
    body: Body
    extent: Extent | None
    reach: float


def groups_of(model: Model, extents: dict[str, Extent | None]) -> list[Group]:
    """Return the groups that have a consistent body."""
    groups, seen = [], set()
    for name in model.links:
        joint = model.joint_of(name)
        if joint is None or joint.moves or joint.parent not in model.links:
            members = [member for member in model.subtree(name, rigid=True) if member not in seen]
            seen.update(members)
            groups.append(_group(model, members, extents))
    return [group for group in groups if group is not None]


def _group(model: Model, names: list[str], extents: dict[str, Extent | None]) -> Group | None:
    bodies = {
        name: body
        for name in names
        if (body := model.links[name].body) is not None and body.is_realisable
    }
    if not bodies:
        return None
    heaviest = max(bodies, key=lambda name: bodies[name].mass)
    poses = _poses(model, names, heaviest)
    where = f"link '{heaviest}'"
    if len(bodies) > 1:
        where += f" with what is fixed to it ({len(bodies) - 1} more)"
    return Group(
        where,
        _sum([(bodies[name], poses[name]) for name in bodies], bodies[heaviest]),
        _extent(model, poses, extents),
        _reach(model, names[0], poses, bodies),
    )


def _poses(model: Model, names: list[str], reference: str) -> dict[str, Array]:
    """T (4, 4) from the frame of each link to that of the reference; exactly 1 for itself."""
    poses = {names[0]: np.eye(4)}
    for name in names[1:]:  # a link comes after the one that carries it
        joint, step = model.joint_of(name), np.eye(4)
        if joint is None:
            poses[name] = step
        else:
            step[:3, :3], step[:3, 3] = joint.rotation, joint.offset
            # Two joints with one child are an error of the file, which is reported.
            poses[name] = poses.get(joint.parent, np.eye(4)) @ step
    back = np.linalg.inv(poses[reference])
    return {name: back @ pose for name, pose in poses.items()} | {reference: np.eye(4)}


def _sum(parts: list[tuple[Body, Array]], heaviest: Body) -> Body:
    """Sum of bodies with their poses; one alone keeps its numbers to the last digit."""
    if len(parts) == 1:
        return heaviest
    masses = np.array([body.mass for body, _ in parts])
    places = np.array([pose[:3, :3] @ body.com + pose[:3, 3] for body, pose in parts])
    com = masses @ places / masses.sum()
    inertia = np.zeros((3, 3))
    for (body, pose), place in zip(parts, places, strict=True):
        way = place - com
        turned = pose[:3, :3] @ body.inertia @ pose[:3, :3].T
        inertia += turned + body.mass * (way @ way * np.eye(3) - np.outer(way, way))
    return Body(float(masses.sum()), com, (inertia + inertia.T) / 2)


def _extent(
    model: Model, poses: dict[str, Array], extents: dict[str, Extent | None]
) -> Extent | None:
    volume, points = 0.0, []
    for name, pose in poses.items():
        extent = extents[name]
        if extent is not None:
            volume += extent.volume
            points.append(extent.points @ pose[:3, :3].T + pose[:3, 3])
        elif model.links[name].shapes:
            return None
    return Extent(volume, np.vstack(points)) if points else None


def _reach(model: Model, root: str, poses: dict[str, Array], bodies: dict[str, Body]) -> float:
    carrier = model.joint_of(root)
    offsets = [pose[:3, 3] for pose in poses.values()]
    offsets += [] if carrier is None else [carrier.offset]
    for name, pose in poses.items():
        ends = [child.offset for child in model.children(name)]
        ends += [bodies[name].com] if name in bodies else []
        offsets += [pose[:3, :3] @ end + pose[:3, 3] for end in ends]
    return max(float(np.linalg.norm(offset)) for offset in offsets)
