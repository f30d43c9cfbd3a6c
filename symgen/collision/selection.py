"""Which pairs of proxies a motion has to watch, and how far apart each must stay.

All pairs of proxies on links that no joint connects, without those that stay apart in every
posture and those that never get clear of each other. Distances are searched over the whole range
of the joints: at random first, then downhill from the closest postures found.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from symgen.chain import Chain
from symgen.collision.distance import clearance
from symgen.collision.model import CollisionModel, Pair, Proxy

Array = NDArray[np.float64]

MARGIN = 0.02
"""m; what two proxies keep where there is room for it."""
FAR = 0.02
"""m above the margin that a pair never falls below to be left out."""
_POSTURES = 4000
_DESCENTS = 3


@dataclass(frozen=True, slots=True)
class Selection:
    """The pairs, and those left out: never close, or never clear."""

    pairs: tuple[Pair, ...]
    apart: tuple[tuple[str, str], ...]
    touching: tuple[tuple[str, str], ...]


def select_pairs(
    chain: Chain, proxies: tuple[Proxy, ...], home: Array, margin: float = MARGIN
) -> Selection:
    """Pairs worth watching, each with its margin.

    Args:
        chain: n joints.
        proxies: of its links and its base.
        home: (n,) where the robot rests; a pair that is closer than twice the margin there keeps
            half of that distance instead.
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
    kept, apart, touching = [], [], []
    for k, pair in enumerate(model.pairs):
        names = (pair.first, pair.second)
        at_home = float(found[0, k])
        own = min(margin, round(at_home / 2, 3))
        if own <= 0:
            own = margin
        if found[:, k].max() < own:
            touching.append(names)
        elif _least(both, k, postures[np.argsort(found[:, k])], lower, upper) > margin + FAR:
            apart.append(names)
        else:
            kept.append(Pair(*names, own))
    return Selection(tuple(kept), tuple(apart), tuple(touching))


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
