"""Mount of a payload: a moving link, and the frame in which its values are given.

The pseudo-inertia of a body is transformed from the frame F to that of its link by
X = [[R, p], [0, 1]]:

    P_link = X P_F Xᵀ,  a linear map of π.   R, p: pose of F in the link's frame
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex import Bodies, bodies_of
from runtime.library import Array, Library
from runtime.library.parameters import link_columns


@dataclass(frozen=True, slots=True)
class Mount:
    """A link and a frame on it.

    Attributes:
        link: name of the moving link that the payload is fixed to.
        index: place of the link among the links.
        frame: name of the frame F of the values, the tip's or the link's.
        rotation: R, (3, 3).
        translation: p, (3,) m.
        to_frame: π in F from π in the link's frame, (10, 10).
        bodies: map from π to P(π) of one body.
    """

    link: str
    index: int
    frame: str
    rotation: Array
    translation: Array
    to_frame: Array
    bodies: Bodies

    @property
    def columns(self) -> slice:
        """Places of the link's ten columns in the regressor."""
        return link_columns(self.index)


def mount_of(lib: Library, link: str | None = None) -> Mount:
    """Mount on a named link, in the tip's frame where the link carries the tip, else in its own.

    Args:
        lib: library of the robot.
        link: name of a moving link, or of the tip; None is the tip.

    Returns:
        The mount.

    Raises:
        IdentificationError: the robot has no such link.
    """
    tip, facts = lib.manifest.tip, lib.manifest.tip_frame
    carrier = facts.link if link in {None, tip} else str(link)
    if carrier not in lib.link_names:
        raise IdentificationError(
            f"'{lib.name}' has no moving link '{carrier}'; choose one of "
            f"{', '.join(lib.link_names)}, or the tip {tip}"
        )
    index = lib.link_names.index(carrier)
    on_tip = carrier == facts.link
    rotation = np.array(facts.rotation) if on_tip else np.eye(3)
    translation = np.array(facts.translation) if on_tip else np.zeros(3)
    bodies = bodies_of(lib)
    to_frame = _congruence(bodies, rotation, translation)
    frame = tip if on_tip else carrier
    return Mount(carrier, index, frame, rotation, translation, to_frame, bodies)


def _congruence(bodies: Bodies, rotation: Array, translation: Array) -> Array:
    """Matrix of π ↦ π' with P(π') = X⁻¹ P(π) X⁻ᵀ, (10, 10), column by column of the basis."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    back = np.linalg.inv(pose)
    moved = back @ bodies.basis @ back.T
    flat = bodies.basis.reshape(len(bodies.basis), 16)
    return np.asarray(np.linalg.lstsq(flat.T, moved.reshape(len(moved), 16).T, rcond=None)[0])
