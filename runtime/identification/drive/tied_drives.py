"""Drives of mirrored joints with motors and gears of one type: viscous friction and armature tied.

    φ_j ~ N(φ̄, (ρ φ̄)²),   φ̄ the mean of the joints that are tied

A motion of nearly constant speeds separates viscous from dry friction badly, and errors of the
friction model, not noise, then make the sides differ: each joint counts alike in the mean. Dry
friction depends on the assembly and stays apart.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from runtime.estimators.problem import FrictionPrior
from runtime.identification.drive.estimate import identify_drive
from runtime.identification.drive.result import DriveRequest, places_of
from runtime.identification.drive.symmetry import mirrored_joints
from runtime.identification.identified import Identification
from runtime.identification.problem_setup import known_friction
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording import Recording

TIED = ("viscous", "armature")
"""Keys of a drive that are tied."""
SPREAD = 0.1
"""ρ: motors and gears of one type differ by a tenth, mostly by wear and temperature."""


def identify_drives(
    recording: Recording,
    lib: Library,
    settings: Settings,
    request: DriveRequest,
    *,
    progress: Callable[[int, float], None] | None = None,
) -> Identification:
    """Identify a robot and its drives, first apart and then with those that are tied."""
    pairs, apart = request.tied, replace(request, tied=())
    if not pairs:
        return identify_drive(recording, lib, settings, apart, progress=progress)
    first = identify_drive(recording, lib, replace(settings, certify=False), apart)
    prior, names = tied_prior(first, settings, pairs)
    usual = replace(settings, friction_prior=prior, friction_columns=first.friction)
    result = identify_drive(recording, lib, usual, apart, progress=progress)
    note = (
        f"{' and '.join(names)} of the joints that --symmetric pairs are tied to their mean within "
        f"{100 * SPREAD:.0f} %, and the standard deviations count it; compare the sides without "
        "--tie"
    )
    kept = tuple(each for each in first.notes if each not in result.notes)
    return replace(result, notes=(note, *kept, *result.notes))


def tied_prior(
    result: Identification, settings: Settings, pairs: tuple[str, ...]
) -> tuple[FrictionPrior, tuple[str, ...]]:
    """Prior of friction that ties mirrored joints."""
    columns, phi = result.friction.columns, result.phi
    known = known_friction(settings, columns, result.friction)
    mean = np.zeros_like(phi) if known is None else known.mean.copy()
    sigma = np.full_like(phi, np.inf) if known is None else known.sigma.copy()
    group = np.arange(len(phi))
    for left, right in mirrored_joints(result.lib.joint_names, pairs):
        group[group == group[right]] = group[left]
    places = places_of(columns)
    names = tuple(key for key in TIED if key in places)
    for each in np.unique(group):
        joints = np.flatnonzero(group == each)
        for key in names if len(joints) > 1 else ():
            centre = float(phi[joints, places[key]].mean())
            if centre > 0:
                mean[joints, places[key]], sigma[joints, places[key]] = centre, SPREAD * centre
    return FrictionPrior(mean, sigma), names
