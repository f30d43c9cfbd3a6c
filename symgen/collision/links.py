"""Distances between the links themselves, by coal: the reference for the proxies."""

import casadi as ca
import coal
import numpy as np
from numpy.typing import NDArray

from symgen.chain import Chain
from symgen.collision.geometry import LinkGeometry
from symgen.collision.model import BASE
from symgen.mechanics.closure import supplied
from symgen.mechanics.kinematics import all_positions
from symgen.mechanics.spatial import joint_pose

Array = NDArray[np.float64]


def link_distances(
    chain: Chain, first: LinkGeometry, second: LinkGeometry, postures: Array
) -> Array:
    """Distance of two links at each posture.

    postures (N, n) [rad, m] → (N,).
    """
    meshes = [_mesh(first.triangles), _mesh(second.triangles)]
    places = [link_poses(chain, part.link, postures) for part in (first, second)]
    request, answer = coal.DistanceRequest(), coal.DistanceResult()
    distances = np.empty(len(postures))
    for k, (a, b) in enumerate(zip(*places, strict=True)):
        where = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (a, b)]
        answer.clear()
        distances[k] = coal.distance(meshes[0], where[0], meshes[1], where[1], request, answer)
    return np.maximum(distances, 0.0)


def link_poses(chain: Chain, link: str, postures: Array) -> Array:
    """Pose of a link in the base frame at each posture.

    postures (N, n) [rad, m] → (N, 4, 4).
    """
    q = ca.SX.sym("q", len(chain.coordinates))
    positions = all_positions(chain, q)
    pose = ca.SX.eye(4)
    index = -1 if link == BASE else [j.link for j in chain.joints].index(link)
    while index >= 0:
        step = joint_pose(chain.joints[index], positions[index])
        top = ca.horzcat(step.rotation, step.translation)
        pose = ca.mtimes(ca.vertcat(top, ca.SX(ca.DM([[0, 0, 0, 1]]))), pose)
        index = chain.joints[index].parent
    function = ca.Function("pose", [q], [supplied(chain, ca.densify(ca.vec(pose.T)), q)])
    rows = np.asarray(function.map(len(postures))(postures.T)).T
    return rows.reshape(-1, 4, 4)


def _mesh(triangles: Array) -> coal.BVHModelOBBRSS:
    corners, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(corners))
    mesh.addVertices(corners)
    mesh.addTriangles(index.reshape(-1, 3).astype(np.int64))
    mesh.endModel()
    return mesh
