"""Equations of a robot with a free base.

    Y(q, v, a) π = [0; τ] + Σ_c J_cᵀ w_c

Rows are chosen ("base", "joints" or "all"). Components of contact wrenches that were not measured
are eliminated by multiplication with a basis of the null space of their Jacobian, N(t)ᵀ Jᵀ = 0.
Errors of the sensors of vertical forces, offsets, shared load and crosstalk of moments, are columns
of their own,

    F_read,c = F_c + o_c + γ F_c (1 − s_c) + c_x m_c,x + c_y m_c,y,   s_c = F_c / ΣF

o_c is an offset of sensor c while it is read. γ is common to the contacts: what two feet on the
ground press against each other, and a curved characteristic, appear in the sum of the sensors as
a term that is zero where one contact carries the robot. c are common to the contacts, too: how
much sensors of one type read of the moments m_c, which `contact_moments` predicts by the URDF,

    m_c = R_cᵀ s_c (m − Σ_k (p_k − p) × s_k f),   s_c = F_c / ΣF

Rows of a commanded torque, and of a measured one where it is requested, have the friction and
armature of every joint and the delay δ as further columns, F φ + δ τ̇, and are multiplied by L⁻¹ of
the covariance Σ = L Lᵀ of their noise first, so that those that the null space mixes are
independent and of equal noise:

    N(t)ᵀ L⁻¹ (Y π + [0; F φ + δ τ̇] − [0; τ]) = e,   N(t)ᵀ L⁻¹ Jᵀ = 0

Other components of a measured wrench have constant offsets, too, by default of `OFFSET_SIGMA`. They
are integrated out: N_o(t) = N(t)ᵀ L⁻¹ Jᵀ σ per component, and the estimate keeps its value.

f and m are force and moment on the base about its origin p, predicted by the URDF from the motion.
Forces, and the moment that remains, are shared by the contacts like the vertical forces. Where one
contact carries the robot this is exact; the sum over contacts of equal axes always is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from runtime.errors import IdentificationError
from runtime.estimators.problem import OF
from runtime.estimators.regression.samples import Samples, names_of_equations
from runtime.library import Array, Library, Mask
from runtime.library.free_base import FREEDOM
from runtime.recording.free_base import Contacts, FreeBaseRecording
from runtime.recording.friction.coupled_motors import Coupling, spread
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion, places_of
from runtime.recording.settings import Friction

DELAY = "delay of the commands"  # name of the coefficient δ [s]
VERTICAL = 2  # place of the vertical force within a wrench
SMALLEST_OFFSET = 1e-6  # smallest standard deviation of an offset of a force sensor [N]
OFFSET_SIGMA = np.repeat([1.0, 0.05], 3)
"""Standard deviation of the offsets of a wrench sensor, where the log states none [N, N·m]."""
SMALLEST_SHARING = 1e-9  # smallest standard deviation of γ
CROSSTALK = ("crosstalk_x", "crosstalk_y")  # names of c
_FORCE = slice(0, 3)
_MOMENT = slice(3, FREEDOM)
CHOSEN = {"all": slice(None), "base": slice(0, FREEDOM), "joints": slice(FREEDOM, None)}
RANK = 1e-6
"""Singular value of the Jacobian of unknown wrenches, relative to the largest, that counts."""
OPPOSITE = 3.0
"""Residual of the URDF over that with the opposite sign from which signs count as wrong."""
_BLOCK = 512


def reading_errors(lib: Library, motion: FreeBaseMotion) -> Array:
    """Errors of the C readings per unit of each of the K unknown coefficients, (N, C, K) [1]."""
    contacts = motion.contacts
    count, size = contacts.wrench.shape[:2]
    parts = [np.zeros((count, size, 0))]
    if contacts.offset_sigma is not None:
        read = np.ones((count, size)) if contacts.sensed is None else contacts.sensed
        parts.append(of_each_log(read[:, :, None] * np.eye(size), motion))
    force = contacts.wrench[:, :, VERTICAL]
    if contacts.sharing_sigma is not None:
        parts.append((force * (1 - _shares(force, 1.0)))[:, :, None])
    if contacts.crosstalk_sigma is not None:
        axes = np.flatnonzero(contacts.crosstalk_sigma)
        parts.append(contact_moments(lib, motion, _shares(force, 0.0))[:, :, axes])
    return np.concatenate(parts, axis=2)


def of_each_log(columns: Array, motion: FreeBaseMotion) -> Array:
    """Columns (N, m, k) whose coefficients differ between L logs, (N, m, L k)."""
    is_of = motion.log[:, None] == np.arange(len(motion.logs))
    return np.einsum("nl,nmk->nmlk", is_of, columns).reshape(*columns.shape[:2], -1)


def sensor_errors(contacts: Contacts, logs: Sequence[str] = ("",)) -> list[tuple[str, float]]:
    """Name (link, "sharing", axis of crosstalk) and σ of the K coefficients of `reading_errors`."""
    known: list[tuple[str, float]] = []
    if contacts.offset_sigma is not None:
        # A sensor that is stated to have no offset keeps one of rounding.
        sigma = np.maximum(contacts.offset_sigma, SMALLEST_OFFSET).tolist()
        for log in logs:
            of_log = f"{OF}{log}" if len(logs) > 1 else ""
            known += zip([f"{name}{of_log}" for name in _names(contacts.links)], sigma, strict=True)
    if contacts.sharing_sigma is not None:
        known.append(("sharing", max(contacts.sharing_sigma, SMALLEST_SHARING)))
    if contacts.crosstalk_sigma is not None:
        pairs = zip(CROSSTALK, contacts.crosstalk_sigma.tolist(), strict=True)
        known += [pair for pair in pairs if pair[1] > 0]
    return known


def _names(links: Sequence[str]) -> list[str]:
    """Names of contacts by their links, each another one."""
    numbers = [links[: k + 1].count(link) for k, link in enumerate(links)]
    return [
        link if links.count(link) == 1 else f"{link} {number}"
        for link, number in zip(links, numbers, strict=True)
    ]


def _shares(force: Array, unloaded: float) -> Array:
    """Shares s (N, C) of the forces in their sum; `unloaded` where no contact carries load."""
    total = force.sum(axis=1, keepdims=True)
    return np.divide(force, total, out=np.full_like(force, unloaded), where=total > 0)


def contact_moments(lib: Library, motion: FreeBaseMotion, shares: Array) -> Array:
    """Moments (N, C, 3) [N·m] about the contact points that the motion needs, in axes of links."""
    base = lib.inverse_dynamics(motion.q, motion.dq, motion.ddq, lib.pi0)
    force = np.einsum("nij,nj->ni", motion.rotation, base[:, _FORCE])
    rest = np.einsum("nij,nj->ni", motion.rotation, base[:, _MOMENT])
    poses = lib.link_poses(motion.q)
    turns = []
    contacts = motion.contacts
    for k, (link, position) in enumerate(zip(contacts.links, contacts.position, strict=True)):
        pose = poses[:, lib.link_names.index(link)]
        turns.append(pose[:, :3, :3])
        point = pose[:, :3, 3] + turns[-1] @ position - motion.q[:, :3]
        rest = rest - np.cross(point, shares[:, [k]] * force)
    moments = [turn.swapaxes(1, 2) @ rest[:, :, None] for turn in turns]
    return np.stack(moments, axis=1)[..., 0] * shares[:, :, None]


@dataclass(frozen=True, slots=True, eq=False)
class Drives:
    """What lies between commanded or measured torques and those at the links."""

    terms: Friction  # friction columns of the joints
    # (6 + n, 6 + n) of the noise of the rows [N², …]; None before it is known
    covariance: Array | None = None
    delay_s: float = 0.0  # by which the commands act later [s]
    is_delay_unknown: bool = False  # whether the delay has a column

    def names(self, joints: tuple[str, ...]) -> tuple[str, ...]:
        """Names of the coefficients, joint by joint, the delay last."""
        late = (DELAY,) if self.is_delay_unknown else ()
        return (*(f"{c}{OF}{joint}" for joint in joints for c in self.terms.columns), *late)

    def columns(self, motion: FreeBaseMotion) -> Array:
        """Torques per unit of the coefficients, (N, n, K)."""
        values = spread(np.asarray(motion.friction), None)
        if self.is_delay_unknown and motion.tau_rate is not None:
            values = np.concatenate([values, motion.tau_rate[:, :, None]], axis=2)
        return values


@dataclass(frozen=True, slots=True, eq=False)
class FreeBaseRows:
    """Equations of some instants."""

    samples: Samples  # rows Y_b and their right side; m rows per instant
    basis: Array  # (N, k, m) N of the k chosen rows; identity where every wrench was measured
    names: tuple[str, ...]  # of the k chosen rows
    root: Array  # (k, k) L, what the rows were divided by
    offsets: Array  # (N, m, o) N_o, columns of constant offsets of σ that the intervals contain
    has_drives: bool  # whether equations are divided by the noise of the drives, too

    def over_rows(self) -> Samples:
        """The equations as the least values of the chosen rows."""
        back, samples = self.root @ self.basis, self.samples
        tau = np.einsum("nkm,nm->nk", back, samples.tau)
        return _samples(back @ np.asarray(samples.base), tau, back @ samples.columns)

    def shown(self) -> tuple[tuple[str, ...], Samples]:
        """Names of the rows whose errors are stated, and these rows."""
        return (self.names, self.over_rows()) if self.has_drives else (self.equations, self.samples)

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the m equations: those of the rows where no wrench was eliminated."""
        return names_of_equations(self.names, self.samples.equations)


