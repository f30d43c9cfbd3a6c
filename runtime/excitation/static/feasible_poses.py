"""Random poses at rest that keep all limits, together with their approach from both sides.

A pose q is reached from q − s and from q + s, all joints at once. Coulomb friction has opposite
signs after the two approaches, so that it cancels in the mean of both torques.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.joint_limits import DEFAULT_RANGE
from runtime.excitation.limits.safety import Safety
from runtime.library import Array, Library

APPROACH = 0.05
"""Longest approach of a joint [rad, m]: beyond the backlash of usual gears."""
APPROACH_SHARE = 0.02
"""Longest approach as a share of the joint's range."""
ATTEMPTS = 200_000
"""Number of random poses that are tried before the robot counts as blocked."""
_CHUNK = 4096
_WAY = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Checked points of the approach, in units of s."""


@dataclass(frozen=True, slots=True)
class PoseRange:
    """Range of the joints at rest and length of the approach.

    Attributes:
        lower, upper: ends of the poses, (n,) rad or m; the approach stays within the limits.
        approach: s, (n,) rad or m.
        assumptions: ranges that the robot does not state, as sentences.
    """

    lower: Array
    upper: Array
    approach: Array
    assumptions: tuple[str, ...]


def pose_range(lib: Library, margin: float = 1.0) -> PoseRange:
    """Range of the poses: position limits shrunk by margin and approach."""
    if not 0 < margin <= 1:
        raise IdentificationError(
            f"a margin above 0 and up to 1 is needed, got {margin:g}; 0.95 leaves 5 % of the range "
            "unused"
        )
    limits = lib.limits()
    lower = np.where(np.isfinite(limits["lower"]), limits["lower"], lib.home - DEFAULT_RANGE)
    upper = np.where(np.isfinite(limits["upper"]), limits["upper"], lib.home + DEFAULT_RANGE)
    unknown = ~(np.isfinite(limits["lower"]) & np.isfinite(limits["upper"]))
    names = ", ".join(np.array(lib.joint_names)[unknown])
    assumed = (f"no position limits for {names}: {DEFAULT_RANGE:.4g} about home assumed",)
    middle, half = (upper + lower) / 2, margin * (upper - lower) / 2
    approach = np.minimum(APPROACH, APPROACH_SHARE * 2 * half)
    return PoseRange(
        middle - half + approach,
        middle + half - approach,
        approach,
        assumed if unknown.any() else (),
    )


def feasible_poses(
    lib: Library, count: int, safety: Safety, where: PoseRange, rng: np.random.Generator
) -> Array:
    """Random poses, uniform over the range, that keep every limit on both approaches."""
    limits = constraints(lib, lib.home, safety)
    n, kept, tried, total = lib.n_joints, [], 0, 0
    while total < count:
        if tried >= ATTEMPTS:
            raise IdentificationError(
                f"expected {count} poses within all limits, found {total} among {tried} random "
                "poses; lower --table, widen --box, or lower --clearance"
            )
        q = rng.uniform(where.lower, where.upper, (_CHUNK, n))
        way = (q[:, None] + np.array(_WAY)[:, None] * where.approach).reshape(-1, n)
        motion = np.zeros((4, len(way), n))
        motion[0] = way
        allowed = np.ones(len(way), dtype=bool)
        for limit in limits:
            # A value that is not a number counts as a broken limit.
            allowed &= (limit.values(motion) <= 0).all(axis=1)
        kept.append(q[allowed.reshape(_CHUNK, len(_WAY)).all(axis=1)])
        tried, total = tried + _CHUNK, total + len(kept[-1])
    return np.concatenate(kept)[:count]
