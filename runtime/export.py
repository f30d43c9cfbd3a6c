"""Identified parameters → URDF: the document the kernels describe, with measured inertials.

A moving link's π = (m, m·c, I about the link origin) becomes mass, centre of mass c = (m·c)/m and
I_com = tr(Σ_com) 1 − Σ_com, where Σ_com = Σ − m c cᵀ and P = [[Σ, m·c], [(m·c)ᵀ, m]] is what the
library returns. A joint's frame is the frame of the link it moves, so nothing is rotated.
Bodies fixed to a moving link are part of its π and therefore lose their own <inertial>.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree.ElementTree import Element, ParseError, SubElement, indent, tostring

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring
from numpy.typing import ArrayLike

from runtime.atomic import replacing
from runtime.errors import ExportError, ShapeError
from runtime.library import Array, Library
from runtime.metrics import CONSISTENCY_TOLERANCE

RELOAD_TOLERANCE = 1e-9
"""Torque difference over the largest torque; 17 digits and two recursions leave about 1e-14."""

RELOAD_STATES = 1000


@dataclass(frozen=True, slots=True)
class _Body:
    """Mass [kg], centre of mass [m] and inertia about it [kg·m²], axes of the link frame."""

    mass: float
    com: Array
    inertia: Array


def identified_urdf(lib: Library, pi: ArrayLike) -> str:
    """The normalised URDF with m, c and I_com of every moving link taken from π.

    Whatever is no inertial of a moving link, or of a body fixed to one, stays as it was.

    Args:
        lib: the robot that π belongs to.
        pi: (10 n,) as `lib.pi0`.

    Returns:
        XML text, 17 significant digits.

    Raises:
        ShapeError: π does not have 10 entries per link.
        ExportError: a mass is not positive, a number not finite, or the URDF is damaged.
    """
    bodies = dict(zip(lib.link_names, _bodies(lib, _flat(lib, pi)), strict=True))
    root = _parse(lib)
    parents = _parents(root)
    for link in root.findall("link"):
        carrier = _carrier(link.get("name", ""), parents, bodies)
        if carrier is None:
            continue
        place = _remove_inertials(link)
        if carrier == link.get("name"):
            link.insert(place, _inertial(bodies[carrier]))
    missing = sorted(set(bodies) - {link.get("name") for link in root.findall("link")})
    if missing:
        raise ExportError(
            f"the URDF of '{lib.name}' lacks the link '{missing[0]}'; run: python -m symgen build"
        )
    indent(root, space="  ")
    head = '<?xml version="1.0" encoding="utf-8"?>\n' + _comment(lib)
    return head + tostring(root, "unicode") + "\n"


def write_urdf(lib: Library, pi: ArrayLike, path: str | os.PathLike[str]) -> str:
    """Write the identified URDF, after proving that it reloads to the same torques.

    The file appears complete or not at all; a file that was there survives every refusal.

    Args:
        lib: the robot that π belongs to.
        pi: (10 n,), every link fully physically consistent.
        path: file to write; its folder is created.

    Returns:
        One sentence that says how the file was verified, or that it was not.

    Raises:
        ShapeError: π does not have 10 entries per link.
        ExportError: an inconsistent link, or a failed reload.
        RuntimeFault: the file cannot be written.
    """
    flat = _flat(lib, pi)
    _require_consistent(lib, flat)
    text = identified_urdf(lib, flat)
    verdict = _reload_check(lib, flat, text)
    with replacing(Path(path)) as file:
        file.write(text.encode())
    return verdict


def _flat(lib: Library, pi: ArrayLike) -> Array:
    array = np.asarray(pi, dtype=float)
    if array.shape != lib.pi0.shape:
        raise ShapeError(f"pi needs the shape {lib.pi0.shape}, got {array.shape}")
    return array


def _require_consistent(lib: Library, pi: Array) -> None:
    _require_finite(lib, pi)
    eigenvalues = lib.relative_eigenvalues(pi)
    bad = np.flatnonzero(~(eigenvalues >= -CONSISTENCY_TOLERANCE))
    if bad.size:
        links = ", ".join(lib.link_names[k] for k in bad)
        raise ExportError(
            f"not written: {links} cannot exist (smallest eigenvalue of the pseudo-inertia "
            f"{eigenvalues[bad].min():.2e} of its trace), and a simulator would refuse or diverge; "
            "export a physically consistent result, or lib.nearest_realisable(pi)"
        )


def _require_finite(lib: Library, pi: Array) -> None:
    bad = np.flatnonzero(~np.isfinite(pi).reshape(lib.n_joints, -1).all(axis=1))
    if bad.size:
        links = ", ".join(lib.link_names[k] for k in bad)
        raise ExportError(f"not written: the parameters of {links} are not finite numbers")


def _bodies(lib: Library, pi: Array) -> Iterator[_Body]:
    _require_finite(lib, pi)
    for name, P in zip(lib.link_names, lib.pseudo_inertia(pi), strict=True):
        mass = float(P[3, 3])
        if not mass > 0:
            raise ExportError(
                f"link '{name}' has the mass {mass:g} kg, which has no centre of mass; "
                "export a physically consistent result"
            )
        com = P[:3, 3] / mass
        sigma = P[:3, :3] - mass * np.outer(com, com)
        yield _Body(mass, com, np.trace(sigma) * np.eye(3) - sigma)


# --- the document ---------------------------------------------------------------------------


def _parse(lib: Library) -> Element:
    try:
        root: Element = fromstring(lib.urdf(), forbid_dtd=True)
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise ExportError(
            f"the URDF of '{lib.name}' is damaged ({error}); run: python -m symgen build"
        ) from None
    return root


def _parents(root: Element) -> dict[str, str]:
    """Child link → parent link."""
    joints = ((j.find("child"), j.find("parent")) for j in root.findall("joint"))
    return {
        c.get("link", ""): p.get("link", "") for c, p in joints if c is not None and p is not None
    }


def _carrier(link: str, parents: dict[str, str], bodies: dict[str, _Body]) -> str | None:
    """The moving link that a link is rigidly part of; None for what is fixed to the base."""
    for _ in range(len(parents) + 1):
        if link in bodies:
            return link
        if link not in parents:
            return None
        link = parents[link]
    return None


def _remove_inertials(link: Element) -> int:
    """Delete a link's <inertial>; returns where it stood."""
    found = link.findall("inertial")
    place = list(link).index(found[0]) if found else 0
    for inertial in found:
        link.remove(inertial)
    return place


