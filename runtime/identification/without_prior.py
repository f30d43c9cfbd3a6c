"""Robots whose URDF states no masses: methods that need no inertial prior, or a prior file."""

from dataclasses import replace

from runtime.errors import IdentificationError
from runtime.estimators.methods import METHODS, chosen_method
from runtime.identification.settings import Settings
from runtime.library import Library

WITHOUT_PRIOR = "pc-ols"
"""Method for such a robot where none is named: consistent, and convex from any start."""


def settings_for(lib: Library, settings: Settings) -> Settings:
    """Settings with a method that the robot allows.

    The posterior of "map" draws every parameter to π0 of the URDF; placeholders of a URDF without
    <inertial> would pass for knowledge. The other methods only start there.
    """
    if not lib.placeholders or settings.prior is not None:
        return settings
    method = chosen_method(settings.method, settings.preset, settings.prior)
    if not METHODS[method].takes_prior:
        return settings
    if settings.method is None:
        return replace(settings, method=WITHOUT_PRIOR)
    raise IdentificationError(
        f"the method '{method}' needs an inertial prior, but the URDF of '{lib.name}' states no "
        f"<inertial>; use --method {WITHOUT_PRIOR}, give --prior, or build again with --masses"
    )


def note_for(lib: Library) -> tuple[str, ...]:
    """Sentence on what a result for a robot of placeholders determines; none for other robots."""
    if not lib.placeholders:
        return ()
    return (
        "the URDF states no <inertial>: only base parameters are determined by the data, the "
        "masses of single links are arbitrary, and errors before identification are meaningless",
    )
