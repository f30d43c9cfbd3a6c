"""A motion from one pose to another under all limits, and back.

The control points of a quintic B-spline lie on a free polyline: the motion begins and ends at rest
and rounds its corners, the less the more points there are. Its duration grows until the certificate
holds. A straight way is the quintic 10 s³ − 15 s⁴ + 6 s⁵.

Collision-free polylines between two poses: straight, or by RRT-Connect with shortcuts.

Two trees grow from both ends towards random poses and towards each other. Distances between poses
are times at full speed, so that fast joints move most. Source: Kuffner and LaValle, "RRT-Connect:
an efficient approach to single-query path planning", ICRA 2000.

Ranges, gravity torque, the box of the tip and distances decide at which poses a robot may rest. The
distances of a path between two poses are examined at steps of `STEP`; the certificate of the
finished motion decides on all instants.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import DEFAULT_ACCELERATION, constraints
from runtime.excitation.limits.distance_limits import use_of
from runtime.excitation.limits.nonlinear_limits import DEPENDENT, Braking, Constraint
from runtime.excitation.limits.safety import Safety, require_share
from runtime.excitation.motion.family import Spline
from runtime.excitation.motion.trajectory import GAP, LONGEST, Trajectory, end_of
from runtime.excitation.proof.bounds import KINDS
from runtime.excitation.proof.certificate import PLACES, certificate_of
from runtime.library import Array, Library, Mask

STEP = 0.03  # largest step of a joint between two examined poses [rad, m]
SPARE = 0.05  # share of a limit, or of 0.1 m, that paths keep beyond the margins if they can
REACH = 0.5  # longest edge of a tree, largest step of a joint [rad, m]
MOST_POSES = 4000  # number of random poses after which no way is expected
SHORTCUTS = 150  # number of random shortcuts that are tried
RANGE = np.pi  # range on both sides of the ends for joints without limits [rad, m]


class FreePoses:
    """Poses that keep the limits at rest; of the spare share only as much as the ends (2, n) do."""

    def __init__(self, lib: Library, safety: Safety, ends: Array) -> None:
        self._lib = lib
        # Braking enters by the range; speeds and rates vanish at rest.
        moving = {Braking.kind, *TIMED}
        self._limits = [one for one in constraints(lib, ends[0], safety) if one.kind not in moving]
        self.lower, self.upper = _range(lib)
        for pose, name in zip(ends, ("start", "end"), strict=True):
            self._require(pose, name)
        self._spare = min(SPARE, 0.5 * float(-self._worst(ends).max(initial=-1.0)))

    def are_free(self, q: Array) -> Mask:
        """Whether poses (N, n) [rad, m] keep all limits with the spare share, (N,)."""
        inside = ((q >= self.lower) & (q <= self.upper)).all(axis=1)
        return np.asarray(inside & (self._worst(q) < -self._spare))

    def is_free_between(self, first: Array, last: Array) -> bool:
        """Whether the straight way between two poses (n,) is free."""
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
    """A free polyline (K, n) [rad, m] between two poses."""
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
    """Places (N, n) at lengths (N,) on a polyline (K, n) [rad, m]."""
    known = along(corners)
    return np.stack([np.interp(length, known, column) for column in corners.T], axis=1)


PATHS = 4  # number of paths with corners that are made; the shortest motion is taken
POINTS = (8, 16, 32, 64, 128)  # numbers of control points tried in turn on a way with corners
SAMPLES = 400  # number of poses of a rounded way that are examined before its certificate
TIMED = (*("velocity", DEPENDENT[1], "acceleration", "jerk"), *("torque rate", "tip speed"))
"""Limits that a longer duration keeps; they keep the share of the motion."""
SHORTEST = 0.2  # shortest way [s]
_ATTEMPTS = 40
_SLOWER = (1.02, 1.5)  # least and largest factor of the duration from one attempt to the next


@dataclass(frozen=True, slots=True)
class Way:
    """A way to the start of a motion."""

    trajectory: Trajectory | None  # from the present pose to the start; None if it is there already
    corners: int = 0  # number of corners of the polyline, 0 for a straight way


def way_to(
    lib: Library,
    start: Array,
    end: Array,
    safety: Safety,
    share: float = 1.0,
    zero_jerk: bool = False,
    seed: int = 0,
) -> Way:
    """A certified motion from one pose to another, (n,) [rad, m] each."""
    require_share(share, "a share of the limits", "every limit to the controller")
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    poses = FreePoses(lib, safety, np.array([start, end]))
    if np.abs(end - start).max() <= GAP:
        return Way(None)
    limits = constraints(lib, start, safety)
    paths: list[tuple[Trajectory, int]] = []
    for k in range(PATHS):
        corners = free_path(lib, poses, start, end, seed + k)
        for moved in _smooth(lib, poses, corners, zero_jerk):
            paths.append((_sampled(lib, moved, limits, share), len(corners) - 2))
        if len(corners) == 2:
            break
    for moved, count in sorted(paths, key=lambda one: one[0].duration):
        timed = _certified(lib, moved, safety, share)
        if timed is not None:
            return Way(timed, count)
    raise IdentificationError(
        "the way from the start to the end keeps its distances on a polyline and not as a smooth "
        "motion within the limits; choose another pose, or a smaller clearance"
    )


def _smooth(lib: Library, poses: FreePoses, corners: Array, zero_jerk: bool) -> list[Trajectory]:
    """Free motions of one second along a polyline: with the fewest control points, and twice."""
    motions: list[Trajectory] = []
    for points in (1,) if len(corners) == 2 else POINTS:
        # The polyline from the start, without it: the last place is the end.
        length = along(corners)[-1] * np.arange(1, points + 1) / points
        a = (places(corners, length) - corners[0]).T
        spline = Spline(zero_jerk, arrives=True)
        moved = Trajectory(corners[0], np.ascontiguousarray(a), 1.0, spline)
        q = moved.at(lib, np.linspace(0.0, 1.0, SAMPLES + 1))[0]
        if len(corners) == 2 or poses.are_free(q).all():
            motions.append(moved)
        if len(motions) == 2:
            break
    return motions


def way_back(lib: Library, way: Trajectory, safety: Safety, share: float = 1.0) -> Trajectory:
    """The same path from the end of a way to its start."""
    there = np.column_stack([np.zeros(lib.n_joints), way.coefficients])
    back = (there - there[:, -1:])[:, -2::-1]
    turned = replace(way, home=end_of(way), coefficients=np.ascontiguousarray(back), duration=1.0)
    limits = constraints(lib, turned.home, safety)
    timed = _certified(lib, _sampled(lib, turned, limits, share), safety, share)
    if timed is None:
        raise IdentificationError(
            "the way back exceeds a limit that the way there keeps; choose another pose"
        )
    return timed


def _sampled(
    lib: Library, moved: Trajectory, limits: Sequence[Constraint], share: float
) -> Trajectory:
    """The motion with the shortest duration that keeps the limits at samples, to `_SLOWER`."""
    duration = max(SHORTEST, _least_duration(lib, moved, share))
    timed = [one for one in limits if one.kind not in PLACES]
    for _ in range(_ATTEMPTS):
        t = np.linspace(0.0, duration, SAMPLES + 1)
        motion = np.array(replace(moved, duration=duration).at(lib, t))
        uses = [
            use_of(one, float(one.values(motion).max())) / (share if one.kind in TIMED else 1.0)
            for one in timed
        ]
        use = max(uses, default=0.0)
        if not use > 1:
            break
        duration *= float(np.clip(use, *_SLOWER))
    return replace(moved, duration=duration)


def _certified(lib: Library, moved: Trajectory, safety: Safety, share: float) -> Trajectory | None:
    """The motion, or a slower one, that keeps the limits by its certificate; None without one."""
    timed = moved
    for _ in range(_ATTEMPTS):
        if timed.duration > LONGEST:
            return None
        certificate = certificate_of(lib, timed, safety)
        uses = [use.bound / (share if use.kind in TIMED else 1.0) for use in certificate.uses]
        # A longer duration keeps no limit of places.
        if any(use.kind in PLACES for use in certificate.broken) or not np.isfinite(uses).all():
            return None
        if max(uses) <= 1:
            return timed
        timed = replace(timed, duration=timed.duration * float(np.clip(max(uses), *_SLOWER)))
    return None


def _least_duration(lib: Library, moved: Trajectory, share: float) -> float:
    """Duration that the samples of velocity, acceleration and jerk need [s]; the k-th root."""
    states = moved.at(lib, np.linspace(0.0, 1.0, SAMPLES + 1))[1:]
    limits, least = lib.limits(), 0.0
    for k, (kind, values) in enumerate(zip(KINDS[1:], states, strict=True), 1):
        limit = limits[kind]
        if kind == "acceleration":
            limit = np.where(np.isfinite(limit), limit, DEFAULT_ACCELERATION)
        use = float((np.abs(values).max(axis=0) / (share * limit)).max())
        least = max(least, use ** (1 / k))
    return least