def _inertial(body: _Body) -> Element:
    inertial = Element("inertial")
    SubElement(inertial, "origin", {"xyz": " ".join(map(_digits, body.com)), "rpy": "0 0 0"})
    SubElement(inertial, "mass", {"value": _digits(body.mass)})
    axes = {"x": 0, "y": 1, "z": 2}
    entries = ((a + b, body.inertia[axes[a], axes[b]]) for a in axes for b in axes if a <= b)
    SubElement(inertial, "inertia", {f"i{key}": _digits(value) for key, value in entries})
    return inertial


def _digits(value: float) -> str:
    return f"{value + 0.0:.17g}"  # + 0.0 turns −0 into 0


def _comment(lib: Library) -> str:
    return (
        "<!-- Inertial parameters identified by symgen.\n"
        f"     model hash: {lib.manifest.model_hash}\n"
        "     The inertia of a body fixed to a moving link is counted in that link, its carrier;\n"
        "     the fixed body therefore has no <inertial> of its own.\n"
        f"     Gravity in the base frame was {' '.join(map(_digits, lib.gravity))} m/s^2. -->\n"
    )


# --- the reload check -----------------------------------------------------------------------


def _reload_check(lib: Library, pi: Array, text: str) -> str:
    """max |τ_pinocchio(URDF) − Yπ| / max |Yπ| at random states, where pinocchio is installed."""
    pinocchio = _pinocchio()
    if pinocchio is None:
        return "not verified by reloading: pinocchio is not installed (pip install pin)"
    try:
        model = pinocchio.buildModelFromXML(_with_limits(text))
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise ExportError(f"not written: pinocchio cannot reload the URDF ({reason})") from None
    if set(model.names[1:]) != set(lib.joint_names):
        raise ExportError(
            f"not written: the URDF of '{lib.name}' has the joints {', '.join(model.names[1:])}, "
            f"the library {', '.join(lib.joint_names)}; run: python -m symgen build"
        )
    model.gravity.linear = lib.gravity
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-np.pi, np.pi, (3, RELOAD_STATES, lib.n_joints))
    expected = lib.inverse_dynamics(q, dq, ddq, pi)
    difference = np.abs(_torques(pinocchio, model, lib, q, dq, ddq) - expected).max()
    relative = float(difference / np.abs(expected).max())
    if not relative <= RELOAD_TOLERANCE:
        raise ExportError(
            f"not written: reloaded by pinocchio, the URDF gives torques that differ by "
            f"{relative:.1e} of the largest torque, where {RELOAD_TOLERANCE:g} is allowed; "
            "run: python -m symgen build"
        )
    return (
        f"verified: reloaded by pinocchio {pinocchio.__version__}, torques agree to {relative:.1e} "
        f"of the largest torque at {RELOAD_STATES} random states"
    )


def _pinocchio() -> ModuleType | None:
    try:
        import pinocchio
    except ImportError:
        return None
    # The package index has a test runner of the same name, without models.
    return pinocchio if hasattr(pinocchio, "buildModelFromXML") else None


def _with_limits(text: str) -> str:
    """The same URDF with the <limit> that pinocchio's parser insists on where there is none."""
    root = fromstring(text, forbid_dtd=True)
    for joint in root.findall("joint"):
        if joint.get("type") in {"revolute", "prismatic"} and joint.find("limit") is None:
            SubElement(joint, "limit", {"effort": "1", "velocity": "1"})
    return tostring(root, "unicode")


def _torques(pinocchio: Any, model: Any, lib: Library, q: Array, dq: Array, ddq: Array) -> Array:
    """τ of the reloaded model in the library's joint order, (N, n); joints matched by name."""
    data = model.createData()
    joints = [model.joints[model.getJointId(name)] for name in lib.joint_names]
    velocity = [joint.idx_v for joint in joints]
    position, v, a = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    tau = np.empty_like(q)
    for k in range(len(q)):
        for joint, angle in zip(joints, q[k], strict=True):
            # A continuous joint is a point on the circle for pinocchio.
            circle = (np.cos(angle), np.sin(angle)) if joint.nq == 2 else (angle,)
            position[joint.idx_q : joint.idx_q + joint.nq] = circle
        v[velocity], a[velocity] = dq[k], ddq[k]
        tau[k] = pinocchio.rnea(model, data, position, v, a)[velocity]
    return tau
