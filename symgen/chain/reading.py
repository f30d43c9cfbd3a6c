"""`Chain` of a normalised URDF, parsed by pinocchio, with exact structural zeros.

The order of joints is pinocchio's. Rounded zeros such as cos(π/2) = 6e-17 are snapped to 0 and ±1
here and nowhere else: every one that remains becomes code in all kernels.

Links without <inertial> get bodies of a stated mass, or placeholders where no link has a mass.
Shape: a solid rod between the link's origin o and the origin p of the farthest joint beyond it,
thick enough not to be a line: c = p/2 and I = m |p|²/12 (1 − u uᵀ) + 2/5 m r² 1 with u = p/|p| and
r = max(|p|/4, 0.05 m). The base parameters of such a body are a guess; those of a placeholder mean
nothing.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio

from symgen.chain.assembly import close_loops
from symgen.chain.coupling import Coupling, mimic_rows, read_coupling
from symgen.chain.document import MOVING, Document, add_inertial, axis_of, numbers, origin
from symgen.chain.mechanism import Mechanism
from symgen.chain.model import (
    FLOATING,
    Chain,
    Joint,
    LumpedBody,
    Tip,
    Vector,
    free_base,
    rows_of,
    snapped,
)
from symgen.chain.normalise import ChainOptions, normalise
from symgen.errors import UrdfError

GIVEN = "given mass"  # origin of a body whose mass was stated
PLACEHOLDER = "placeholder"  # origin of a body whose mass is not stated anywhere
MASSLESS = "no mass"  # origin of the speck that stands for a link without mass
MASSLESS_KG = 1e-9  # mass of a speck, kg: a millionth of a gram, far below rounding of any torque
PLACEHOLDER_MASS = 1.0  # mass of a placeholder, kg
OF_TOOL = 1e-3  # mass of a fixed link, kg, above which it is no frame but a body of a tool
_LEAST_RADIUS = 0.05  # least radius of a body, m: about that of a robot's wrist


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
    bodies = [link for first in moving for link in (first, *document.fixed_to(first))]
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
        and not _has_mass(document, (link, *document.fixed_to(link)))
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


MOST_JOINTS = 100  # largest number of moving joints; the C code grows with its square


def read_chain(text: str, options: ChainOptions | None = None) -> Chain:
    """Read a URDF given as text.

    Args:
        text: the URDF, without DTD and xacro instructions.
        options: base, tip, locked joints, gravity and snapping of angles.

    Returns:
        The chain of all moving joints, with the couplings of <mimic> and of the mechanism.

    Raises:
        UrdfError: the message names the joint or link and what to do.
    """
    options = options or ChainOptions()
    document, gravity, removed = normalise(text, options)
    rows = (*mimic_rows(document), *options.mechanism.coupling)
    followers = {row.joint: tuple(row.of) for row in rows if row.joint in document.joints}
    new = {} if options.masses is None else assume_bodies(document, options.masses, followers)
    for name in document.links:
        _check_inertial(document, name)
    urdf = document.text()
    moving = [name for name in document.joints if document.kind(name) in MOVING]
    if len(moving) > MOST_JOINTS:
        raise UrdfError(
            f"expected at most {MOST_JOINTS} moving joints, got {len(moving)}; select a part of "
            "the robot with --base and --tip, or fix joints with --lock"
        )
    if not moving:
        raise UrdfError(
            "no joint of this URDF moves, so there is nothing to identify; "
            "check --base, --tip and --lock"
        )
    model = parse_with_pinocchio(document)
    _require_no_springs(options)
    base = (free_base(document.root_link, model.inertias[0]),) if options.floating else ()
    joints = tuple(
        _joint(document, model, index, len(base) - 1) for index in range(1, model.njoints)
    )
    coupling = _coupling(document, joints, options.mechanism)
    if coupling is not None:
        for k, ends in _range_of_followers(joints, coupling).items():
            joints = (*joints[:k], replace(joints[k], **ends), *joints[k + 1 :])
    tip = _tip(document, model, (*base, *joints), options.tip)
    lumped = tuple(_lumped(document, options.floating))
    return Chain(
        name=document.name,
        base=document.root_link,
        joints=(*base, *joints),
        gravity=snapped(gravity),
        tip=tip,
        mount=tip if options.tip else _mount(document, model, (*base, *joints), tip, lumped),
        lumped=lumped,
        removed=removed,
        urdf=urdf,
        assumed=options.assumed | new,
        base_is_assumed=(
            options.base is None and not options.floating and not document.has_base_joint()
        ),
        coupling=coupling,
        mechanism=options.mechanism,
        loops=close_loops(model, joints, coupling, options.mechanism),
    )


def _require_no_springs(options: ChainOptions) -> None:
    mechanism = options.mechanism
    others = (mechanism.spring, mechanism.known_torque, mechanism.friction, mechanism.loop)
    if options.floating and any(others):
        raise UrdfError(
            "--floating takes couplings of a mechanism only, got [[spring]], [[known_torque]], "
            "[[friction]] or [[loop]] too; remove these tables, or build without --floating"
        )


def _coupling(
    document: Document, joints: tuple[Joint, ...], mechanism: Mechanism
) -> Coupling | None:
    """Coupling of <mimic> elements and of the mechanism, whose rows come first."""
    stated = {row.joint for row in mechanism.coupling}
    mimics = [row for row in mimic_rows(document) if row.joint not in stated]
    names = tuple(joint.name for joint in joints)
    independent = () if mechanism.loop else mechanism.independent  # of loops: `close_loops`
    return read_coupling(names, (*mechanism.coupling, *mimics), independent)


def _joint(document: Document, model: pinocchio.Model, index: int, shift: int) -> Joint:
    name = model.names[index]
    placement, inertia = model.jointPlacements[index], model.inertias[index]
    link = document.child_link(name)
    if not inertia.mass > 0:
        bare = [n for n, body in zip(model.names, model.inertias, strict=True) if not body.mass > 0]
        every = " ".join(f"--lock {joint}=0" for joint in bare if joint != "universe")
        raise UrdfError(
            f"link '{link}' moves with joint '{name}' but has no mass, nor do links fixed to it; "
            "give it an <inertial> or a mass with the setting masses, lock the joint with --lock "
            f"or cut it off with --tip; to lock every such joint: {every}"
        )
    return Joint(
        name=name,
        kind=document.kind(name),
        parent=model.parents[index] + shift,
        rotation=rows_of(placement.rotation),
        translation=snapped(placement.translation),
        axis=_axis(model, index),
        link=link,
        mass=float(inertia.mass),
        com=snapped(inertia.lever),
        inertia=tuple(tuple(float(x) for x in row) for row in inertia.inertia),
        **_limits_of(document, name),
    )


def _axis(model: pinocchio.Model, index: int) -> Vector:
    short = model.joints[index].shortname()
    aligned = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
    if short in {f"JointModel{kind}{letter}" for kind in "RP" for letter in aligned}:
        return aligned[short[-1]]
    if short in {"JointModelRevoluteUnaligned", "JointModelPrismaticUnaligned"}:
        return snapped(model.joints[index].extract().axis)
    raise UrdfError(
        f"joint '{model.names[index]}' became pinocchio's {short}, which is not supported; "
        "give it one axis of rotation or translation"
    )


def _check_inertial(document: Document, link: str) -> None:
    """Check that the numbers of an <inertial> are finite and its mass is not negative."""
    inertial = document.links[link].find("inertial")
    if inertial is None:
        return
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise UrdfError(f"the <inertial> of link '{link}' needs both <mass> and <inertia>")
    value = numbers(mass.get("value", ""), 1, f"link '{link}': mass")[0]
    if value < 0:
        raise UrdfError(f"link '{link}' has the negative mass {value:g} kg; correct the URDF")
    for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        numbers(inertia.get(key, ""), 1, f"link '{link}': inertia {key}")
    origin(inertial, f"link '{link}': inertial")


def _carrier(document: Document, link: str) -> str | None:
    """The moving link that a link is fixed to, directly or not; None for the base."""
    while link in document.parent_joint:
        joint = document.parent_joint[link]
        if document.kind(joint) in MOVING:
            return link
        link = document.parent_link(joint)
    return None


def _lumped(document: Document, floating: bool) -> Iterator[LumpedBody]:
    for link, element in document.links.items():
        carrier = _carrier(document, link) or (document.root_link if floating else None)
        inertial = element.find("inertial")
        if carrier in {None, link} or inertial is None:
            continue
        mass = inertial.find("mass")
        value = float(mass.get("value", "0")) if mass is not None else 0.0
        yield LumpedBody(name=link, onto=str(carrier), mass=value)


def _tip(
    document: Document, model: pinocchio.Model, joints: tuple[Joint, ...], requested: str | None
) -> Tip:
    """The requested tip link, or the last link fixed beyond the last joint."""
    link = requested
    if link is None:
        link = joints[-1].link
        while children := [j for j in document.children(link) if document.kind(j) == "fixed"]:
            link = document.child_link(children[-1])
    return _frame_of(model, joints, link)


def _mount(
    document: Document,
    model: pinocchio.Model,
    joints: tuple[Joint, ...],
    tip: Tip,
    lumped: tuple[LumpedBody, ...],
) -> Tip:
    """The flange: the tip, or the last link before the gripper or tool that holds the tip."""
    link, masses = tip.link, {body.name: body.mass for body in lumped}
    while masses.get(link, 0.0) > OF_TOOL:
        link = document.parent_link(document.parent_joint[link])
    return _frame_of(model, joints, link)


def _frame_of(model: pinocchio.Model, joints: tuple[Joint, ...], link: str) -> Tip:
    frame = model.frames[model.getFrameId(link, pinocchio.BODY)]
    return Tip(
        link=link,
        joint=int(frame.parentJoint) - (joints[0].kind != FLOATING),
        rotation=rows_of(frame.placement.rotation),
        translation=snapped(frame.placement.translation),
    )


def parse_with_pinocchio(document: Document) -> pinocchio.Model:
    """Pinocchio's model; a continuous joint is passed as a revolute one, so that nq = nv."""
    copy = Document(document.text())
    for link in copy.links.values():  # shapes are not needed, and a faulty one stops the parser
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    for name, element in copy.joints.items():
        for tag in ("dynamics", "safety_controller", "limit", "calibration", "mimic"):
            node = element.find(tag)
            if node is not None:
                element.remove(node)
        if copy.kind(name) in MOVING:
            axis_of(element, f"joint '{name}'")
            element.set("type", "prismatic" if copy.kind(name) == "prismatic" else "revolute")
            element.append(element.makeelement("limit", {"effort": "1", "velocity": "1"}))
    try:
        return pinocchio.buildModelFromXML(copy.text())
    except (ValueError, RuntimeError) as error:
        raise UrdfError(f"pinocchio cannot read the URDF: {' '.join(str(error).split())}") from None


