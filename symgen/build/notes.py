"""Sentences for the user of a build: what was lumped, cut off, assumed, coupled or rounded."""

from symgen.chain import Chain, Joint
from symgen.chain.assumed_bodies import (
    GIVEN,
    MASSLESS,
    MASSLESS_KG,
    PLACEHOLDER,
    PLACEHOLDER_MASS,
)
from symgen.mechanics.passive import friction_coordinates

ROUNDED = 1e-4
"""Error of a right angle, rad, that a URDF with four decimals makes; the notes report it."""


def notes_of(chain: Chain, projected: dict[str, float]) -> tuple[str, ...]:
    """Sentences on what a build has assumed or changed."""
    notes = [
        f"link '{body.name}' ({body.mass:g} kg) is fixed to '{body.onto}' and is part of its body"
        for body in chain.lumped
    ]
    if chain.base_is_assumed and chain.base != "world":
        notes.append(
            f"no joint of the URDF attaches '{chain.base}' to the world; it is taken as fixed"
        )
    if chain.floating:
        notes.append(
            f"the base '{chain.base}' is free: rows of torque are force and moment on it, in its "
            f"axes, then those of the {len(chain.coordinates)} joints"
        )
    notes += _coupled(chain)
    notes += _closed(chain)
    notes += _assumed(chain)
    if chain.removed:
        notes.append(f"cut off by --base/--tip: {', '.join(chain.removed)}")
    notes += [
        f"the inertia of '{link}' is not physically consistent and was projected "
        f"(largest change {change:.2g})"
        for link, change in projected.items()
    ]
    rounded = [j.name for j in chain.joints if _is_almost_square(j)]
    if rounded:
        notes.append(
            f"the angles of {', '.join(rounded)} differ from right angles by less than {ROUNDED:g} "
            f"rad; if the URDF rounds them, --snap {ROUNDED:g} makes them exact, which saves "
            "operations and spurious base parameters"
        )
    return tuple(notes)


def _coupled(chain: Chain) -> list[str]:
    """Sentences about couplings and their friction."""
    if chain.coupling is None or chain.loops is not None:
        return []
    free = [joint.name for joint in chain.coordinates]
    names = [joint.name for joint in chain.single_joints if joint.name not in free]
    notes = [f"joints that follow others: {', '.join(names)}; q holds {', '.join(free)}"]
    friction = list(friction_coordinates(chain))
    if len(friction) > len(free):
        notes.append(
            f"friction columns of coupled coordinates exist for {', '.join(friction[: len(free)])} "
            f"only, as many as there are joints, not for {', '.join(friction[len(free) :])}"
        )
    return notes


def _closed(chain: Chain) -> list[str]:
    """Sentences about loops."""
    if chain.loops is None:
        return []
    free = [joint.name for joint in chain.coordinates]
    names = [joint.name for joint in chain.joints if joint.name not in free]
    kinds = "; ".join(f"{c.name} is closed as {c.kind}" for c in chain.loops.closures)
    ranges = ", ".join(
        f"{j.name} {j.lower:.3g} … {j.upper:.3g}"
        for j in chain.coordinates
        if j.lower is not None and j.upper is not None
    )
    endless = ", ".join(chain.coordinates[turn.place].name for turn in chain.loops.turns)
    return [
        f"{kinds}; q holds {', '.join(free)}, and {', '.join(names)} follow",
        *([f"ranges away from singular postures: {ranges}"] if ranges else []),
        *([f"{endless} turns without end"] if endless else []),
    ]


def _assumed(chain: Chain) -> list[str]:
    """Sentences about bodies that the URDF does not state."""
    given = [link for link, source in chain.assumed.items() if source == GIVEN]
    placeholders = [link for link, source in chain.assumed.items() if source == PLACEHOLDER]
    notes = []
    if given:
        notes.append(
            f"mass of {', '.join(given)} as stated by --masses; centre of mass and inertia are "
            "those of a solid rod between the joints"
        )
    specks = [link for link, source in chain.assumed.items() if source == MASSLESS]
    if specks:
        notes.append(
            f"{', '.join(specks)} have no mass; each counts as {MASSLESS_KG:g} kg, so that "
            "forward dynamics are meaningless for a joint that moves such links alone"
        )
    if placeholders:
        notes.append(
            "no moving link has an <inertial>, so each is a placeholder of "
            f"{PLACEHOLDER_MASS:g} kg: identification uses pc-ols, which needs no inertial prior; "
            "for map, state masses by --masses FILE (TOML, link = kg), densities of closed meshes "
            "by --densities FILE, or a prior file"
        )
    return notes


def _is_almost_square(joint: Joint) -> bool:
    """True if an entry of the joint's rotation is almost, but not exactly, 0."""
    return any(0.0 < abs(entry) < ROUNDED for row in joint.rotation for entry in row)
