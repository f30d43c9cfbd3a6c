"""Facts of a robot for its manifest, and notes of a build for the user."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np
from msgspec import to_builtins

from symgen.chain import Chain, Joint
from symgen.chain.mechanism import Mechanism, table_from_mechanism
from symgen.chain.model import FLOATING, Frame, Tip
from symgen.chain.reading import GIVEN, MASSLESS, MASSLESS_KG, PLACEHOLDER, PLACEHOLDER_MASS
from symgen.collision.distance import moving
from symgen.collision.model import tables_from_collision
from symgen.errors import BuildError, InertiaError
from symgen.kernel import Array
from symgen.make.config import home_of
from symgen.make.request import BuildRequest
from symgen.mechanics import inertia, passive
from symgen.mechanics.base_parameters import BaseParameters
from symgen.mechanics.passive import friction_coordinates

ROUNDED = 1e-4  # error of a right angle, rad, of a URDF with four decimals; the notes report it

_LIMITS = ("acceleration", "jerk", "torque_rate")
WORLD = "world"  # frame of the pose and of gravity where the base is free
PROJECTION_FLOOR = 1e-4  # smallest eigenvalue of Σ_com over its trace after --settings project=true


def initial_parameters(chain: Chain, project: bool) -> tuple[Array, dict[str, float]]:
    """π0 of all links from the URDF."""
    blocks, projected = [], {}
    for joint in chain.joints:
        pi = ca.DM(inertia.pi_from_com(joint.mass, ca.DM(joint.com), ca.DM(joint.inertia)))
        try:
            inertia.require_realisable(pi, joint.link)
        except InertiaError:
            if not project or not joint.mass > 0:
                raise
            repaired = ca.DM(inertia.nearest_realisable(pi, PROJECTION_FLOOR))
            projected[joint.link] = float(ca.mmax(ca.fabs(repaired - pi)))
            pi = repaired
        blocks.append(np.asarray(pi).ravel())
    return np.concatenate(blocks), projected


def model_facts(
    chain: Chain,
    request: BuildRequest,
    base: BaseParameters,
    pi0: Array,
    projected: dict[str, float],
    omitted: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """JSON-ready facts of one robot."""
    n, config = len(chain.coordinates), request.config
    for key, values in config.vectors().items():
        if len(values) != n:
            raise BuildError(
                f"the robot configuration gives {len(values)} values for {key}, "
                f"the chain has {n} joints: {', '.join(j.name for j in chain.coordinates)}"
            )
    bodies = pi0.reshape(len(chain.joints), -1)
    lam0 = [np.asarray(ca.DM(inertia.lam_from_pi(ca.DM(pi)))).ravel() for pi in bodies]
    extra = ({"assumed": chain.assumed} if chain.assumed else {}) | _mechanism_facts(chain)
    if chain.floating:
        extra |= {"floating": True, "all_joints": [_joint_facts(joint) for joint in chain.joints]}
    if chain.mount != chain.tip:
        extra |= {"mount": chain.mount.link, "mount_frame": _frame_facts(chain, chain.mount)}
    if omitted:
        extra["omitted"] = dict(omitted)
    return extra | {
        "base": WORLD if chain.floating else chain.base,
        "tip": chain.tip.link,
        "tip_frame": _frame_facts(chain, chain.tip),
        "gravity": list(chain.gravity),
        "joints": [_joint_facts(joint) for joint in chain.coordinates],
        "home": list(home_of(chain, config)),
        **{key: to_builtins(getattr(config, key)) or None for key in _LIMITS},
        "tip_speed": config.tip_speed,
        "braking": to_builtins(config.braking),
        **tables_from_collision(config.collision),
        "moving_proxies": [proxy.name for proxy in moving(chain, config.collision)],
        "lumped": [asdict(body) for body in chain.lumped],
        "removed": list(chain.removed),
        "pi_names": list(inertia.PI_NAMES),
        "pi_units": list(inertia.PI_UNITS),
        "lam_names": list(inertia.LAM_NAMES),
        "lam_units": list(inertia.LAM_UNITS),
        "pi0": pi0.tolist(),
        "lam0": np.concatenate(lam0).tolist(),
        "projected": projected,
        "base_parameters": {
            "columns": list(base.columns),
            "matrix": base.matrix.tolist(),
            # Singular values at rounding level differ between machines; their magnitude does not.
            "smallest_kept": float(f"{base.smallest_kept:.2g}"),
            "largest_dropped_below": 10.0 ** int(np.ceil(np.log10(base.largest_dropped)) + 1),
        },
        "options": {"tip": request.options.tip, "project": request.project},
        "urdf_sha256": hashlib.sha256(chain.urdf.encode()).hexdigest(),
    }


def _mechanism_facts(chain: Chain) -> dict[str, Any]:
    """Coupling, all joints and the mechanism; nothing for a robot without them."""
    facts: dict[str, Any] = {}
    if chain.coupling is not None or chain.loops is not None:
        facts["all_joints"] = [_joint_facts(joint) for joint in chain.joints]
    if chain.loops is not None:
        facts["loops"] = [closure.name for closure in chain.loops.closures]
        facts["loop_joints"] = [
            {
                "kind": closure.kind,
                "parent": _frame_facts(chain, closure.parent),
                "child": _frame_facts(chain, closure.child),
            }
            for closure in chain.loops.closures
        ]
    elif chain.coupling is not None:
        facts["coupling"] = to_builtins(chain.coupling)
    friction = friction_coordinates(chain)
    if friction:
        facts["friction_coordinates"] = {name: list(row) for name, row in friction.items()}
    springs = passive.unknown_springs(chain)
    if springs:
        facts["springs"] = [spring.name for spring in springs]
    if chain.mechanism != Mechanism():
        facts["mechanism"] = table_from_mechanism(chain.mechanism)
    return facts


def _frame_facts(chain: Chain, frame: Frame | Tip) -> dict[str, Any]:
    return {
        "link": chain.base if frame.joint < 0 else chain.joints[frame.joint].link,
        "rotation": [list(row) for row in frame.rotation],
        "translation": list(frame.translation),
    }


def _joint_facts(j: Joint) -> dict[str, Any]:
    unit = {"prismatic": "m", FLOATING: "m|rad"}.get(j.kind, "rad")
    keys = ("lower", "upper", "velocity", "effort", "parent", "rotation", "translation", "axis")
    facts = {key: to_builtins(getattr(j, key)) for key in keys}
    return {"name": j.name, "kind": j.kind, "link": j.link, "unit": unit} | facts


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
    rounded = [
        joint.name
        for joint in chain.joints  # an entry of whose rotation is almost, but not exactly, 0
        if any(0.0 < abs(entry) < ROUNDED for row in joint.rotation for entry in row)
    ]
    if rounded:
        notes.append(
            f"the angles of {', '.join(rounded)} differ from right angles by less than {ROUNDED:g} "
            f"rad; if the URDF rounds them, --settings snap={ROUNDED:g} makes them exact, which "
            "saves operations and spurious base parameters"
        )
    return tuple(notes)


def _coupled(chain: Chain) -> Iterator[str]:
    """Sentences about couplings and their friction."""
    if chain.coupling is None or chain.loops is not None:
        return
    free = [joint.name for joint in chain.coordinates]
    names = [joint.name for joint in chain.single_joints if joint.name not in free]
    yield f"joints that follow others: {', '.join(names)}; q holds {', '.join(free)}"
    friction = list(friction_coordinates(chain))
    if len(friction) > len(free):
        yield (
            f"friction columns of coupled coordinates exist for {', '.join(friction[: len(free)])} "
            f"only, as many as there are joints, not for {', '.join(friction[len(free) :])}"
        )


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


def _assumed(chain: Chain) -> Iterator[str]:
    """Sentences about bodies that the URDF does not state."""
    given = [link for link, source in chain.assumed.items() if source == GIVEN]
    placeholders = [link for link, source in chain.assumed.items() if source == PLACEHOLDER]
    if given:
        yield (
            f"mass of {', '.join(given)} as stated by the setting masses; centre of mass and "
            "inertia are those of a solid rod between the joints"
        )
    specks = [link for link, source in chain.assumed.items() if source == MASSLESS]
    if specks:
        yield (
            f"{', '.join(specks)} have no mass; each counts as {MASSLESS_KG:g} kg, so that "
            "forward dynamics are meaningless for a joint that moves such links alone"
        )
    if placeholders:
        yield (
            f"no moving link has an <inertial>, so each is a placeholder of {PLACEHOLDER_MASS:g} "
            "kg: identification uses pc-ols, which needs no inertial prior; for map, state masses "
            "by --settings masses=FILE (TOML, link = kg), densities of closed meshes by --settings "
            "densities=FILE, or a prior file"
        )
