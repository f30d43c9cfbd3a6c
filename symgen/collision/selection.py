"""Choice of the pairs of proxies that a motion must keep apart, and of their margins.

Candidates are all pairs of proxies on links that no joint connects. Left out are pairs that stay
apart in every posture and pairs that overlap in every posture. Distances are searched over the
whole range of the joints: random postures first, then descents from the closest ones.

Proxies are larger than their links, so a pair may be closer than its margin at rest although the
links have room. The margin then follows from the links: the least margin that keeps the links apart
by `MARGIN`, or by half of their distance at rest, in all sampled postures. It can be negative.
Distances between the links themselves are those of coal.
"""

from dataclasses import dataclass

import casadi as ca
import coal
import numpy as np
from scipy.optimize import minimize

from symgen.chain import Chain
from symgen.collision.distance import clearance
from symgen.collision.geometry import LinkGeometry
from symgen.collision.model import BASE, MARGIN, CollisionModel, Pair, Proxy
from symgen.kernel import Array
from symgen.mechanics.closure import supplied
from symgen.mechanics.kinematics import link_poses

FAR = 0.005  # distance above the margin that a pair must always keep to be left out, m
SPARE = 2e-3  # reserve of a margin that is determined from sampled postures, m
_POSTURES = 4000  # random postures
_DESCENTS = 3  # descents per pair


@dataclass(frozen=True, slots=True)
class Selection:
    """Chosen pairs, and pairs left out."""

    pairs: tuple[Pair, ...]  # pairs with their margins
    apart: tuple[tuple[str, str], ...]  # pairs that never come close
    touching: tuple[tuple[str, str], ...]  # pairs that overlap in every posture


def select_pairs(
    chain: Chain,
    proxies: tuple[Proxy, ...],
    home: Array,
    geometry: tuple[LinkGeometry, ...] = (),
    margin: float = MARGIN,
) -> Selection:
    """Choose the pairs of proxies that a motion must keep apart; home (n,) [rad, m]."""
    model = _all_pairs(chain, proxies, margin)
    if not model.pairs:
        return Selection((), (), ())
    q = ca.SX.sym("q", len(chain.coordinates))
    distance, jacobian = clearance(chain, model, q)
    both = ca.Function("clearance", [q], [distance, jacobian], {"cse": True})
    # Distances of all pairs at rest (row 0) and at random postures of the whole range.
    # A joint without limits turns once, or slides by 1 m to both sides.
    far = [1.0 if joint.kind == "prismatic" else np.pi for joint in chain.coordinates]
    lower, upper = np.array([j.ends(x) for j, x in zip(chain.coordinates, far, strict=True)]).T
    rng = np.random.default_rng(0)
    postures = np.vstack([home, rng.uniform(lower, upper, (_POSTURES, len(lower)))])
    function = ca.Function("distance", [q], [distance], {"cse": True})
    distances = np.asarray(function.map(len(postures))(postures.T)).T  # (postures, pairs)
    links = {part.link: part for part in geometry if not part.rounds}
    # Per pair: its margin, then drop it if it never reaches the margin or never comes near it.
    pairs, apart, touching = [], [], []
    for k, pair in enumerate(model.pairs):
        names, pair_margin = (pair.first, pair.second), margin
        if distances[0, k] < margin + SPARE:
            ends = [links[link] for name in names if (link := model.named(name).link) in links]
            if len(ends) == 2:
                pair_margin = _from_links(chain, ends, postures, distances[:, k], margin)
            elif distances[0, k] > 0:
                pair_margin = _floor(float(distances[0, k]) / 2)
        if pair_margin > distances[:, k].max():
            touching.append(names)
        elif (
            _least(both, k, postures[np.argsort(distances[:, k])], lower, upper) > pair_margin + FAR
        ):
            apart.append(names)
        else:
            pairs.append(Pair(*names, pair_margin))
    return Selection(tuple(pairs), tuple(apart), tuple(touching))


def _from_links(
    chain: Chain, ends: list[LinkGeometry], postures: Array, proxies: Array, margin: float
) -> float:
    """Margin of two proxies that keeps their links apart, m; −∞ where the links always are."""
    between = link_distances(chain, ends[0], ends[1], postures)
    wanted = min(margin, float(between[0]) / 2)
    close = proxies[between < wanted]
    if not close.size:
        return -np.inf
    return min(margin, _floor(float(close.max()) + SPARE))


def _floor(distance: float) -> float:
    """Round down to whole millimetres, in metres."""
    return float(np.floor(distance * 1e3)) / 1e3


def _least(both: ca.Function, k: int, closest: Array, lower: Array, upper: Array) -> float:
    """The smallest distance that descents from the closest postures reach, m."""

    def cost(x: Array) -> tuple[float, Array]:
        distance, jacobian = both(x)
        return float(distance[k]), np.asarray(jacobian[k, :]).ravel()

    bounds = list(zip(lower, upper, strict=True))
    return min(
        float(minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds).fun)
        for start in closest[:_DESCENTS]
    )


def _all_pairs(chain: Chain, proxies: tuple[Proxy, ...], margin: float) -> CollisionModel:
    model = CollisionModel(proxies)
    links = [joint.link for joint in chain.joints]
    placed = [(proxy, model.joint_of(proxy, links)) for proxy in proxies]
    parents = [joint.parent for joint in chain.joints]
    pairs = tuple(
        Pair(first.name, second.name, margin)
        for b, (second, j) in enumerate(placed)
        for first, i in placed[:b]
        if not (i == j or (j >= 0 and parents[j] == i) or (i >= 0 and parents[i] == j))
    )
    return CollisionModel(proxies, pairs)


def link_distances(
    chain: Chain, first: LinkGeometry, second: LinkGeometry, postures: Array
) -> Array:
    """Distance of two links at postures (N, n) [rad, m], (N,) [m]."""
    meshes = [_mesh(first.triangles), _mesh(second.triangles)]
    places = [poses_of_link(chain, part.link, postures) for part in (first, second)]
    request, answer = coal.DistanceRequest(), coal.DistanceResult()
    distances = np.empty(len(postures))
    for k, (a, b) in enumerate(zip(*places, strict=True)):
        where = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (a, b)]
        answer.clear()
        distances[k] = coal.distance(meshes[0], where[0], meshes[1], where[1], request, answer)
    return np.maximum(distances, 0.0)


def poses_of_link(chain: Chain, link: str, postures: Array) -> Array:
    """Pose of a link in the base frame at postures (N, n) [rad, m], (N, 4, 4)."""
    q = ca.SX.sym("q", len(chain.coordinates))
    pose = ca.SX.eye(4)
    if link != BASE:
        k = 4 * [joint.link for joint in chain.joints].index(link)
        pose = link_poses(chain, q)[k : k + 4, :]
    function = ca.Function("pose", [q], [supplied(chain, ca.densify(ca.vec(pose.T)), q)])
    return np.asarray(function.map(len(postures))(postures.T)).T.reshape(-1, 4, 4)


def _mesh(triangles: Array) -> coal.BVHModelOBBRSS:
    corners, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(corners))
    mesh.addVertices(corners)
    mesh.addTriangles(index.reshape(-1, 3).astype(np.int64))
    mesh.endModel()
    return mesh
