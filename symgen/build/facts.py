"""The robot's part of the manifest: all that run time needs to know about the robot."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from symgen.build.config import Braking, home_of
from symgen.build.request import BuildRequest
from symgen.chain import Chain, Joint
from symgen.chain.mechanism import Mechanism, table_from_mechanism
from symgen.chain.model import FLOATING, Frame
from symgen.collision.distance import moving
from symgen.collision.tables import tables_from_collision
from symgen.errors import BuildError, InertiaError
from symgen.mechanics import consistency, inertia, passive
from symgen.mechanics.base_parameters import Array, BaseParameters

WORLD = "world"
"""Frame of the pose and of gravity where the base is free."""
PROJECTION_FLOOR = 1e-4
"""Smallest eigenvalue of Σ_com after --project, relative to its trace."""


def initial_parameters(chain: Chain, project: bool) -> tuple[Array, dict[str, float]]:
    """π0 of all links from the URDF."""
    blocks, projected = [], {}
    for joint in chain.joints:
        pi = ca.DM(inertia.pi_from_com(joint.mass, ca.DM(joint.com), ca.DM(joint.inertia)))
        try:
            consistency.require_realisable(pi, joint.link)
        except InertiaError:
            if not project or not joint.mass > 0:
                raise
            repaired = ca.DM(consistency.nearest_realisable(pi, PROJECTION_FLOOR))
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
    if omitted:
        extra["omitted"] = dict(omitted)
    return extra | {
        "base": WORLD if chain.floating else chain.base,
        "tip": chain.tip.link,
        "tip_frame": {
            "link": chain.joints[chain.tip.joint].link,
            "rotation": [list(row) for row in chain.tip.rotation],
            "translation": list(chain.tip.translation),
        },
        "gravity": list(chain.gravity),
        "joints": [_joint_facts(joint) for joint in chain.coordinates],
        "home": list(home_of(chain, config)),
        "acceleration": list(config.acceleration) if config.acceleration else None,
        "jerk": list(config.jerk) if config.jerk else None,
        "torque_rate": list(config.torque_rate) if config.torque_rate else None,
        "tip_speed": config.tip_speed,
        "braking": _lists(config.braking) if config.braking else None,
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
        facts["coupling"] = {
            "independent": list(chain.coupling.independent),
            "matrix": [list(row) for row in chain.coupling.matrix],
            "offset": list(chain.coupling.offset),
        }
    friction = passive.friction_coordinates(chain)
    if friction:
        facts["friction_coordinates"] = {name: list(row) for name, row in friction.items()}
    springs = passive.unknown_springs(chain)
    if springs:
        facts["springs"] = [spring.name for spring in springs]
    if chain.mechanism != Mechanism():
        facts["mechanism"] = table_from_mechanism(chain.mechanism)
    return facts


def _frame_facts(chain: Chain, frame: Frame) -> dict[str, Any]:
    return {
        "link": chain.base if frame.joint < 0 else chain.joints[frame.joint].link,
        "rotation": [list(row) for row in frame.rotation],
        "translation": list(frame.translation),
    }


def _joint_facts(j: Joint) -> dict[str, Any]:
    return {
        "name": j.name,
        "kind": j.kind,
        "link": j.link,
        "unit": {"prismatic": "m", FLOATING: "m|rad"}.get(j.kind, "rad"),
        "lower": j.lower,
        "upper": j.upper,
        "velocity": j.velocity,
        "effort": j.effort,
        "parent": j.parent,
        "rotation": [list(row) for row in j.rotation],
        "translation": list(j.translation),
        "axis": list(j.axis),
    }


def _lists(braking: Braking) -> dict[str, list[float]]:
    return {key: list(values) for key, values in asdict(braking).items()}
