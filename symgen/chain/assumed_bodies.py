"""Bodies of links without <inertial>: of a stated mass, or placeholders where no link has a mass.

Shape: a solid rod between the link's origin o and the origin p of the farthest joint beyond it,
thick enough not to be a line: c = p/2 and I = m |p|²/12 (1 − u uᵀ) + 2/5 m r² 1 with u = p/|p| and
r = max(|p|/4, 0.05 m). The base parameters of such a body are a guess; those of a placeholder mean
nothing.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping

import numpy as np

from symgen.chain.document import MOVING, Document, add_inertial, numbers, origin
from symgen.errors import UrdfError

GIVEN = "given mass"
"""Origin of a body whose mass was stated."""
PLACEHOLDER = "placeholder"
"""Origin of a body whose mass is not stated anywhere."""
MASSLESS = "no mass"
"""Origin of the speck that stands for a link without mass."""
MASSLESS_KG = 1e-9
"""Mass of a speck, kg: a millionth of a gram, far below the rounding of any torque."""
PLACEHOLDER_MASS = 1.0
"""Mass of a placeholder, kg."""
_LEAST_RADIUS = 0.05
"""Least radius of a body, m: about that of a robot's wrist."""


def require_bare(document: Document, link: str, option: str) -> None:
    """Refuse a link that an option gives a body but that is unknown or has one."""
    document.require_link(link, option)
    if document.links[link].find("inertial") is not None:
        raise UrdfError(
            f"{option} names the link '{link}', which has an <inertial> in the URDF; leave it "
            "out, or remove the <inertial>"
        )


def assume_bodies(
    document: Document,
    masses: Mapping[str, float],
    followers: Mapping[str, Collection[str]] | None = None,
) -> dict[str, str]:
    """Write <inertial> elements for links that have none.

    Where no moving link has one and no mass is stated, every moving link becomes a placeholder. A
    single link without mass among others becomes a speck where its joint takes part in a coupling,
    as hands of published robots do, or where a link beyond it has mass, as in joints of two axes.
    Else it stays as it is, and `read_chain` refuses it.
    """
    for link, mass in masses.items():
        require_bare(document, link, "the setting masses")
        if not (math.isfinite(mass) and mass > 0):
            raise UrdfError(
                f"the setting masses: expected a mass above 0 kg for '{link}', got {mass:g}"
            )
    moving_joints = [j for j in document.joints if document.kind(j) in MOVING]
    moving = [document.child_link(j) for j in moving_joints]
    origins = dict.fromkeys(masses, GIVEN)
    bodies = [link for first in moving for link in (first, *_fixed_to(document, first))]
    if not masses and all(document.links[link].find("inertial") is None for link in bodies):
        origins = dict.fromkeys(moving, PLACEHOLDER)
    for link in origins:
        _write_body(document, link, masses.get(link, PLACEHOLDER_MASS))
    coupled = dict(followers or {})
    taking_part = {*coupled, *(master for masters in coupled.values() for master in masters)}
    specks = [
        link
        for joint, link in zip(moving_joints, moving, strict=True)
        if link not in origins
        and not _has_mass(document, (link, *_fixed_to(document, link)))
        and (joint in taking_part or _has_mass(document, document.subtree(link)))
    ]
    for link in specks:
        for node in document.links[link].findall("inertial"):
            document.links[link].remove(node)
        _write_body(document, link, MASSLESS_KG)
    return origins | dict.fromkeys(specks, MASSLESS)


def _has_mass(document: Document, links: Iterable[str]) -> bool:
    """Whether one of these links states a mass above 0."""
    for body in links:
        node = document.links[body].find("inertial/mass")
        if node is not None and numbers(node.get("value", ""), 1, f"link '{body}': mass")[0] > 0:
            return True
    return False


def _fixed_to(document: Document, link: str) -> Iterator[str]:
    """Links that are fixed to a link, directly or not."""
    for joint in document.children(link):
        if document.kind(joint) == "fixed":
            child = document.child_link(joint)
            yield child
            yield from _fixed_to(document, child)


def _write_body(document: Document, link: str, mass: float) -> None:
    beyond = [
        origin(document.joints[joint], f"joint '{joint}'")[1] for joint in document.children(link)
    ]
    p = max(beyond, key=lambda point: float(np.linalg.norm(point)), default=np.zeros(3))
    length = float(np.linalg.norm(p))
    u = p / length if length else np.zeros(3)
    radius = max(length / 4, _LEAST_RADIUS)
    rod = length**2 / 12 * (np.eye(3) - np.outer(u, u))
    inertia = mass * (rod + 0.4 * radius**2 * np.eye(3))
    add_inertial(document.links[link], mass, p / 2, inertia)
