"""Which pairs of proxies a motion has to watch, and how far apart each must stay.

All pairs of proxies on links that no joint connects, without those that stay apart in every
posture and those that never get clear of each other. Distances are searched over the whole range
of the joints: at random first, then downhill from the closest postures found.

Proxies take in air, so that a pair may be short of its margin where the robot rests although the
links themselves have room. Its margin is then set by the links: the least one that keeps these
apart by `MARGIN`, or by half of their distance at rest, in all postures tried. It can be negative.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from symgen.chain import Chain
from symgen.collision.distance import clearance
from symgen.collision.geometry import LinkGeometry
from symgen.collision.links import link_distances
from symgen.collision.model import MARGIN, CollisionModel, Pair, Proxy

Array = NDArray[np.float64]

FAR = 0.005
"""m above the margin that a pair never falls below to be left out."""
SPARE = 2e-3
"""m; what a margin that was found at sampled postures gets on top."""
_POSTURES = 4000
_DESCENTS = 3


@dataclass(frozen=True, slots=True)
class Selection:
    """The pairs, and those left out: never close, or never clear."""

    pairs: tuple[Pair, ...]
    apart: tuple[tuple[str, str], ...]
    touching: tuple[tuple[str, str], ...]


def select_pairs(
    chain: Chain,
    proxies: tuple[Proxy, ...],
    home: Array,
    geometry: tuple[LinkGeometry, ...] = (),
    margin: float = MARGIN,
) -> Selection:
    """Pairs worth watching, each with its margin.

    Args:
        chain: n joints.
        proxies: of its links and its base.
        home: (n,) where the robot rests.
        geometry: what the proxies hold; without it pairs too close at rest keep half of the
            distance that their proxies have there.
        margin: m.
    """
    model = _all_pairs(chain, proxies, margin)
    if not model.pairs:
        return Selection((), (), ())
    q = ca.SX.sym("q", len(chain.joints))
    distance, jacobian = clearance(chain, model, q)
    both = ca.Function("clearance", [q], [distance, jacobian], {"cse": True})
    lower, upper = _range(chain)
    rng = np.random.default_rng(0)
    postures = np.vstack([home, rng.uniform(lower, upper, (_POSTURES, len(lower)))])
    function = ca.Function("distance", [q], [distance], {"cse": True})
    found = np.asarray(function.map(len(postures))(postures.T)).T  # (postures, pairs)
    links = {part.link: part for part in geometry if not part.rounds}
    kept, apart, touching = [], [], []
    for k, pair in enumerate(model.pairs):
        names, own = (pair.first, pair.second), margin
        if found[0, k] < margin + SPARE:
            ends = [links[link] for name in names if (link := model.named(name).link) in links]
            if len(ends) == 2:
                own = _from_links(chain, ends, postures, found[:, k], margin)
            elif found[0, k] > 0:
                own = _floor(float(found[0, k]) / 2)
        if own > found[:, k].max():
            touching.append(names)
        elif _least(both, k, postures[np.argsort(found[:, k])], lower, upper) > own + FAR:
            apart.append(names)
        else:
            kept.append(Pair(*names, own))
    return Selection(tuple(kept), tuple(apart), tuple(touching))


def _from_links(
    chain: Chain, ends: list[LinkGeometry], postures: Array, proxies: Array, margin: float
) -> float:
    """The margin of the proxies that keeps the links apart, m; −∞ where they always are.

    Args:
        chain: n joints.
        ends: the two links.
        postures: (N, n), the first one where the robot rests.
        proxies: (N,) distances of the proxies.
        margin: m, what the links shall keep.
    """
    between = link_distances(chain, ends[0], ends[1], postures)
    wanted = min(margin, float(between[0]) / 2)
    close = proxies[between < wanted]
    if not close.size:
        return -np.inf
    return min(margin, _floor(float(close.max()) + SPARE))


def _floor(distance: float) -> float:
    """Down to whole millimetres, in metres."""
    return float(np.floor(distance * 1e3)) / 1e3


def _least(both: ca.Function, k: int, closest: Array, lower: Array, upper: Array) -> float:
    """The smallest distance that descents from the closest postures reach."""

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
    joints = [model.joint_of(proxy, links) for proxy in proxies]
    parents = [joint.parent for joint in chain.joints]
    pairs = []
    for b, second in enumerate(proxies):
        for a, first in enumerate(proxies[:b]):
            i, j = joints[a], joints[b]
            neighbours = i == j or (j >= 0 and parents[j] == i) or (i >= 0 and parents[i] == j)
            if not neighbours:
                pairs.append(Pair(first.name, second.name, margin))
    return CollisionModel(proxies, tuple(pairs))


def _range(chain: Chain) -> tuple[Array, Array]:
    """Position limits; a joint without them goes once round, or 1 m to both sides."""
    far = [1.0 if j.kind == "prismatic" else np.pi for j in chain.joints]
    lower = [-f if j.lower is None else j.lower for j, f in zip(chain.joints, far, strict=True)]
    upper = [f if j.upper is None else j.upper for j, f in zip(chain.joints, far, strict=True)]
    return np.array(lower), np.array(upper)
