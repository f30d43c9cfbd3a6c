"""π of a moving link → the bodies of the links that are fixed to each other in it.

Motion identifies their sum only. A hand, a flange or a camera keeps its published inertia, and the
moving link gets the rest, P_link = P_identified − Σ_k T_k P_k T_kᵀ. Where the rest is not
physically consistent, the moving link gets the whole sum and the links fixed to it get none. It
also gets the inertia of links without mass.
"""

from typing import NamedTuple

import numpy as np

from runtime.errors import ExportError
from runtime.identification.metrics import CONSISTENCY_TOLERANCE
from runtime.library import Array, Library
from runtime.outputs.model_files.bodies import RigidBody, body_of, smallest_eigenvalue
from runtime.outputs.model_files.urdf_tree import Tree


class LinkBodies(NamedTuple):
    """Rigid bodies of the links.

    Attributes:
        by_link: body of every link that has one: moving links, links fixed to them, links fixed
            to the base.
        emptied: links whose inertia went to the moving link that carries them.
        notes: how fixed bodies were treated, one sentence per moving link that carries some.
    """

    by_link: dict[str, RigidBody]
    emptied: tuple[str, ...]
    notes: tuple[str, ...]


def divide_bodies(lib: Library, pi: Array, tree: Tree) -> LinkBodies:
    """Divide π into bodies of links, so that those of links fixed to each other add up to π.

    pi (10 n,) [kg, kg·m, kg·m²].
    """
    bodies: dict[str, RigidBody] = {}
    fixed: dict[str, dict[str, RigidBody]] = {name: {} for name in lib.link_names}
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
                f"not written: expected a positive mass of the link '{link}', got "
                f"{whole[3, 3]:g} kg; export a physically consistent result"
            )
        # No engine reads an inertia without a mass.
        massless = [
            name for name, each in fixed[link].items() if not each.mass and each.inertia.any()
        ]
        children = {name: each for name, each in fixed[link].items() if name not in massless}
        rest = _rest(whole, children, tree)
        if massless:
            emptied += massless
            notes.append(
                f"The inertial of {link} includes {', '.join(massless)}, whose inertials without "
                "mass were removed."
            )
        if rest is None:
            bodies[link] = body_of(whole)
            emptied += children
            notes.append(
                f"The inertial of {link} includes {', '.join(children)}, whose inertials were "
                f"removed: {link} without them would not be physically consistent."
            )
        else:
            bodies[link] = body_of(rest)
            bodies |= children
            if children:
                notes.append(
                    f"Published inertials are kept for {', '.join(children)}; the inertial of "
                    f"{link} is the identified one less these."
                )
    return LinkBodies(bodies, tuple(emptied), tuple(notes))


def _rest(whole: Array, children: dict[str, RigidBody], tree: Tree) -> Array | None:
    """P (4, 4) of the moving link alone; None where it or a fixed body is not consistent."""
    rest = whole.copy()
    for name, body in children.items():
        P = body.pseudo_inertia
        if smallest_eigenvalue(P) < -CONSISTENCY_TOLERANCE or not np.isfinite(P).all():
            return None
        _, T = tree.carrier(name)
        rest -= T @ P @ T.T
    # For a moving link without mass, the difference of equal numbers is rounding noise.
    has_mass = rest[3, 3] > 1e-9 * whole[3, 3]
    if children and not (has_mass and smallest_eigenvalue(rest) >= -CONSISTENCY_TOLERANCE):
        return None
    return rest
