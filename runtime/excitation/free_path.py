"""Collision-free polylines between two poses: straight, or by RRT-Connect with shortcuts.

Two trees grow from both ends towards random poses and towards each other. Distances between poses
are times at full speed, so that fast joints move most. Source: Kuffner and LaValle, "RRT-Connect:
an efficient approach to single-query path planning", ICRA 2000.

Ranges, gravity torque, the box of the tip and distances decide at which poses a robot may rest. The
distances of a path between two poses are examined at steps of `STEP`; the certificate of the
finished motion decides on all instants.
"""

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.dependent_joints import DependentVelocity
from runtime.excitation.limits.distance_limits import TipSpeed
from runtime.excitation.limits.nonlinear_limits import Braking
from runtime.excitation.limits.safety import Safety
from runtime.excitation.limits.torque_limits import TorqueRate
from runtime.library import Array, Library

STEP = 0.03
"""Largest step of a joint between two examined poses [rad, m]."""
SPARE = 0.05
"""Share of a limit, or distance in 0.1 m, that paths keep beyond the margins where they can."""
REACH = 0.5
"""Longest edge of a tree, largest step of a joint [rad, m]."""
MOST_POSES = 4000
"""Number of random poses after which no way is expected."""
SHORTCUTS = 150
"""Number of random shortcuts that are tried."""
RANGE = np.pi
"""Range on both sides of the ends for joints without limits [rad, m]."""


class FreePoses:
    """Poses that keep the limits of a robot at rest.

    Args:
        lib: the robot.
        safety: limits beyond the ranges of the joints.
        ends: start and end of a way, (2, n) [rad, m]; a way keeps `SPARE` only as far as they do.

    Raises:
        IdentificationError: the robot may not rest at an end; which limit is exceeded, and by how
            much.
    """

    def __init__(self, lib: Library, safety: Safety, ends: Array) -> None:
        self._lib = lib
        # Braking enters by the range; speeds and rates vanish at rest.
        moving = Braking, TorqueRate, TipSpeed, DependentVelocity
        self._limits = [
            one for one in constraints(lib, ends[0], safety) if not isinstance(one, moving)
        ]
        self.lower, self.upper = _range(lib)
        for pose, name in zip(ends, ("start", "end"), strict=True):
            self._require(pose, name)
        self._spare = min(SPARE, 0.5 * float(-self._worst(ends).max(initial=-1.0)))

    def are_free(self, q: Array) -> NDArray[np.bool_]:
        """Whether poses keep all limits with the spare share.

        q (N, n) [rad, m] → (N,).
        """
        inside = ((q >= self.lower) & (q <= self.upper)).all(axis=1)
        return np.asarray(inside & (self._worst(q) < -self._spare))

    def is_free_between(self, first: Array, last: Array) -> bool:
        """Whether the straight way between two poses is free.

        first (n,) [rad, m], last (n,) [rad, m].
        """
        steps = max(1, int(np.ceil(np.abs(last - first).max() / STEP)))
        share = np.linspace(0.0, 1.0, steps + 1)[:, None]
        return bool(self.are_free(first + share * (last - first)).all())

    def _worst(self, q: Array) -> Array:
        """Largest g of all limits, (N,); −1 without any, +inf for what is not a number."""
        motion = np.zeros((4, *q.shape))
        motion[0] = q
        values = [one.values(motion).max(axis=1) for one in self._limits]
        worst = np.max(values, axis=0) if values else np.full(len(q), -1.0)
        return np.asarray(np.nan_to_num(worst, nan=np.inf))

    def _require(self, pose: Array, name: str) -> None:
        outside = ~((pose > self.lower) & (pose < self.upper))
        if outside.any():
            j = int(np.argmax(outside))
            raise IdentificationError(
                f"expected a {name} of the way within the limits, {self._lib.joint_names[j]} is at "
                f"{pose[j]:.4g} and its range {self.lower[j]:.4g} to {self.upper[j]:.4g}; move the "
                "robot by hand or choose another pose"
            )
        motion = np.zeros((4, 1, len(pose)))
        motion[0] = pose
        for one in self._limits:
            g = np.nan_to_num(one.values(motion)[0], nan=np.inf)
            worst = int(np.argmax(g))
            if g[worst] >= 0:
                value, limit, unit = one.measured(worst, float(g[worst]))
                raise IdentificationError(
                    f"expected a {name} of the way that keeps the limits, {one.kind} of "
                    f"{one.labels[worst]} is {value:.4g} {unit} where {limit:.4g} {unit} is "
                    "allowed; move the robot by hand or choose another pose"
                )


