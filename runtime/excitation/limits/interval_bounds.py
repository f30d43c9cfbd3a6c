"""Bounds of torques, tip and relative speeds of links on intervals of a motion.

A distance of two rigid bodies changes no faster than their points move against each other. Joints
that move both bodies leave the distance, and each of the others moves a point at |dq| times its
distance from the axis, at most.
"""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array, Library

ROUNDING = 1e-12
"""Of a value, relative to its bound: 64 ε of the motion, and some thousand operations."""


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body in a link: index of the joint that moves it, −1 for the base, and its reach.

    Attributes:
        joint: index.
        reach: largest distance of its points from the origin of the link, m.
    """

    joint: int
    reach: float


BASE = Body(-1, 0.0)
"""What stands still."""


class IntervalBounds:
    """Bounds on K intervals of one length; each kind is computed once for all constraints."""

    def __init__(self, lib: Library, motion: Array, step: float) -> None:
        """Bounds from those of the joints."""
        self.motion, self.step = motion, step
        self._lib, self._rows = lib, np.ascontiguousarray(motion.swapaxes(0, 1))
        self._torques: dict[bytes, Array] = {}
        self._tip: Array | None = None
        self._speeds: tuple[Array, Array] | None = None

    def bend(self, second: Array) -> Array:
        """Rise of a function above the larger end of an interval, δ²/8 sup |g''|.

        second (K, R) → (K, R).
        """
        return self.step**2 / 8 * second

    def torques(self, pi: Array) -> Array:
        """Bounds of |τ| and three derivatives in time, (4, K, n), of parameters (10 L,)."""
        key = pi.tobytes()
        if key not in self._torques:
            self._torques[key] = self._lib.torque_bounds(self._rows, pi).swapaxes(0, 1)
        return self._torques[key]

    def tip(self) -> Array:
        """Bounds of |p| of the tip and three derivatives in time, (4, K)."""
        if self._tip is None:
            self._tip = self._lib.tip_bounds(np.ascontiguousarray(self._rows[:, :4])).T
        return self._tip

    def approach(self, first: Body, second: Body = BASE) -> Array:
        """Bound of the rate of the distance of two bodies, (K,) m/s."""
        if self._speeds is None:
            self._speeds = self._lib.speed_bounds(np.ascontiguousarray(self._rows[:, :2]))
        origin, turn = self._speeds
        one, other = _path(self._lib, first.joint), _path(self._lib, second.joint)
        total = np.zeros(len(turn))
        for body, joints in ((first, one - other), (second, other - one)):
            for j in joints:
                total += origin[:, body.joint, j] + body.reach * turn[:, j]
        return total


def _path(lib: Library, joint: int) -> set[int]:
    """Joints between a link and the base."""
    joints = set()
    while joint >= 0:
        joints.add(joint)
        joint = lib.manifest.all_joints[joint].parent
    return joints