def _limits_of(document: Document, name: str) -> dict[str, Any]:
    """Lower, upper, velocity and effort limit of a joint; None where not given."""
    node = document.joints[name].find("limit")
    stated = {} if node is None else node.attrib
    values: dict[str, Any] = {
        key: float(numbers(stated[key], 1, f"joint '{name}': limit {key}")[0])
        if key in stated
        else None
        for key in ("lower", "upper", "velocity", "effort")
    }
    lower, upper = values["lower"], values["upper"]
    if document.kind(name) == "continuous":
        lower = upper = None
    if lower is not None and upper is not None and lower > upper:
        raise UrdfError(
            f"joint '{name}' has lower limit {lower:g} above upper limit {upper:g}; correct <limit>"
        )
    for key in ("velocity", "effort"):
        value = values[key]
        if value is not None and value < 0:
            raise UrdfError(f"joint '{name}' has the negative {key} limit {value:g}; correct it")
        values[key] = value or None  # 0 is how exporters write "not given"
    if lower == upper == 0 and not (values["velocity"] or values["effort"]):
        lower = upper = None
    return values | {"lower": lower, "upper": upper}


def _range_of_followers(joints: tuple[Joint, ...], coupling: Coupling) -> dict[int, dict[str, Any]]:
    """Limits of independent joints after those of the joints that follow them.

    A joint with one master x = c q + b limits q to (lower − b)/c … (upper − b)/c and its speed to
    velocity/|c|. A joint with several masters limits no single one, and a range that is empty is
    not used: the joint keeps its limits.
    """
    changed: dict[int, tuple[float, float, float]] = {}
    for k, joint in enumerate(joints):
        masters = coupling.masters(k)
        if k in coupling.independent or len(masters) != 1:
            continue
        factor, offset = coupling.matrix[k][masters[0]], coupling.offset[k]
        least, most = sorted((end - offset) / factor for end in joint.ends())
        place = coupling.independent[masters[0]]
        master = joints[place]
        lower, upper, speed = changed.get(place, (*master.ends(), master.velocity or math.inf))
        lower, upper = max(least, lower), min(most, upper)
        if lower < upper:
            fastest = (joint.velocity or math.inf) / abs(factor)
            changed[place] = lower, upper, min(fastest, speed)
    keys = ("lower", "upper", "velocity")
    return {
        place: {k: x if math.isfinite(x) else None for k, x in zip(keys, values, strict=True)}
        for place, values in changed.items()
    }