def _range(lib: Library) -> tuple[Array, Array]:
    """Range in which joints may rest: braking leaves c²/k at each end."""
    limits, facts = lib.limits(), lib.braking
    lower, upper = limits["lower"], limits["upper"]
    if facts is None:
        return lower, upper
    room = np.maximum(facts.c, 0) ** 2 / facts.k
    return np.fmax(lower, facts.lower + room), np.fmin(upper, facts.upper - room)


def free_path(lib: Library, poses: FreePoses, start: Array, end: Array, seed: int) -> Array:
    """A free polyline.

    start (n,) [rad, m], end (n,) [rad, m] → (K, n) [rad, m].
    """
    if poses.is_free_between(start, end):
        return np.array([start, end])
    rng = np.random.default_rng(seed)
    speed = lib.limits()["velocity"]
    weight = 1 / np.where(np.isfinite(speed), speed, 1.0)
    low, high = np.minimum(start, end) - RANGE, np.maximum(start, end) + RANGE
    low = np.where(np.isfinite(poses.lower), poses.lower, low)
    high = np.where(np.isfinite(poses.upper), poses.upper, high)
    trees = [_Tree(poses, start, weight), _Tree(poses, end, weight)]
    for k in range(MOST_POSES):
        first, second = trees[k % 2], trees[1 - k % 2]
        leaf = first.extend(rng.uniform(low, high))
        if leaf is None:
            continue
        goal = first.nodes[leaf]
        # The other tree grows towards the new leaf as far as it is free.
        meeting = second.extend(goal)
        while meeting is not None and not np.array_equal(second.nodes[meeting], goal):
            meeting = second.extend(goal)
        if meeting is not None:
            ways = [first.way(leaf), second.way(meeting)][:: 1 if k % 2 == 0 else -1]
            return _shortened(poses, np.array([*ways[0][::-1], *ways[1][1:]]), rng)
    raise IdentificationError(
        f"no collision-free way was found from the start to the end with {MOST_POSES} random "
        "poses; move the robot by hand, or remove obstacles"
    )


class _Tree:
    """Poses joined by free edges; the first one is the root."""

    def __init__(self, poses: FreePoses, root: Array, weight: Array) -> None:
        self._poses, self._weight = poses, weight
        self.nodes, self._parents = [root], [-1]

    def extend(self, goal: Array) -> int | None:
        """Add a pose towards the goal, at most `REACH` away; None where the edge is not free."""
        away = (np.array(self.nodes) - goal) * self._weight
        near = int(np.argmin(np.einsum("kj,kj->k", away, away)))
        step = goal - self.nodes[near]
        size = float(np.abs(step).max())
        pose = goal if size <= REACH else self.nodes[near] + step * (REACH / size)
        if not self._poses.is_free_between(self.nodes[near], pose):
            return None
        self.nodes.append(pose)
        self._parents.append(near)
        return len(self.nodes) - 1

    def way(self, leaf: int) -> list[Array]:
        """Poses from a leaf to the root."""
        places = [leaf]
        while self._parents[places[-1]] >= 0:
            places.append(self._parents[places[-1]])
        return [self.nodes[k] for k in places]


def _shortened(poses: FreePoses, corners: Array, rng: np.random.Generator) -> Array:
    """The polyline with straight ways between random places where these are free and shorter."""
    for _ in range(SHORTCUTS):
        if len(corners) == 2:
            break
        lengths = along(corners)
        first, last = np.sort(rng.uniform(0.0, lengths[-1], 2))
        between = (lengths > first) & (lengths < last)
        ends = places(corners, np.array([first, last]))
        if between.any() and poses.is_free_between(*ends):
            corners = np.array([*corners[lengths <= first], *ends, *corners[lengths >= last]])
    # Corners that a straight way passes by freely.
    k = 1
    while k < len(corners) - 1:
        if poses.is_free_between(corners[k - 1], corners[k + 1]):
            corners = np.delete(corners, k, axis=0)
        else:
            k += 1
    return corners


def along(corners: Array) -> Array:
    """Length of a polyline up to each corner, (K,), the largest step of a joint as the metric."""
    return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners, axis=0)).max(axis=1))])


def places(corners: Array, length: Array) -> Array:
    """Places on a polyline.

    corners (K, n) [rad, m], length (N,) → (N, n) [rad, m].
    """
    known = along(corners)
    return np.stack([np.interp(length, known, column) for column in corners.T], axis=1)
