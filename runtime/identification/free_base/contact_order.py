"""Order of the contacts, compared with the URDF.

    r_s = w_b(π_URDF) − Σ_c J_b,s(c)ᵀ w_c,   s a permutation of the contacts

The base needs no joint torque, so its six equations show under which name a wrench belongs.
"""

from itertools import combinations, permutations

import numpy as np

from runtime.errors import IdentificationError
from runtime.identification.free_base.rows import contact_jacobian
from runtime.library import Library
from runtime.library.free_base import FREEDOM
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion

_CLOSER = 3.0
"""Residual in the stated order over that in another one from which the latter is named."""
_INSTANTS = 300
"""Instants that are compared."""
_ALL = 4
"""Number of contacts up to which every permutation is tried; beyond it, exchanges of two."""


def require_contact_order(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse wrenches that stand under the names of other contacts.

    Args:
        lib: library of a robot with a free base.
        motion: prepared rows.
        name: of the file, for messages.

    Raises:
        IdentificationError: another order of the contacts fits the URDF far better.
    """
    contacts, count = motion.contacts, len(motion.contacts.links)
    known = np.flatnonzero(~np.isnan(contacts.wrench).any(axis=(1, 2)))
    if count < 2 or known.size < 2:
        return
    some = motion.rows(known[np.linspace(0, known.size - 1, _INSTANTS).astype(int)])
    jacobian = contact_jacobian(lib, some).reshape(len(some), count, 6, -1)[..., :FREEDOM]
    # force[c, d]: on the base by the wrench that stands under c, if it acts at d.
    force = np.einsum("ndij,nci->cdnj", jacobian, some.contacts.wrench)
    needed = lib.inverse_dynamics(some.q, some.dq, some.ddq, lib.pi0)[:, :FREEDOM]

    def residual(order: tuple[int, ...]) -> float:
        return float(np.linalg.norm(needed - force[np.arange(count), list(order)].sum(axis=0)))

    stated = tuple(range(count))
    best = min(_orders(count), key=residual)
    if residual(stated) > _CLOSER * residual(best):
        raise IdentificationError(
            f"{name}: the contact wrenches fit the URDF far better in another order of the "
            f"contacts: contact_links has {', '.join(contacts.links)}, expected "
            f"{', '.join(contacts.links[c] for c in best)} in this order; correct contact_links, "
            "and contact_position with it"
        )


def _orders(count: int) -> list[tuple[int, ...]]:
    """Permutations that are tried."""
    if count <= _ALL:
        return list(permutations(range(count)))
    orders = []
    for a, b in combinations(range(count), 2):
        order = list(range(count))
        order[a], order[b] = b, a
        orders.append(tuple(order))
    return orders
