"""Motions one after another, each from the rest in which the one before ends."""

from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.motion.trajectory import Trajectory
from runtime.library import Array, Library

GAP = 1e-6
"""Largest distance between the end of a motion and the start of the next [rad, m]."""

WAYS = ("approach", "return")
"""Names of the parts before and after a motion."""


@dataclass(frozen=True, slots=True)
class JoinedMotion:
    """Several motions in a row, as one motion.

    Attributes:
        parts: the motions in their order.
        names: one per part.

    Raises:
        IdentificationError: there is no part, or one does not begin where the last one ends.
    """

    parts: tuple[Trajectory, ...]
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.parts or len(self.parts) != len(self.names):
            raise IdentificationError("joined motions need at least one part and one name for each")
        for before, after in zip(self.parts, self.parts[1:], strict=False):
            away = float(np.abs(end_of(before) - after.home).max())
            if not away <= GAP:
                raise IdentificationError(
                    f"expected a motion that begins where the last one ends, it begins {away:.3g} "
                    "rad or m away; plan the way between them"
                )

    @property
    def home(self) -> Array:
        """Start of the first part, (n,) [rad, m]."""
        return self.parts[0].home

    @property
    def duration(self) -> float:
        """Of all parts [s]."""
        return sum(part.duration for part in self.parts)

    @property
    def starts(self) -> tuple[float, ...]:
        """Times at which the parts begin [s]."""
        return tuple(sum(part.duration for part in self.parts[:k]) for k in range(len(self.parts)))

    def at(self, lib: Library, t: Array) -> tuple[Array, Array, Array, Array]:
        """States at given times; where parts meet, those of the later one.

        t (N,) → (N, n).
        """
        t = np.asarray(t, dtype=float)
        states = np.empty((4, len(t), lib.n_joints))
        which = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, None)
        for k, (part, start) in enumerate(zip(self.parts, self.starts, strict=True)):
            rows = np.flatnonzero(which == k)
            if rows.size:
                states[:, rows] = part.at(lib, np.clip(t[rows] - start, 0.0, part.duration))
        q, dq, ddq, dddq = states
        return q, dq, ddq, dddq

    def slowed(self, speed: float) -> "JoinedMotion":
        """All parts at a share of their speeds, above 0 and up to 1."""
        parts = tuple(replace(part, duration=part.duration / speed) for part in self.parts)
        return replace(self, parts=parts)


def end_of(trajectory: Trajectory) -> Array:
    """Place at which a motion ends, (n,) [rad, m]."""
    basis, a = trajectory.basis, trajectory.coefficients
    return np.asarray(trajectory.home + a @ basis.derivatives(1, a.shape[1], np.ones(1))[0, 0])


def joined(
    approach: Trajectory | None, motion: Trajectory, back: Trajectory | None
) -> JoinedMotion:
    """Approach, motion and return as one motion."""
    parts = zip((WAYS[0], "motion", WAYS[1]), (approach, motion, back), strict=True)
    given = {name: part for name, part in parts if part is not None}
    return JoinedMotion(tuple(given.values()), tuple(given))
