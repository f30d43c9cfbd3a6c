"""Contacts of a log that states neither forces nor flags, by the height of the feet.

    h_c = z · (p + R p_c),   touching where h_c ≤ min_k h_k + CLEARANCE

On flat ground, with z up. A foot that may touch counts as touching, which only loses equations; one
that touches and counts as lifted would bring its force into them as an error.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from runtime.identification.free_base.rows import contact_poses
from runtime.library import Library
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import places_of

CLEARANCE = 0.02
"""Height above the lowest foot from which a foot counts as lifted [m]: an attitude that is wrong by
a degree changes it by 1 cm where the feet are 0.6 m apart."""


def lifted_feet(recording: FreeBaseRecording, lib: Library) -> NDArray[np.bool_]:
    """Whether a contact is above the ground, (N, C)."""
    turns = Rotation.from_matrix(recording.rotation).as_rotvec()
    q = recording.q[:, places_of(recording, lib.joint_names)]
    points = [
        pose[:, 2, 3] + pose[:, 2, :3] @ position
        for pose, position in zip(
            contact_poses(lib, np.hstack([recording.position, turns, q]), recording.contacts),
            recording.contacts.position,
            strict=True,
        )
    ]
    height = np.stack(points, axis=1)
    return np.asarray(height > height.min(axis=1, keepdims=True) + CLEARANCE)


def with_contact_states(
    recording: FreeBaseRecording, lib: Library
) -> tuple[FreeBaseRecording, tuple[str, ...]]:
    """The recording without wrenches of lifted feet where nothing states them, and a sentence."""
    contacts = recording.contacts
    forces = contacts.wrench[..., :3]
    if contacts.is_stated or not contacts.links or not np.isnan(forces).all():
        return recording, ()
    lifted = lifted_feet(recording, lib)
    wrench = np.where(lifted[:, :, None], 0.0, contacts.wrench)
    sentence = (
        f"contacts follow from the height of the feet: lifted from {100 * CLEARANCE:g} cm above "
        f"the lowest one, {100 * lifted.mean():.0f} % of the log, on flat ground; give "
        "contact_flags elsewhere"
    )
    return replace(recording, contacts=replace(contacts, wrench=wrench)), (sentence,)
