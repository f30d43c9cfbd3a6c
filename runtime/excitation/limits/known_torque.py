"""Torque p(q) of springs of known stiffness and of torque curves, with derivatives along a motion.

The library computes p(q). Derivatives are central differences of it: of a spring they are exact to
1e-8, and across a corner of a piecewise linear curve they are those of its chord.
"""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array, Library

STEP = 1e-5
"""Step of first differences, rad or m, or s along a motion: ε^⅓ of the usual sizes."""
WIDE = 1e-4
"""Step of second differences: ε^¼."""


@dataclass(frozen=True, slots=True)
class KnownTorque:
    """Springs and curves of one robot.

    Attributes:
        lib: the robot.
    """

    lib: Library

    def torque(self, q: Array) -> Array:
        """Torque p, (N, n) N·m, of positions (N, n)."""
        return self.lib.known_torque(q)

    def slope(self, q: Array) -> Array:
        """Slopes ∂p/∂q, (N, n, n), of positions (N, n)."""
        steps = STEP * np.eye(q.shape[1])
        columns = [(self.torque(q + e) - self.torque(q - e)) / (2 * STEP) for e in steps]
        return np.stack(columns, axis=2)

    def along(self, motion: Array) -> tuple[Array, Array, Array]:
        """Torque p and its two derivatives in time, (N, n) each, of a motion (3 or more, N, n)."""
        q, dq, ddq = motion[:3]
        rate = (self.torque(q + STEP * dq) - self.torque(q - STEP * dq)) / (2 * STEP)
        held, turn = self.torque(q), WIDE**2 / 2 * ddq
        later, before = (self.torque(q + s * WIDE * dq + turn) for s in (1, -1))
        return held, rate, (later - 2 * held + before) / WIDE**2

    def rate_slopes(self, motion: Array) -> tuple[Array, Array]:
        """Slopes of dp/dt by q and dq, (N, n, n) each, of a motion (2 or more, N, n)."""
        q, dq = motion[:2]
        by_q = (self.slope(q + WIDE * dq) - self.slope(q - WIDE * dq)) / (2 * WIDE)
        return by_q, self.slope(q)


def known_torque_of(lib: Library) -> KnownTorque | None:
    """Springs and curves of a robot; None where it has none."""
    return KnownTorque(lib) if "known_torque" in lib.manifest.kernels else None