def rows_of(
    lib: Library, motion: FreeBaseMotion, choice: str, drives: Drives | None = None
) -> FreeBaseRows:
    """Equations of a motion, with the columns of the drives."""
    if choice not in CHOSEN:
        raise IdentificationError(f"expected --settings rows={'|'.join(CHOSEN)}, got '{choice}'")
    kept = np.arange(lib.n_rows)[CHOSEN[choice]]
    count, root = len(motion), np.asarray(np.eye(len(kept)))
    right = np.zeros((count, lib.n_rows))
    if motion.tau is not None:
        right[:, FREEDOM:] = motion.tau
    elif choice != "base":
        raise IdentificationError(
            f"--settings rows={choice} needs joint torques, but the log has no array tau; use "
            f"--settings rows=base"
        )
    jacobian = contact_jacobian(lib, motion)  # (N, 6 C, 6 + n)
    wrench = motion.contacts.wrench.reshape(count, -1)
    unknown = np.isnan(wrench)
    right += np.einsum("nck,nc->nk", jacobian, np.where(unknown, 0.0, wrench))
    jacobian, known = jacobian[:, :, kept], right[:, kept]
    parts = [slice(i, i + _BLOCK) for i in range(0, count, _BLOCK)]
    y = np.concatenate(
        [lib.base_regressor(motion.q[p], motion.dq[p], motion.ddq[p])[:, kept] for p in parts]
    )
    errors = np.swapaxes(jacobian[:, VERTICAL::6], 1, 2) @ reading_errors(lib, motion)
    names, has_drives = tuple(lib.row_names[k] for k in kept), drives is not None
    if drives is not None:
        torques = drives.columns(motion)
        torques = np.concatenate([np.zeros((count, FREEDOM, torques.shape[2])), torques], axis=1)
        errors = np.concatenate([errors, torques[:, kept]], axis=2)
        if drives.covariance is not None:
            root = np.asarray(np.linalg.cholesky(drives.covariance[np.ix_(kept, kept)]))
        over = np.linalg.inv(root)  # of some tens of rows, whose σ are within a few decades
        jacobian, known, y, errors = jacobian @ over.T, known @ over.T, over @ y, over @ errors
    offsets = _offsets(jacobian, motion)
    if not unknown.any():
        basis = np.broadcast_to(np.eye(len(kept)), (count, len(kept), len(kept)))
        return FreeBaseRows(_samples(y, known, errors), basis, names, root, offsets, has_drives)
    basis = _null_spaces(jacobian, unknown)
    if not basis.size:
        more = ", or torques and --settings rows=all" if choice == "base" else ""
        raise IdentificationError(
            "the contact wrenches that were not measured leave no equation; give contact_wrench or "
            "contact_force_z, contact_flags of the feet that are lifted, contact_kind = 'point' "
            f"for feet that transmit no moment{more}"
        )
    back = np.swapaxes(basis, 1, 2)
    left = np.einsum("nmk,nk->nm", back, known)
    if not left.any():
        raise IdentificationError(
            "no measured force or torque is left in the equations, so that nothing determines the "
            "scale of the masses; give contact_wrench or contact_force_z, or torques and "
            "--settings rows=all"
        )
    samples = _samples(back @ y, left, back @ errors)
    return FreeBaseRows(samples, basis, names, root, back @ offsets, has_drives)


