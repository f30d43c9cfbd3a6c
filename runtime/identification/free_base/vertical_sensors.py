"""Errors of the sensors of vertical contact forces: offsets, shared load, crosstalk of moments.

    F_read,c = F_c + o_c + γ F_c (1 − s_c) + c_x m_c,x + c_y m_c,y,   s_c = F_c / ΣF

o_c is an offset of sensor c while it is read. γ is common to the contacts: what two feet on the
ground press against each other, and a curved characteristic, appear in the sum of the sensors as
a term that is zero where one contact carries the robot. c are common to the contacts, too: how
much sensors of one type read of the moments m_c, which `contact_moments` predicts by the URDF.
"""

import numpy as np

from runtime.estimators.problem import FrictionPrior
from runtime.identification.free_base.contact_moments import contact_moments
from runtime.library import Array, Library
from runtime.recording.free_base import Contacts
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion

VERTICAL = 2
"""Place of the vertical force within a wrench."""
SMALLEST_OFFSET = 1e-6
"""Smallest standard deviation of an offset of a force sensor [N]."""
SMALLEST_SHARING = 1e-9
"""Smallest standard deviation of γ."""
CROSSTALK = ("crosstalk_x", "crosstalk_y")
"""Names of c."""


def reading_errors(lib: Library, motion: FreeBaseMotion) -> Array:
    """Errors of the C readings per unit of each of the K unknown coefficients.

    Returns (N, C, K) [1].
    """
    contacts = motion.contacts
    count, size = contacts.wrench.shape[:2]
    parts = [np.zeros((count, size, 0))]
    if contacts.offset_sigma is not None:
        read = np.ones((count, size)) if contacts.sensed is None else contacts.sensed
        parts.append(read[:, :, None] * np.eye(size))
    force = contacts.wrench[:, :, VERTICAL]
    if contacts.sharing_sigma is not None:
        parts.append((force * (1 - _shares(force, 1.0)))[:, :, None])
    if contacts.crosstalk_sigma is not None:
        axes = np.flatnonzero(contacts.crosstalk_sigma)
        parts.append(contact_moments(lib, motion, _shares(force, 0.0))[:, :, axes])
    return np.concatenate(parts, axis=2)


def error_names(contacts: Contacts) -> tuple[str, ...]:
    """Names of the K coefficients of `reading_errors`: links of the offsets, "sharing", axes."""
    offsets = () if contacts.offset_sigma is None else contacts.links
    sharing = () if contacts.sharing_sigma is None else ("sharing",)
    sigma = () if contacts.crosstalk_sigma is None else contacts.crosstalk_sigma
    crosstalk = [name for name, size in zip(CROSSTALK, sigma, strict=False) if size > 0]
    return (*offsets, *sharing, *crosstalk)


def sensor_prior(contacts: Contacts, shape: tuple[int, int]) -> FrictionPrior | None:
    """Gaussian prior of the coefficients of `reading_errors`, in the first row of φ."""
    known: list[float] = []
    if contacts.offset_sigma is not None:
        # A sensor that is stated to have no offset keeps one of rounding.
        known += np.maximum(contacts.offset_sigma, SMALLEST_OFFSET).tolist()
    if contacts.sharing_sigma is not None:
        known.append(max(contacts.sharing_sigma, SMALLEST_SHARING))
    if contacts.crosstalk_sigma is not None:
        known += contacts.crosstalk_sigma[contacts.crosstalk_sigma > 0].tolist()
    if not known:
        return None
    spread = np.full(shape, np.inf)
    spread[0] = known
    return FrictionPrior(np.zeros(shape), spread)


def _shares(force: Array, unloaded: float) -> Array:
    """Shares s (N, C) of the forces in their sum; `unloaded` where no contact carries load."""
    total = force.sum(axis=1, keepdims=True)
    return np.divide(force, total, out=np.full_like(force, unloaded), where=total > 0)
