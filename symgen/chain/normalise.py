"""Lock, cut and snap a URDF; the result is again a URDF.

The kernels are derived from the result, the manifest holds its hash, and run time fills it with
identified numbers.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pinocchio

from symgen.chain.coupling import mimic_rows
from symgen.chain.document import MOVING, Document, add_origin, axis_of, listing, numbers, origin
from symgen.chain.mechanism import Mechanism
from symgen.errors import UrdfError

Note = Callable[[str], None]  # takes a sentence for the user
GRAVITY = (0.0, 0.0, -9.81)  # gravity of a build by default, in the frame of the root link [m/s²]
_FAR = 0.05  # difference of gravity, m/s², that is noted: more than that of any two places
_HALF_PI = math.pi / 2


def note_gravity(gravity: np.ndarray, start: str, end: str, note: Note) -> None:
    """Note gravity of a file other than that of a build."""
    if math.dist(gravity, GRAVITY) > _FAR:
        stated = ",".join(f"{round(x, 4) + 0.0:g}" for x in gravity.tolist())
        note(f"{start} {stated} m/s²{end}, and the build takes 0,0,-9.81 unless --gravity is given")


@dataclass(frozen=True, slots=True)
class ChainOptions:
    """Changes to a URDF that the user requests."""

    base: str | None = None  # link that becomes the fixed base; None keeps the root
    tip: str | None = None  # link that ends the chain; links beyond it are cut off, not lumped
    # m/s² in the frame of the base link; None takes (0, 0, −9.81) in the root frame
    gravity: tuple[float, float, float] | None = None
    # joint name → value (rad, m) at which the joint becomes part of its parent
    locks: dict[str, float] = field(default_factory=dict)
    snap: float = 0.0  # rad; rpy angles within this of a multiple of π/2 become the multiple
    removed: tuple[str, ...] = ()  # links that an earlier cut took from this URDF, for the report
    # link → kg, for links without <inertial>; empty: placeholders where no moving link has one
    # (`assumed_bodies`); None: a moving link without mass is refused
    masses: dict[str, float] | None = None
    # link → origin of a body that an earlier build has assumed, to be reported again
    assumed: dict[str, str] = field(default_factory=dict)
    mechanism: Mechanism = field(default_factory=Mechanism)  # that of a mechanism file
    floating: bool = False  # True frees the base; gravity is then given in the world's frame


def normalise(text: str, options: ChainOptions) -> tuple[Document, np.ndarray, tuple[str, ...]]:
    """The locked, cut and snapped URDF, gravity (3,) [m/s²], and the links removed."""
    document = Document(text)
    for joint, value in _with_followers(document, options.locks).items():
        _lock(document, joint, value)
    gravity = _gravity(document, options)
    removed = _cut(document, options)
    _require_supported(document)
    if options.snap:
        _snap(document, options.snap)
    return document, gravity, removed


def moving_joints(text: str, options: ChainOptions) -> tuple[str, ...]:
    """Names of the joints that move after locking and cutting.

    Args:
        text: the URDF.
        options: requested changes.

    Returns:
        Names, in the order of the URDF.
    """
    document, _, _ = normalise(text, options)
    return tuple(name for name in document.joints if document.kind(name) in MOVING)


def _with_followers(document: Document, locks: dict[str, float]) -> dict[str, float]:
    """The locks with those of all joints that mimic a locked one, directly or not."""
    values, rows = dict(locks), [r for r in mimic_rows(document) if r.joint not in locks]
    while ready := [r for r in rows if all(m in values for m in r.of) and r.joint not in values]:
        for row in ready:
            values[row.joint] = sum(f * values[m] for m, f in row.of.items()) + row.offset
    return values


def _require_supported(document: Document) -> None:
    for name, element in document.joints.items():
        kind = document.kind(name)
        remedy = f"lock it as the file shows it with --lock {name}=0 or cut it off with --tip LINK"
        child = document.child_link(name)
        beyond = (j for link in document.subtree(child) for j in document.children(link))
        at_root = document.parent_link(name) == document.root_link
        if kind == "floating" and at_root and any(document.kind(j) in MOVING for j in beyond):
            remedy = f"give --floating --base {child} for a free base, or --lock {name}=0"
        if kind not in {*MOVING, "fixed"}:
            raise UrdfError(
                f"joint '{name}' has the type '{kind}'; revolute, continuous, prismatic and fixed "
                f"joints can be modelled, so {remedy}"
            )
        origin(element, f"joint '{name}'")


def _lock(document: Document, joint: str, value: float) -> None:
    if joint not in document.joints:
        raise UrdfError(
            f"--lock names the joint '{joint}', which the URDF does not define; its joints are "
            f"{listing(document.joints)}"
        )
    kind = document.kind(joint)
    if kind == "fixed":
        raise UrdfError(
            f"--lock names the joint '{joint}', which is {kind} and does not move; "
            "name a joint that moves"
        )
    if kind not in MOVING and value:
        raise UrdfError(
            f"--lock {joint}={value:g}: a joint of the type '{kind}' has no single position; "
            f"--lock {joint}=0 locks it as the file shows it"
        )
    if not math.isfinite(value):
        raise UrdfError(f"--lock {joint}={value}: expected a finite value in rad or m")
    element = document.joints[joint]
    if kind not in MOVING:
        element.set("type", "fixed")
        return
    axis = axis_of(element, f"joint '{joint}'")
    axis = axis / np.linalg.norm(axis)
    rotation, translation = origin(element, f"joint '{joint}'")
    if kind == "prismatic":
        translation = translation + rotation @ axis * value
    else:
        rotation = rotation @ pinocchio.AngleAxis(value, axis).toRotationMatrix()
    for tag in ("axis", "limit", "dynamics", "mimic", "safety_controller", "origin"):
        node = element.find(tag)
        if node is not None:
            element.remove(node)
    element.set("type", "fixed")
    add_origin(element, translation, rotation)


def _gravity(document: Document, options: ChainOptions) -> np.ndarray:
    if options.gravity is not None:
        gravity = np.array(options.gravity, dtype=float)
        if gravity.shape != (3,) or not np.isfinite(gravity).all():
            raise UrdfError(f"--gravity needs three finite numbers, got {options.gravity}")
        return gravity
    base = options.base or document.root_link
    document.require_link(base, "--base")
    if options.floating:
        return np.array(GRAVITY)
    rotation = np.eye(3)
    for joint in document.path(base):
        if document.kind(joint) != "fixed":
            raise UrdfError(
                f"joint '{joint}' moves between the root link and --base {base}, so the direction "
                "of gravity in the base frame is unknown; give it with --gravity X,Y,Z"
            )
        rotation = rotation @ origin(document.joints[joint], f"joint '{joint}'")[0]
    return rotation.T @ np.array(GRAVITY)


def _cut(document: Document, options: ChainOptions) -> tuple[str, ...]:
    base = options.base or document.root_link
    document.require_link(base, "--base")
    keep = set(document.subtree(base))
    if options.tip is not None:
        tip = options.tip
        document.require_link(tip, "--tip")
        if tip not in keep:
            raise UrdfError(
                f"--tip {tip} is not reached from --base {base}; choose a link beyond the base"
            )
        on_path = {base, *(document.child_link(j) for j in document.path(tip))} & keep
        # With brackets and cameras off the path.
        keep = on_path.union(*(document.fixed_to(link, on_path) for link in on_path - {tip}))
    removed = set(document.links) - keep
    document.remove(removed)
    document.root_link = base
    return tuple(sorted(removed.union(options.removed)))


def _snap(document: Document, tolerance: float) -> None:
    if not 0 < tolerance < 0.1:
        raise UrdfError(f"the setting snap needs an angle between 0 and 0.1 rad, got {tolerance:g}")
    for name, element in document.joints.items():
        node = element.find("origin")
        if node is None or "rpy" not in node.attrib:
            continue
        rpy = numbers(node.get("rpy", ""), 3, f"joint '{name}': origin rpy")
        meant = np.round(rpy / _HALF_PI) * _HALF_PI
        snapped = np.where(np.abs(rpy - meant) <= tolerance, meant, rpy)
        node.set("rpy", " ".join(f"{x:.17g}" for x in snapped))
