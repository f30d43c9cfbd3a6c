"""Agreement of a log with the robot: units, signs and conventions of wrenches, errors that stay.

    r = w_b(π_URDF) − Σ_c J_b,cᵀ w_c,   w_c under other names, in other axes, halves or units

The base needs no joint torque, so its six equations show in which convention a wrench fits.
"""

from collections.abc import Mapping
from itertools import combinations, permutations

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.prior_file import PriorFile
from runtime.identification.free_base import rows as equations
from runtime.library import Array, Integers, Library
from runtime.library.free_base import FREEDOM
from runtime.library.parameters import links, mass
from runtime.recording import consistency
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion
from runtime.recording.recording import Recording

_FASTEST = 300.0
"""RMS acceleration of the base, m/s², from which its unit or its noise is wrong: 30 times g."""
_UNEXPLAINED = 0.5  # error over RMS of half of the rows from which a note states it
_FAR = 3.0
"""Distance of a sensor's error from 0 in its standard deviations from which a note states it."""


def require_prior_of_rows(prior: PriorFile | None, has_drives: bool) -> None:
    """Refuse entries of a prior that the equations of a log do not contain."""
    if prior is None:
        return
    tables: dict[str, object] = {"noise": prior.noise}
    if not has_drives:
        tables |= {"armature": prior.armature, "friction": prior.friction}
    stated = [f"[{key}]" for key, value in tables.items() if value is not None]
    if stated:
        raise IdentificationError(
            f"the prior states {', '.join(stated)}, and the equations of this log of a free base "
            "do not contain it; remove this table from the prior"
            + ("" if prior.noise is not None else ", or estimate friction with --friction")
        )


def require_clock(recording: FreeBaseRecording) -> None:
    """Refuse a time that is not in seconds, by velocities and positions of joints or base.

    A log without them is refused where its rate is too low to differentiate.
    """
    t, name = recording.t, recording.name
    if recording.dq is not None:
        measured = Recording(t, recording.q, dq=recording.dq)
    elif recording.twist is not None:
        velocity = np.einsum("nij,nj->ni", recording.rotation, recording.twist[:, :3])
        measured = Recording(t, recording.position, dq=velocity)
    else:
        rate = 1.0 / float(np.median(np.diff(t)))
        if rate < consistency.LEAST_RATE:
            raise IdentificationError(
                f"{name} has no velocities, and its rate of {rate:.3g} Hz is too low to "
                "differentiate the positions; give t in s"
            )
        return
    if len(t) <= 2 * consistency.STRIDE:
        return
    slopes = consistency.slopes_of(measured)
    if pair := consistency.unit_of_slopes(slopes, consistency.UNITS_OF_TIME):
        unit, wrong = pair
        raise IdentificationError(
            f"{name}: time looks like {unit}, positions change by {slopes[wrong[0]]:.3g} times "
            "the integral of the velocities; give t in s"
        )