def _offsets(jacobian: Array, motion: FreeBaseMotion) -> Array:
    """Jᵀ σ of the components that a sensor reads and whose offset has no column, (N, k, o)."""
    contacts = motion.contacts
    count, size = contacts.wrench.shape[:2]
    wrench = contacts.wrench.reshape(count, FREEDOM * size)
    wrenches = [wrench[rows] for _, rows in motion.each()]
    is_read = np.concatenate([~np.isnan(x).any(axis=0) & x.any(axis=0) for x in wrenches])
    if contacts.offset_sigma is not None:
        is_read[VERTICAL::FREEDOM] = False
    sensed = np.ones((count, size)) if contacts.sensed is None else contacts.sensed
    each = np.repeat(sensed, FREEDOM, axis=1) * np.tile(OFFSET_SIGMA, size)
    return of_each_log(np.swapaxes(jacobian * each[:, :, None], 1, 2), motion)[:, :, is_read]


def contact_poses(lib: Library, q: Array, contacts: Contacts) -> list[Array]:
    """Poses of the links in contact, (N, 4, 4) each; q (N, 6 + n)."""
    for link in contacts.links:
        if link not in lib.link_names:
            fixed = {body["name"]: body["onto"] for body in lib.manifest.lumped}
            onto = f"; it is fixed to '{fixed[link]}'" if link in fixed else ""
            raise IdentificationError(
                f"contact_links names '{link}', expected links of '{lib.name}' that move: "
                f"{', '.join(lib.link_names)}{onto}; name that link, with contact_position"
            )
    poses = lib.link_poses(q)
    return [poses[:, lib.link_names.index(link)] for link in contacts.links]


