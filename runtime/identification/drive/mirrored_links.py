"""Mirrored links as linear priors: the right link is the mirror image of the left one.

    m_r = m_l,   (m c)_r = Q (m c)_l,   I_r = Q I_l Qᵀ,   Q = R_rᵀ M R_l

M mirrors the base about a plane through its origin, R_l and R_r turn the axes of the links into
those of the base at q = 0. The plane is that about which the positions of the links are mirrored.
"""

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex.constraints import Row
from runtime.identification.drive.symmetry import mirrored_joints
from runtime.library import Array, Library
from runtime.library.parameters import (
    FIRST_MOMENT,
    INERTIA,
    MASS,
    N_PARAMETERS,
    inertia_entries,
    inertia_matrix,
)

PLANES = {"yz": (-1.0, 1.0, 1.0), "xz": (1.0, -1.0, 1.0), "xy": (1.0, 1.0, -1.0)}
"""Planes of the base, and the diagonal of M."""
_TURN, _TOLERANCE = 0.3, 1e-3
"""Angle of the joints at which poses are compared [rad, m], and tolerance [m, 1]: a millimetre is
below the rounding of a URDF."""


def mirrored_links(lib: Library, pairs: tuple[str, ...]) -> tuple[Row, ...]:
    """Equations that tie the links of mirrored joints."""
    places = mirrored_joints(lib.joint_names, pairs)
    if lib.n_links != lib.n_joints:
        raise IdentificationError(
            f"--tie needs one link per joint, but '{lib.name}' has {lib.n_links} links and "
            f"{lib.n_joints} joints; leave it out, or use com_box and mass of --prior"
        )
    poses = np.asarray(lib.link_poses(np.zeros((1, lib.n_joints))))[0]
    mirror = _plane(poses, places)
    rows: list[Row] = []
    for left, right in places:
        if not _turns_alike(lib, mirror, left, right):
            raise _not_mirrored(lib.joint_names[left], lib.joint_names[right])
        turn = poses[right, :3, :3].T @ mirror @ poses[left, :3, :3]
        image = mirror_image(turn)
        for k in range(N_PARAMETERS):
            row = np.zeros(lib.pi0.size)
            row[right * N_PARAMETERS + k] = 1.0
            row[left * N_PARAMETERS : (left + 1) * N_PARAMETERS] -= image[k]
            rows.append(Row(f"{lib.joint_names[left]}:{lib.joint_names[right]}", row, 0.0))
    return tuple(rows)


def mirror_image(turn: Array) -> Array:
    """Map of the ten parameters of a body under x → Q x.

    turn (3, 3) → (10, 10).
    """
    image = np.zeros((N_PARAMETERS, N_PARAMETERS))
    image[MASS, MASS] = 1.0
    image[FIRST_MOMENT, FIRST_MOMENT] = turn
    image[INERTIA, INERTIA] = inertia_entries(turn @ inertia_matrix(np.eye(6)) @ turn.T).T
    return image


def _plane(poses: Array, places: tuple[tuple[int, int], ...]) -> Array:
    """M of the plane about which the positions of the links are mirrored best."""
    left, right = np.array(places).T
    origin = poses[:, :3, 3]

    def distance(signs: tuple[float, ...]) -> float:
        return float(np.linalg.norm(origin[right] - origin[left] * np.array(signs)))

    return np.diag(min(PLANES.values(), key=distance))


def _turns_alike(lib: Library, mirror: Array, left: int, right: int) -> bool:
    """Whether the right joint moves its link as the mirrored left one, in one of the directions."""
    q = np.zeros((3, lib.n_joints))
    q[0, right], q[1, left], q[2, left] = _TURN, _TURN, -_TURN
    poses = np.asarray(lib.link_poses(q))
    still = np.asarray(lib.link_poses(np.zeros((1, lib.n_joints))))[0]
    image = still[right, :3, :3].T @ mirror @ still[left, :3, :3]
    for k in (1, 2):
        turned = mirror @ poses[k, left, :3, :3] @ image.T
        place = mirror @ poses[k, left, :3, 3]
        far = max(
            np.abs(turned - poses[0, right, :3, :3]).max(),
            np.abs(place - poses[0, right, :3, 3]).max(),
        )
        if far < _TOLERANCE:
            return True
    return False


def _not_mirrored(left: str, right: str) -> IdentificationError:
    return IdentificationError(
        f"--tie expects {left} and {right} to be mirrored about a plane of the base, got joints or "
        "links that are not; leave --tie out, which compares them only"
    )
