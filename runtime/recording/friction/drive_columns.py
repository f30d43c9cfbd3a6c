"""Friction columns of a drive, the default where the torque is commanded and not measured.

A commanded torque passes the rotor and the gear before it reaches the link, so that armature and
friction are part of every such model; a torque sensor behind the gear measures neither.
"""

from runtime.recording.commanded_torque import COMMANDED
from runtime.recording.recording import Recording
from runtime.recording.settings import Friction

DRIVE = ("viscous", "coulomb", "offset", "rotor")
"""Names of the columns of one drive."""


def default_terms(recording: Recording) -> Friction | None:
    """Friction terms of a log for which no command names any.

    Args:
        recording: with its recipe and the source of its torque.

    Returns:
        Those of its recipe; the columns of a drive where the torque is commanded; None for none.
    """
    terms = recording.recipe.friction if recording.recipe else None
    if terms is None and recording.torque_source == COMMANDED and recording.columns is None:
        return Friction(columns=DRIVE)
    return terms
