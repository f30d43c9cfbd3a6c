"""Poses at which a robot may rest: ranges, gravity torque, box of the tip, distances.

The distances of a path between two poses are examined at steps of `STEP`; the certificate of the
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
