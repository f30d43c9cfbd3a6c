"""Errors of the sensors of vertical contact forces: offsets, and error where the load is shared.

    F_read,c = F_c + o_c + γ F_c (1 − s_c),   s_c = F_c / ΣF

o_c is an offset of sensor c while it is read. γ is common to the contacts: what two feet on the
ground press against each other, and a curved characteristic, appear in the sum of the sensors as
a term that is zero where one contact carries the robot.
"""

import numpy as np

from runtime.estimators.problem import FrictionPrior
from runtime.library import Array
from runtime.recording.free_base import Contacts

VERTICAL = 2
"""Place of the vertical force within a wrench."""
SMALLEST_OFFSET = 1e-6
"""Smallest standard deviation of an offset of a force sensor [N]."""
SMALLEST_SHARING = 1e-9
"""Smallest standard deviation of γ."""


def reading_errors(contacts: Contacts) -> Array:
    """Errors of the C readings per unit of each of the K unknown coefficients.

    Args:
        contacts: of N instants; where offsets or γ are stated, with vertical forces of all.

    Returns:
        (N, C, K): o_c of every contact [1], then γ [N]; K = 0 where the log states neither.
    """
    count, size = contacts.wrench.shape[:2]
    parts = [np.zeros((count, size, 0))]
    if contacts.offset_sigma is not None:
        read = np.ones((count, size)) if contacts.sensed is None else contacts.sensed
        parts.append(read[:, :, None] * np.eye(size))
    if contacts.sharing_sigma is not None:
        force = contacts.wrench[:, :, VERTICAL]
        total = force.sum(axis=1, keepdims=True)
        share = np.divide(force, total, out=np.ones_like(force), where=total > 0)
        parts.append((force * (1 - share))[:, :, None])
    return np.concatenate(parts, axis=2)


def error_names(contacts: Contacts) -> tuple[str, ...]:
    """Names of the K coefficients of `reading_errors`: links of the offsets, then "sharing"."""
    offsets = () if contacts.offset_sigma is None else contacts.links
    return (*offsets, *(() if contacts.sharing_sigma is None else ("sharing",)))


def sensor_prior(contacts: Contacts, shape: tuple[int, int]) -> FrictionPrior | None:
    """Gaussian prior of the coefficients of `reading_errors`, in the first row of φ.

    Args:
        contacts: with the standard deviations.
        shape: of φ, (m, K).

    Returns:
        Prior of mean 0; None where the log states no error.
    """
    known: list[float] = []
    if contacts.offset_sigma is not None:
        # A sensor that is stated to have no offset keeps one of rounding.
        known += np.maximum(contacts.offset_sigma, SMALLEST_OFFSET).tolist()
    if contacts.sharing_sigma is not None:
        known.append(max(contacts.sharing_sigma, SMALLEST_SHARING))
    if not known:
        return None
    spread = np.full(shape, np.inf)
    spread[0] = known
    return FrictionPrior(np.zeros(shape), spread)
