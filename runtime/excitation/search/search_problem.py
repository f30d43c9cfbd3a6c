"""What a search is given, in a form that can be sent to other processes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.basis import COSINE
from runtime.excitation.motion.family import Basis
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import Information
from runtime.library import Array, Library


@dataclass(frozen=True, slots=True)
class SearchProblem:
    """What is searched, small enough to be sent to another process.

    Attributes:
        folder: of the robot.
        level: of its library.
        home: (n,) rad or m.
        harmonics: M.
        duration: t_f, s.
        seed: of all starts.
        basis: of the motion.
        criterion: one of `CRITERIA`.
        information: of the unknowns; None is all base parameters by their regressor alone.
        safety: limits beyond those of joints; None as in the document.
        margin: share of every limit that may be used.
    """

    folder: Path
    level: str
    home: Array
    harmonics: int
    duration: float
    seed: int
    basis: Basis = COSINE
    criterion: str = "cond"
    information: Information | None = None
    safety: Safety | None = None
    margin: float = 1.0


def problem_of(lib: Library, settings: DesignSettings) -> SearchProblem:
    """The problem of a design."""
    rest = lib.home if settings.home is None else np.asarray(settings.home, dtype=float)
    return SearchProblem(
        *(lib.folder, lib.level, rest, settings.harmonics, settings.duration, settings.seed),
        *(settings.basis, settings.criterion, settings.information, settings.safety),
        margin=settings.margin,
    )
