"""π of a moving link → the bodies of the links that are fixed together in it.

Motion tells the sum only. A hand, a flange or a camera keeps the inertia that its maker published,
and the moving link gets the rest, P_own = P_identified − Σ_k T_k P_k T_kᵀ; where that is no body
that can exist, the moving link gets everything and what is fixed to it nothing.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import ExportError
from runtime.identification.metrics import CONSISTENCY_TOLERANCE
from runtime.library import Array, Library
from runtime.outputs.model_files.bodies import Body, body_of, smallest_eigenvalue
from runtime.outputs.model_files.urdf_tree import Tree


@dataclass(frozen=True, slots=True)
class Split:
    """The body of every link that has one, by its name.

    Attributes:
        bodies: moving links, links fixed to them, links fixed to the base.
        emptied: links whose inertia went to the moving link that carries them.
        notes: what was done with fixed bodies, one sentence per moving link that has some.
    """

    bodies: dict[str, Body]
    emptied: tuple[str, ...]
    notes: tuple[str, ...]


def split_bodies(lib: Library, pi: Array, tree: Tree) -> Split:
    """Bodies of all links, so that those fixed together add up to π.

    Raises:
        ExportError: a mass is not positive, so that there is no centre of mass.
    """
    bodies: dict[str, Body] = {}
    fixed: dict[str, dict[str, Body]] = {name: {} for name in lib.link_names}
    for link in tree.links:
        body = tree.published(link)
        carrier, _ = tree.carrier(link)
        if body is None or link == carrier:
            continue
        if carrier is None:
            bodies[link] = body
        else:
            fixed[carrier][link] = body
    emptied: list[str] = []
    notes: list[str] = []
    for link, whole in zip(lib.link_names, lib.pseudo_inertia(pi), strict=True):
        if not whole[3, 3] > 0:
            raise ExportError(
                f"link '{link}' has the mass {whole[3, 3]:g} kg, which has no centre of mass; "
                "export a physically consistent result"
            )
        children = fixed[link]
        rest = _rest(whole, children, tree)
        if rest is None:
            bodies[link] = body_of(whole)
            emptied += children
            notes.append(
                f"{link} carries the inertia of {', '.join(children)} too, which lost their own: "
                "what would be left of it without them is no body that can exist"
            )
        else:
            bodies[link] = body_of(rest)
            bodies |= children
            if children:
                notes.append(
                    f"{', '.join(children)} keep their published inertia; {link} is what was "
                    "identified less these"
                )
    return Split(bodies, tuple(emptied), tuple(notes))


def _rest(whole: Array, children: dict[str, Body], tree: Tree) -> Array | None:
    """P of the moving link alone; None where it, or what is fixed to it, cannot exist."""
    rest = whole.copy()
    for name, body in children.items():
        P = body.pseudo_inertia
        if smallest_eigenvalue(P) < -CONSISTENCY_TOLERANCE or not np.isfinite(P).all():
            return None
        _, T = tree.carrier(name)
        rest -= T @ P @ T.T
    # Of a link without matter of its own the difference of equals remains.
    is_something = rest[3, 3] > 1e-9 * whole[3, 3]
    if children and not (is_something and smallest_eigenvalue(rest) >= -CONSISTENCY_TOLERANCE):
        return None
    return rest