def is_opposite(needed: Array, given: Array) -> bool:
    """Whether given forces or torques have the opposite sign of those that the URDF needs."""
    return bool(np.linalg.norm(needed - given) > OPPOSITE * np.linalg.norm(needed + given))


def contact_jacobian(lib: Library, motion: FreeBaseMotion) -> Array:
    """Jacobians of the contact points in the axes of their wrenches."""
    contacts, count = motion.contacts, len(motion)
    if not contacts.links:
        return np.zeros((count, 0, lib.n_rows))
    parts = []
    poses = contact_poses(lib, motion.q, contacts)
    for link, position, pose in zip(contacts.links, contacts.position, poses, strict=True):
        j, turn = np.array(lib.frame_jacobian(motion.q, link)), pose[:, :3, :3]
        lever = turn @ position
        j[:, :3] += np.cross(j[:, 3:], lever[:, :, None], axisa=1, axisb=1, axisc=1)
        if contacts.axes == "link":
            back = np.swapaxes(turn, 1, 2)
            j = np.concatenate([back @ j[:, :3], back @ j[:, 3:]], axis=1)
        parts.append(j)
    return np.concatenate(parts, axis=1)


def _samples(base: Array, right: Array, errors: Array) -> Samples:
    """Samples of m equations with columns that have one coefficient for all equations."""
    empty, count = np.zeros(right.shape), errors.shape[2]
    coupling = None
    if count:
        coupling = Coupling(np.zeros((1, 1)), (False,) * count, (True,) * count, has_one_row=True)
    right, errors, base = (np.ascontiguousarray(each) for each in (right, errors, base))
    return Samples(empty, empty, None, right, errors, coupling=coupling, base=base)


def _null_spaces(jacobian: Array, unknown: Array) -> Array:
    """Orthonormal N(t) with J_u N = 0, continuous in time; zero columns where fewer are left."""
    count, _, size = jacobian.shape
    spaces = [
        null_space(j[missing], rcond=RANK) if missing.any() else np.eye(size)
        for j, missing in zip(jacobian, unknown, strict=True)
    ]
    out = np.zeros((count, size, max(space.shape[1] for space in spaces)))
    before = None
    for k, space in enumerate(spaces):
        if before is not None and before.shape == space.shape and space.size:
            # The rotation within the space that is nearest to the basis before (Procrustes).
            u, _, v = np.linalg.svd(space.T @ before)
            out[k, :, : space.shape[1]] = before = space @ (u @ v)
        else:
            out[k, :, : space.shape[1]] = before = space
    return out


CLEARANCE = 0.02
"""Height above the lowest foot from which a foot counts as lifted [m]: an attitude that is wrong by
a degree changes it by 1 cm where the feet are 0.6 m apart."""


def lifted_feet(recording: FreeBaseRecording, lib: Library) -> Mask:
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
    if contacts.is_stated or not contacts.links or not np.isnan(contacts.wrench[..., :3]).all():
        return recording, ()
    lifted = lifted_feet(recording, lib)
    wrench = np.where(lifted[:, :, None], 0.0, contacts.wrench)
    sentence = (
        f"contacts follow from the height of the feet: lifted from {100 * CLEARANCE:g} cm above "
        f"the lowest one, {100 * lifted.mean():.0f} % of the log, on flat ground; give "
        "contact_flags elsewhere"
    )
    return replace(recording, contacts=replace(contacts, wrench=wrench)), (sentence,)
