"""Contact wrench at a link from the external joint torque.

    τ_ext = J(q)ᵀ w,   w = (force, moment) at the origin of the link, axes of the base

With fewer than six joints before the link, or in a singular posture, only some components follow
from τ_ext. w is the smallest one that explains it; lengths are scaled by `LENGTH`.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array, Library

LENGTH = 0.1
"""Length that makes moments comparable to forces [m]."""
DETERMINED = 0.02
"""Singular value of the scaled Jacobian, relative to the largest, from which one counts."""


@dataclass(frozen=True, slots=True)
class Wrench:
    """Contact wrench at the origin of a link, in axes of the base.

    Attributes:
        link: name of the link.
        force: (3,) [N].
        moment: (3,) [N·m].
        rank: number of its six components that the external torque determines.
    """

    link: str
    force: tuple[float, ...]
    moment: tuple[float, ...]
    rank: int


def wrench_at(lib: Library, q: Array, external: Array, name: str) -> Wrench:
    """Contact wrench at a link by least squares.

    q (n,) [rad, m], external (n,) [N·m, N].
    """
    if name not in lib.link_names:
        raise IdentificationError(
            f"expected a moving link of '{lib.name}' ({', '.join(lib.link_names)}), got '{name}'; "
            "correct --link"
        )
    scale = np.repeat([1.0, LENGTH], 3)
    jacobian = lib.frame_jacobian(q, name) * scale[:, None]
    left, sizes, right = np.linalg.svd(jacobian.T, full_matrices=False)
    kept = sizes > DETERMINED * sizes[0]
    w = right[kept].T @ ((left[:, kept].T @ external) / sizes[kept]) * scale
    return Wrench(name, tuple(map(float, w[:3])), tuple(map(float, w[3:])), int(kept.sum()))
