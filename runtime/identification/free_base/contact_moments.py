"""Moments at contacts of which only the vertical forces are measured.

    m_c = R_cᵀ s_c (m − Σ_k (p_k − p) × s_k f),   s_c = F_c / ΣF

f and m are force and moment on the base about its origin p, predicted by the URDF from the motion.
Forces, and the moment that remains, are shared by the contacts like the vertical forces. Where one
contact carries the robot this is exact; the sum over contacts of equal axes always is.
"""

import numpy as np

from runtime.library import Array, Library
from runtime.library.free_base import FREEDOM
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion

_FORCE = slice(0, 3)
_MOMENT = slice(3, FREEDOM)


def contact_moments(lib: Library, motion: FreeBaseMotion, shares: Array) -> Array:
    """Moments about the contact points that the motion needs, in axes of the links.

    shares (N, C) → (N, C, 3) [N·m].
    """
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
