"""Conventions of the contact wrenches and of the torques, compared with the URDF.

    r = w_b(π_URDF) − Σ_c J_b,cᵀ w_c,   w_c under other names, in other axes, halves or units

The base needs no joint torque, so its six equations show in which convention a wrench fits.
"""

from itertools import combinations, permutations

import numpy as np

from runtime.errors import IdentificationError
from runtime.identification.free_base.rows import VERTICAL, contact_jacobian
from runtime.library import Array, Library
from runtime.library.free_base import FREEDOM
from runtime.library.parameters import links, mass
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion

_CLOSER = 3.0
"""Residual in the stated convention over that in another one from which the latter is named."""
_INSTANTS = 300
"""Instants that are compared."""
_ALL = 4
"""Number of contacts up to which every permutation is tried; beyond it, exchanges of two."""
_UNITS = {"kgf": 9.81, "kN": 1e3, "mN": 1e-3}
"""Unit of force → N."""
_NEAR = 0.25
"""Relative distance of a mean vertical force from the weight of the URDF that names its unit."""


def require_contact_conventions(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse wrenches under names of other contacts, in other axes, halves or units."""
    _require_newtons(lib, motion, name)
    contacts = motion.contacts
    known = np.flatnonzero(~np.isnan(contacts.wrench).any(axis=(1, 2)))
    if not contacts.links or known.size < 2:
        return
    some = motion.rows(known[np.linspace(0, known.size - 1, _INSTANTS).astype(int)])
    needed = lib.inverse_dynamics(some.q, some.dq, some.ddq, lib.pi0)[:, :FREEDOM]
    shape = (len(some), len(contacts.links), 6, -1)
    jacobian = contact_jacobian(lib, some).reshape(shape)[..., :FREEDOM]
    stated = float(np.linalg.norm(needed - _force(jacobian, some.contacts.wrench)))
    others = _other_conventions(lib, some, jacobian)
    distance = {key: float(np.linalg.norm(needed - force)) for key, force in others.items()}
    best = min(distance, key=lambda key: distance[key])
    if stated > _CLOSER * distance[best]:
        raise IdentificationError(f"{name}: the URDF shows that {best}")


def require_torque_sign(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse joint torques of the opposite sign, where every wrench was measured."""
    wrench = motion.contacts.wrench
    if motion.tau is None or np.isnan(wrench).any():
        return
    needed = lib.inverse_dynamics(motion.q, motion.dq, motion.ddq, lib.pi0)[:, FREEDOM:]
    jacobian = contact_jacobian(lib, motion)[..., FREEDOM:]
    needed = needed - np.einsum("nck,nc->nk", jacobian, wrench.reshape(len(motion), -1))
    if np.linalg.norm(needed - motion.tau) > _CLOSER * np.linalg.norm(needed + motion.tau):
        raise IdentificationError(
            f"{name}: tau is opposite to the torques that move the URDF, expected those that the "
            "drives apply to the joints; change its sign"
        )


def _require_newtons(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse vertical forces whose mean is the weight of the URDF in another unit."""
    contacts = motion.contacts
    if contacts.axes != "world" or not contacts.links:
        return
    vertical = contacts.wrench[..., VERTICAL]
    if np.isnan(vertical).any():
        return
    mean = float(vertical.sum(axis=1).mean())
    weight = float(mass(links(lib.pi0)).sum()) * float(np.linalg.norm(lib.gravity))
    for unit, factor in _UNITS.items():
        if abs(mean * factor - weight) < _NEAR * weight:
            raise IdentificationError(
                f"{name}: the vertical forces are {mean:.3g} in the mean, and the URDF weighs "
                f"{weight:.3g} N; the forces look like {unit}, expected N; convert them"
            )


def _force(jacobian: Array, wrench: Array) -> Array:
    """Forces and moments on the base, (N, 6), by wrenches (N, C, 6) and Jacobians (N, C, 6, 6)."""
    return np.einsum("ncik,nci->nk", jacobian, wrench)


def _other_conventions(lib: Library, motion: FreeBaseMotion, jacobian: Array) -> dict[str, Array]:
    """Forces on the base by what a log may mean instead, by the sentence that names it."""
    contacts, wrench = motion.contacts, motion.contacts.wrench
    swapped = "contact_wrench holds the moment first, expected the force first; swap the halves"
    forces = {swapped: _force(jacobian, np.roll(wrench, 3, axis=2))}
    for unit, factor in _UNITS.items():
        sentence = f"the contact wrenches are in {unit}, expected N and N·m; convert them"
        forces[sentence] = factor * _force(jacobian, wrench)
    index = [lib.link_names.index(link) for link in contacts.links]
    turn = lib.link_poses(motion.q)[:, index, :3, :3]  # R of the contacts' links in the world
    other = "world" if contacts.axes == "link" else "link"
    halves = wrench.reshape(*wrench.shape[:2], 2, 3)
    product = "ncji,nchj->nchi" if other == "world" else "ncij,nchj->nchi"
    forces[
        f"the contact wrenches are in axes of the {other}, and the log states those of the "
        f"{contacts.axes}; write contact_axes = '{other}'"
    ] = _force(jacobian, np.einsum(product, turn, halves).reshape(wrench.shape))
    for order in _orders(len(contacts.links)):
        names = ", ".join(contacts.links[c] for c in order)
        forces[
            f"the contact wrenches stand under other names: contact_links has "
            f"{', '.join(contacts.links)}, expected {names} in this order; correct contact_links, "
            "and contact_position with it"
        ] = _force(jacobian[:, list(order)], wrench)
    return forces


def _orders(count: int) -> list[tuple[int, ...]]:
    """Permutations that are tried, the stated one left out."""
    stated = tuple(range(count))
    if count <= _ALL:
        return [order for order in permutations(stated) if order != stated]
    orders = []
    for a, b in combinations(stated, 2):
        order = list(stated)
        order[a], order[b] = b, a
        orders.append(tuple(order))
    return orders
