"""The model's own part of the manifest: everything that run time may ask about the robot."""

import hashlib
from dataclasses import asdict
from typing import Any

import casadi as ca
import numpy as np

from symgen import inertia
from symgen.base_parameters import Array, BaseParameters
from symgen.chain import Chain, Joint
from symgen.errors import BuildError, InertiaError
from symgen.request import BuildRequest

PROJECTION_FLOOR = 1e-4
"""Smallest eigenvalue of Σ_com after --project, relative to its trace."""


def initial_parameters(chain: Chain, project: bool) -> tuple[Array, dict[str, float]]:
    """π0 of all links, and for each projected link the largest change of an entry."""
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
) -> dict[str, Any]:
    """JSON-ready facts of one robot.

    Raises:
        BuildError: the robot configuration does not fit the chain.
    """
    n, config = len(chain.joints), request.config
    for key, values in asdict(config).items():
        if values is not None and len(values) != n:
            raise BuildError(
                f"the robot configuration gives {len(values)} values for {key}, "
                f"the chain has {n} joints: {', '.join(j.name for j in chain.joints)}"
            )
    bodies = pi0.reshape(n, -1)
    lam0 = [np.asarray(ca.DM(inertia.lam_from_pi(ca.DM(pi)))).ravel() for pi in bodies]
    home = config.home or tuple(_middle(joint) for joint in chain.joints)
    return {
        "base": chain.base,
        "tip": chain.tip.link,
        "tip_frame": {
            "link": chain.joints[chain.tip.joint].link,
            "rotation": [list(row) for row in chain.tip.rotation],
            "translation": list(chain.tip.translation),
        },
        "gravity": list(chain.gravity),
        "joints": [
            {
                "name": j.name,
                "kind": j.kind,
                "link": j.link,
                "unit": "m" if j.kind == "prismatic" else "rad",
                "lower": j.lower,
                "upper": j.upper,
                "velocity": j.velocity,
                "effort": j.effort,
            }
            for j in chain.joints
        ],
        "home": list(home),
        "acceleration": list(config.acceleration) if config.acceleration else None,
        "jerk": list(config.jerk) if config.jerk else None,
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


def _middle(joint: Joint) -> float:
    """Zero where it lies well inside the limits, else the middle between them."""
    if joint.lower is None or joint.upper is None:
        return 0.0
    margin = 0.1 * (joint.upper - joint.lower)
    inside = joint.lower + margin <= 0.0 <= joint.upper - margin
    return 0.0 if inside else (joint.lower + joint.upper) / 2
