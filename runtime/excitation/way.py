"""A motion from one pose to another under all limits, and back.

The control points of a quintic B-spline lie on a free polyline: the motion begins and ends at rest
and rounds its corners, the less the more points there are. Its duration grows until the certificate
holds. A straight way is the quintic 10 s³ − 15 s⁴ + 6 s⁵.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.free_path import FreePoses, along, free_path, places
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.dependent_joints import DependentPosition, DependentVelocity
from runtime.excitation.limits.distance_limits import use_of
from runtime.excitation.limits.joint_limits import DEFAULT_ACCELERATION
from runtime.excitation.limits.nonlinear_limits import Constraint
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.spline import Transfer
from runtime.excitation.motion.trajectory import GAP, Trajectory, end_of
from runtime.excitation.proof.certificate import DISTANCES, Certificate, certificate_of
from runtime.excitation.proof.joint_bounds import KINDS
from runtime.excitation.search.design_settings import LONGEST
from runtime.library import Array, Library

PATHS = 4
"""Number of paths with corners that are made; the shortest motion is taken."""
POINTS = (8, 16, 32, 64, 128)
"""Numbers of control points that are tried in turn on a way with corners."""
SAMPLES = 400
"""Number of poses of a rounded way that are examined before its certificate."""
TIMED = (
    *("velocity", DependentVelocity.kind, "acceleration", "jerk"),
    *("torque rate", "tip speed"),
)
"""Limits that a longer duration keeps; they keep the share of the motion."""
UNTIMED = {DependentPosition.kind, "tip box", *DISTANCES}
"""Limits of the places on a way."""
SHORTEST = 0.2
"""Shortest way [s]."""
_ATTEMPTS = 40
_SLOWER = (1.02, 1.5)
"""Least and largest factor of the duration from one attempt to the next."""


@dataclass(frozen=True, slots=True)
class Way:
    """A way to the start of a motion."""

    # from the present pose to the start; None where the robot stands there already
    trajectory: Trajectory | None
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
    """A certified motion from one pose to another.

    start (n,) [rad, m], end (n,) [rad, m].
    """
    if not 0 < share <= 1:
        raise IdentificationError(
            f"a way may use a share of the limits above 0 and up to 1, got {share:g}; 0.95 leaves "
            "5 % to the controller"
        )
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
        "motion within the limits; choose another pose, or a smaller --clearance"
    )


def _smooth(lib: Library, poses: FreePoses, corners: Array, zero_jerk: bool) -> list[Trajectory]:
    """Free motions of one second along a polyline: with the fewest control points, and twice."""
    motions: list[Trajectory] = []
    for points in (1,) if len(corners) == 2 else POINTS:
        # The polyline from the start, without it: the last place is the end.
        length = along(corners)[-1] * np.arange(1, points + 1) / points
        a = (places(corners, length) - corners[0]).T
        moved = Trajectory(corners[0], np.ascontiguousarray(a), 1.0, Transfer(zero_jerk))
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
    timed = [one for one in limits if one.kind not in UNTIMED]
    for _ in range(_ATTEMPTS):
        motion = np.array(
            replace(moved, duration=duration).at(lib, np.linspace(0.0, duration, SAMPLES + 1))
        )
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
        use = _use(certificate_of(lib, timed, safety), share)
        if use is None:
            return None
        if use <= 1:
            return timed
        timed = replace(timed, duration=timed.duration * float(np.clip(use, *_SLOWER)))
    return None


def _use(certificate: Certificate, share: float) -> float | None:
    """Largest use of the limits that a longer duration keeps; None where another is exceeded."""
    if any(use.kind in {"position", *UNTIMED} for use in certificate.broken):
        return None
    uses = [use.bound / (share if use.kind in TIMED else 1.0) for use in certificate.uses]
    return max(uses) if np.isfinite(uses).all() else None


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