def require_joint_units(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse joint positions far outside the limits, velocities in degrees, positions in mm."""
    fastest = float(np.sqrt(np.mean(np.sum(np.square(motion.ddq[:, :3]), axis=1))))
    if fastest > _FASTEST:
        raise IdentificationError(
            f"{name}: the base accelerates by {fastest:.3g} m/s² (RMS), expected at most "
            f"{_FASTEST:g}; give positions in m and t in s, or a low-pass with --cutoff"
        )
    q, dq = motion.q[:, FREEDOM:], motion.dq[:, FREEDOM:]
    if sentence := consistency.sentence_on_limits(q, lib):
        raise IdentificationError(
            f"{name}: {sentence}; give q in this unit, and the names of its columns by joints"
        )
    degree, slopes = consistency.DEGREE, consistency.slopes_of(Recording(motion.t, q, dq=dq))
    looks = {"degrees per second": 1 / degree, "radians for q in degrees": degree}
    if pair := consistency.unit_of_slopes(slopes, looks):
        unit, wrong = pair
        raise IdentificationError(
            f"{name}: the velocity of joint '{lib.joint_names[wrong[0]]}' looks like {unit}, "
            "expected the derivative of q; convert q to rad and dq to rad/s"
        )


def require_forces_on_robot(
    lib: Library, rows: equations.FreeBaseRows, instants: Integers, name: str
) -> None:
    """Refuse opposite wrenches, such as forces on the ground, by the equations of the base."""
    alone = not any(row in rows.names for row in lib.joint_names)
    complete = rows.samples.equations == len(rows.names) >= FREEDOM
    if not (alone or complete):
        return
    kept = slice(None) if alone else slice(FREEDOM)
    some = rows.samples.rows(instants)
    if equations.is_opposite(some.rigid(lib, lib.pi0)[:, kept], some.tau[:, kept]):
        raise IdentificationError(
            f"{name}: the contact wrenches are opposite to those that hold the URDF, expected "
            "forces on the robot; change their sign, or give quaternions of base_pose as x y z w"
        )


def notes_on_errors(
    rms: Array, after: Array, phi: Array, sensors: Mapping[str, float], are_named: bool = True
) -> tuple[str, ...]:
    """Notes on rows that the result does not explain, and on sensors far from what was stated."""
    notes = []
    loaded = rms > 0
    if not loaded.any():
        notes.append(
            "torques and wrenches of the test part are zero throughout, as in free flight; if "
            "sensors were off, choose another --split"
        )
    share = float(np.median(after[loaded] / rms[loaded])) if loaded.any() else 0.0
    if share > _UNEXPLAINED:
        unnamed = "" if are_named else " (the log has no array joints, which names them)"
        notes.append(
            f"half of the rows keep an error of {100 * share:.0f} % of their RMS or more: torques "
            "and wrenches do not fit this robot and motion; check names and order of joints"
            f"{unnamed} and contacts, contact_position, contact_kind, contact_axes and units"
        )
    for (name, spread), value in zip(sensors.items(), phi, strict=False):
        if abs(value) > _FAR * spread:
            notes.append(
                f"sensors: the error of {name} is {abs(value) / spread:.1f} times its stated "
                "standard deviation; check the contact forces, or state a larger one"
            )
    return tuple(notes)


_CLOSER = 3.0
"""Residual in the stated convention over that in another one from which the latter is named."""
_INSTANTS = 300
_ALL = 4  # number of contacts up to which every permutation is tried; beyond it, exchanges of two
_UNITS = {"kgf": 9.81, "kN": 1e3, "mN": 1e-3}  # unit of force → N
_NEAR = 0.25
"""Relative distance of a mean vertical force from the weight of the URDF that names its unit."""


def require_contact_conventions(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse wrenches under names of other contacts, in other axes, halves or units."""
    contacts = motion.contacts
    vertical = contacts.wrench[..., equations.VERTICAL]
    if contacts.axes == "world" and contacts.links and not np.isnan(vertical).any():
        # The mean of the vertical forces is the weight of the URDF, or it has another unit.
        mean = float(vertical.sum(axis=1).mean())
        weight = float(mass(links(lib.pi0)).sum()) * float(np.linalg.norm(lib.gravity))
        for unit, factor in _UNITS.items():
            if abs(mean * factor - weight) < _NEAR * weight:
                raise IdentificationError(
                    f"{name}: the vertical forces are {mean:.3g} in the mean, and the URDF weighs "
                    f"{weight:.3g} N; the forces look like {unit}, expected N; convert them"
                )
    known = np.flatnonzero(~np.isnan(contacts.wrench).any(axis=(1, 2)))
    if not contacts.links or known.size < 2:
        return
    some = motion.rows(known[np.linspace(0, known.size - 1, _INSTANTS).astype(int)])
    needed = lib.inverse_dynamics(some.q, some.dq, some.ddq, lib.pi0)[:, :FREEDOM]
    shape = (len(some), len(contacts.links), 6, -1)
    jacobian = equations.contact_jacobian(lib, some).reshape(shape)[..., :FREEDOM]
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
    jacobian = equations.contact_jacobian(lib, motion)[..., FREEDOM:]
    needed = needed - np.einsum("nck,nc->nk", jacobian, wrench.reshape(len(motion), -1))
    if equations.is_opposite(needed, motion.tau):
        raise IdentificationError(
            f"{name}: tau is opposite to the torques that move the URDF, expected those that the "
            "drives apply to the joints; change its sign"
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
    exchanged = ({a: b, b: a} for a, b in combinations(stated, 2))
    return [tuple(pair.get(k, k) for k in stated) for pair in exchanged]
