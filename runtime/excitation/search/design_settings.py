"""The options of a design: one frozen record, which is sent to processes too."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypedDict

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.safety import Safety, require_share
from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import BASES, COSINE, LONGEST
from runtime.excitation.search.information import Information
from runtime.library import Array

SHORTEST = 1e-3  # shortest duration of a trajectory [s]: a controller has one period in it
MOST_HARMONICS = 1000  # largest number of harmonics; a search of as many takes hours


@dataclass(frozen=True, slots=True)
class DesignSettings:
    """Options of `design`.

    Attributes:
        duration: t_f, s.
        harmonics: M, from which the basis makes its functions.
        starts: number of searches from random motions and from motions near the best ones, see
            `variations`.
        seed: of the random starts.
        home: (n,) start and end position, rad or m; None is that of the robot.
        criterion: quantity to minimise, one of `CRITERIA`.
        basis: functions of the motion.
        information: noise, rate, earlier logs and unknowns; None is the base regressor alone,
            which only some criteria accept.
        safety: limits beyond position, velocity and acceleration of the joints; None keeps these
            alone, as the document does.
        margin: share of every limit that the motion may use, 0 < margin ≤ 1; distances and places
            have margins of their own in `safety`.

    Raises:
        IdentificationError: a duration, a number of harmonics or of starts without a meaning.
    """

    duration: float = 10.0
    harmonics: int = 5
    starts: int = 5
    seed: int = 0
    home: Array | None = None
    criterion: str = "cond"
    basis: Basis = COSINE
    information: Information | None = None
    safety: Safety | None = None
    margin: float = 1.0

    def __post_init__(self) -> None:
        possible = SHORTEST <= self.duration <= LONGEST and 1 <= self.harmonics <= MOST_HARMONICS
        if not possible or self.starts < 1:
            raise IdentificationError(
                f"a trajectory needs a positive duration up to {LONGEST:g} s, of {SHORTEST:g} s or "
                f"more, at least one harmonic and one start, at most {MOST_HARMONICS} harmonics, "
                f"got {self.duration:g} s, {self.harmonics}, {self.starts}"
            )
        end = self.basis.derivatives(1, self.basis.size(self.harmonics), np.ones(1))
        if np.abs(end).max() > 1e-6:  # bases vanish there to rounding
            raise IdentificationError(
                f"a design needs a basis that returns home, which '{self.basis.name}' does not; "
                f"choose from {', '.join(BASES)}"
            )
        require_share(self.margin, "a margin", "every limit to the controller")


class DesignKeywords(TypedDict, total=False):
    """Fields of `DesignSettings` as keywords."""

    duration: float
    harmonics: int
    starts: int
    seed: int
    home: Array | None
    criterion: str
    basis: Basis
    information: Information | None
    safety: Safety | None
    margin: float


def settings_from(settings: DesignSettings | None, keywords: Mapping[str, Any]) -> DesignSettings:
    """Settings with single options replaced."""
    known = [field.name for field in fields(DesignSettings)]
    for word in keywords:
        if word not in known:
            near = difflib.get_close_matches(word, known, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"choose from {', '.join(known)}"
            raise IdentificationError(f"a design has no option '{word}'; {hint}")
    return replace(settings or DesignSettings(), **keywords)
