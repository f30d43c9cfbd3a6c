"""Motions q(t) = home + Σ_m a_m φ_m(t) per joint, at rest at both ends (Eqs. 3.24–3.28).

The functions φ of s = t/t_f vanish at both ends with two derivatives. On request the third
derivative vanishes at both ends too; the polynomials gain two degrees then. Another package adds a
basis by an entry point of the group "symgen.bases". Motions can be joined one after another, each
from the rest in which the one before ends.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.motion.family import Basis, BasisFamily
from runtime.excitation.motion.fourier import Cosine
from runtime.excitation.motion.spline import Transfer
from runtime.library import Array, Library
from runtime.registry import Registry

GAP = 1e-6
"""Largest distance between the end of a motion and the start of the next [rad, m]."""
WAYS = ("approach", "return")
"""Names of the parts before and after a motion."""
COSINE = Cosine()
"""The default basis."""
BASES = Registry(
    "symgen.bases",
    BasisFamily,
    "basis",
    {
        "cosine": "runtime.excitation.motion.fourier:COSINE_FAMILY",
        "fourier": "runtime.excitation.motion.fourier:FOURIER_FAMILY",
        "bspline": "runtime.excitation.motion.spline:SPLINE_FAMILY",
    },
)
"""All bases of excitation motions by name; these return home."""
MOST_SAMPLES = 10_000_000
"""Largest number of samples: more exceed the memory of an ordinary computer."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Motion q(t) of n joints from `home`, at rest at both ends; back to it with most bases.

    Attributes:
        home: (n,) rad or m.
        coefficients: a, (n, M) rad or m.
        duration: t_f, s.
        basis: functions φ.
    """

    home: Array
    coefficients: Array
    duration: float
    basis: Basis = COSINE

    def at(self, lib: Library, t: Array) -> tuple[Array, Array, Array, Array]:
        """States at given times.

        Args:
            lib: the robot.
            t: times, (N,) s.

        Returns:
            q, dq, ddq, dddq, (N, n) each.
        """
        basis = self.basis.at(lib, self.coefficients.shape[1], t, self.duration)
        q, dq, ddq, dddq = np.einsum("jm,tmd->dtj", self.coefficients, basis)
        return q + self.home, dq, ddq, dddq


def basis_of(name: str, zero_jerk: bool = False) -> Basis:
    """The basis of this name."""
    if name == Transfer.name:
        return Transfer(zero_jerk)
    if name not in BASES:
        raise IdentificationError(
            f"there is no basis '{name}' of trajectories; choose from {', '.join(BASES)}"
        )
    return BASES[name].make(zero_jerk)


def sample_times(duration: float, rate_hz: float) -> Array:
    """Times 0, 1/rate, … up to the duration.

    Args:
        duration: s.
        rate_hz: sampling rate, Hz.

    Returns:
        (N,) s.

    Raises:
        IdentificationError: values that make no clock, or one of more than `MOST_SAMPLES`.
    """
    samples = duration * rate_hz
    if not (duration > 0 and rate_hz > 0 and samples < MOST_SAMPLES):
        raise IdentificationError(
            "a motion needs a positive duration and sampling rate that make fewer than "
            f"{MOST_SAMPLES:,} samples, got {duration:g} s and {rate_hz:g} Hz"
        )
    return np.arange(round(samples) + 1) / rate_hz


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
        """Duration of all parts together [s]."""
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
