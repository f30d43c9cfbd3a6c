"""SDF → URDF, couplings and loops.

Of several models, that with moving joints is read, or the one that is named: links, joints,
inertials, limits, damping, friction, mimics.
The frame of a URDF link is that of the joint that moves it, at the pose of the file. A further
joint of a link that has one already, and every <loop_joint>, close a loop. Source: SDFormat 1.4 to
1.11, sdformat.org/spec; poses with `relative_to`, axes with `expressed_in`.
"""

from collections.abc import Collection
from xml.etree.ElementTree import Element, ParseError, SubElement, indent, tostring

import numpy as np
import pinocchio
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from symgen.chain.coupling import CouplingRow
from symgen.chain.document import add_joint, add_origin, listing, numbers
from symgen.chain.mechanism import Loop, Mechanism, Spring
from symgen.chain.normalise import GRAVITY, Note, note_gravity
from symgen.errors import BuildError
from symgen.sources.springs import spring_of_sdf

_MODEL = "__model__"
Places = dict[str, pinocchio.SE3]  # link → pose of its frame in the model


class Frames:
    """Poses of links, joints and frames in the frame of the model, at the pose of the file.

    A link is placed in the model, a joint in its child link, a <frame> in what it is attached to,
    unless <pose relative_to=…> names another one.
    """

    def __init__(self, model: Element, where: str) -> None:
        self._where = where
        self._elements: dict[str, Element] = {}
        self._default: dict[str, str] = {}
        for tag in ("link", "joint", "loop_joint", "frame"):
            for element in model.findall(tag):
                name = element.get("name", "")
                if not name or name in self._elements:
                    raise BuildError(
                        f"{where}: expected a <{tag}> with a name of its own, got '{name}'"
                    )
                self._elements[name] = element
                placed = {"link": _MODEL, "frame": element.get("attached_to") or _MODEL}
                self._default[name] = placed.get(tag, (element.findtext("child") or "").strip())

    def of(self, name: str, pending: tuple[str, ...] = ()) -> pinocchio.SE3:
        """Pose of a frame in the model."""
        if name in {_MODEL, "world"}:
            return pinocchio.SE3.Identity()
        if name not in self._elements:
            raise BuildError(
                f"{self._where} refers to the frame '{name}', which the model does not have; its "
                f"frames are {listing(self._elements)}"
            )
        if name in pending:
            raise BuildError(
                f"{self._where}: the poses of {listing((*pending, name))} refer to each other; "
                "place one of them in the model"
            )
        element = self._elements[name]
        node = element.find("pose")
        base = (None if node is None else node.get("relative_to")) or self._default[name]
        return self.of(base, (*pending, name)) * pose_of(element, name)

    def axis(self, joint: Element) -> np.ndarray:
        """Axis of a joint in the joint's frame."""
        name = joint.get("name", "")
        node = joint.find("axis/xyz")
        text = "0 0 1" if node is None or not node.text else node.text
        direction = numbers(text, 3, f"joint '{name}': axis xyz")
        frame = "" if node is None else node.get("expressed_in", "")
        if (joint.findtext("axis/use_parent_model_frame") or "").strip() in {"1", "true"}:
            frame = _MODEL
        if not frame:
            return direction
        return np.asarray(self.of(name).rotation.T @ self.of(frame).rotation @ direction)


_TREE = {"revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic"}
_LOOPS = {"continuous": "revolute", "ball": "spherical"}  # type in SDF → kind of a loop; else equal
_KINDS = ("revolute", "prismatic", "spherical", "fixed")
_ENDLESS = 1e15  # limit of SDF, rad or m, above which there is none


def robot_from_sdf(
    text: str, chosen: str | None, where: str, has_gravity: bool, note: Note
) -> tuple[str, Mechanism]:
    """URDF of a model of an SDF file."""
    model = _model(text, chosen, where, note)
    gravity = pose_of(model, model.get("name", "")).rotation.T @ GRAVITY
    if not has_gravity:
        note_gravity(gravity, f"{where} places the model so that gravity is", " in its frame", note)
    frames = Frames(model, where)
    joints = [*model.findall("joint"), *model.findall("loop_joint")]
    moved: dict[str, Element] = {}
    closing = []
    for joint in joints:
        child = _end(joint, "child", where)
        if joint.tag == "loop_joint" or child in moved or child == "world":
            closing.append(joint)
        else:
            moved[child] = joint
    robot = Element("robot", {"name": model.get("name") or "robot"})
    places = {name: frames.of(joint.get("name", "")) for name, joint in moved.items()}
    names = [link.get("name", "") for link in model.findall("link")]
    if any(_end(joint, "parent", where) == "world" for joint in joints):
        SubElement(robot, "link", {"name": "world"})
        places["world"] = pinocchio.SE3.Identity()
    for link in model.findall("link"):
        name = link.get("name", "")
        places.setdefault(name, frames.of(name))
        element = SubElement(robot, "link", {"name": name})
        if (inertial := link.find("inertial")) is not None:
            _add_inertial(element, inertial, places[name].inverse() * frames.of(name), name)
    rows: list[CouplingRow] = []
    springs: list[Spring] = []
    for child, joint in moved.items():
        parent = _end(joint, "parent", where)
        _require_link(parent, (*names, "world"), joint, where)
        _require_link(child, names, joint, where)
        _add_joint(robot, joint, parent, child, places, frames)
        rows += _mimic(joint)
        springs += spring_of_sdf(joint)
    loops = tuple(_loop(joint, places, frames, where) for joint in closing)
    indent(robot, space="  ")
    mechanism = Mechanism(coupling=tuple(rows), spring=tuple(springs), loop=loops)
    return tostring(robot, "unicode") + "\n", mechanism


def _model(text: str, chosen: str | None, where: str, note: Note) -> Element:
    """The model that is named, else the only one with moving joints, else the first."""
    try:
        root = fromstring(text, forbid_dtd=True)
    except DefusedXmlException:
        raise BuildError(f"{where} declares a DTD or entities; remove the <!DOCTYPE …>") from None
    except (ParseError, ValueError) as error:
        raise BuildError(f"{where} is not well-formed XML ({error}); correct the file") from None
    models = [*root.findall("model"), *root.findall("world/model")]
    if root.tag != "sdf" or not models:
        raise BuildError(f"{where}: expected an <sdf> with a <model>, got <{root.tag}>")
    moving = [m for m in models if any(j.get("type") != "fixed" for j in m.iter("joint"))]
    if chosen is not None:
        named = [m for m in models if m.get("name") == chosen]
        if not named:
            raise BuildError(
                f"--model names '{chosen}', which {where} does not have; its models are "
                f"{listing(m.get('name', '') for m in models)}"
            )
        model = named[0]
    elif len(moving) > 1:
        raise BuildError(
            f"{where} has {len(moving)} models with moving joints; choose one with --model: "
            f"{listing(m.get('name', '') for m in moving)}"
        )
    else:
        model = (moving or models)[0]
        others = [m.get("name", "") for m in models if m is not model]
        if others:
            note(f"models without moving joints are left out: {listing(others)}")
    for tag in ("model", "include"):
        if model.find(tag) is not None:
            raise BuildError(
                f"{where} contains a nested <{tag}>, which is not read; write its links and joints "
                "into the model"
            )
    return model


def _end(joint: Element, which: str, where: str) -> str:
    name = (joint.findtext(which) or "").strip()
    if not name:
        raise BuildError(
            f"{where}: joint '{joint.get('name', '')}' has no <{which}>; name the link it connects"
        )
    return name


def _require_link(name: str, names: Collection[str], joint: Element, where: str) -> None:
    if name not in names:
        raise BuildError(
            f"{where}: joint '{joint.get('name', '')}' names '{name}', which is not a link of the "
            f"model; its links are {', '.join(names)}"
        )


def _add_inertial(element: Element, inertial: Element, link: pinocchio.SE3, name: str) -> None:
    place = link * pose_of(inertial, name)
    node = SubElement(element, "inertial")
    add_origin(node, place.translation, place.rotation)
    mass = inertial.findtext("mass", "1.0").strip()
    SubElement(node, "mass", {"value": f"{numbers(mass, 1, f'link {name}: mass')[0]:.17g}"})
    entries = {}
    for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        default = "1" if key in {"ixx", "iyy", "izz"} else "0"
        word = inertial.findtext(f"inertia/{key}", default).strip()
        entries[key] = f"{numbers(word, 1, f'link {name}: {key}')[0]:.17g}"
    SubElement(node, "inertia", entries)


def _add_joint(
    robot: Element, joint: Element, parent: str, child: str, places: Places, frames: Frames
) -> None:
    name, kind = joint.get("name", ""), joint.get("type", "")
    if kind != "fixed" and kind not in _TREE:
        raise BuildError(
            f"joint '{name}' is of the type '{kind}'; revolute, continuous, prismatic and fixed "
            "joints can be modelled, others only as <loop_joint>"
        )
    place, ends = places[parent].inverse() * places[child], (parent, child)
    if kind == "fixed":
        add_joint(robot, name, kind, ends, place.translation, place.rotation)
        return

    def stated(tag: str, key: str, default: float) -> float:
        word = joint.findtext(f"axis/{tag}/{key}")
        return default if word is None else numbers(word, 1, f"joint '{name}': {key}")[0]

    limits = {}
    for key in ("lower", "upper", "effort", "velocity"):
        value = stated("limit", key, np.inf)
        if abs(value) < _ENDLESS and not (key in {"effort", "velocity"} and value < 0):
            limits[key] = value
    if kind == "revolute" and not {"lower", "upper"} <= limits.keys():
        kind = "continuous"
    dynamics = {key: stated("dynamics", key, 0.0) for key in ("damping", "friction")}
    pose, axis = (place.translation, place.rotation), frames.axis(joint)
    add_joint(robot, name, kind, ends, *pose, axis, limits or None, dynamics)


def _mimic(joint: Element) -> list[CouplingRow]:
    """Row x = multiplier (x_leader − reference) + offset."""
    node = joint.find("axis/mimic")
    if node is None:
        return []
    name, leader = joint.get("name", ""), node.get("joint", "")
    factor, offset, reference = (
        float(numbers(node.findtext(key, default), 1, f"joint '{name}': {key}")[0])
        for key, default in (("multiplier", "1"), ("offset", "0"), ("reference", "0"))
    )
    return [CouplingRow(name, {leader: factor}, offset - factor * reference)]


def _loop(joint: Element, places: Places, frames: Frames, where: str) -> Loop:
    name = joint.get("name", "")
    kind = _LOOPS.get(joint.get("type", ""), joint.get("type", ""))
    if kind not in _KINDS:
        raise BuildError(
            f"{where}: the joint '{name}' closes a loop and is of the type '{kind}'; revolute, "
            "prismatic, ball and fixed joints can close one"
        )
    if spring_of_sdf(joint):
        raise BuildError(
            f"{where}: the joint '{name}' closes a loop and has a spring, expected springs of the "
            "other joints; set its spring_stiffness to 0, and state [[spring]] along these in a "
            "mechanism file"
        )
    ends = parent, child = (_end(joint, "parent", where), _end(joint, "child", where))
    for end in ends:
        _require_link(end, places, joint, where)
    here = frames.of(name)
    (a, r_a), (c, r_c) = (
        (place.translation.tolist(), pinocchio.rpy.matrixToRpy(place.rotation).tolist())
        for place in (places[end].inverse() * here for end in ends)
    )
    loop = Loop(parent, child, tuple(a), tuple(r_a), tuple(c), tuple(r_c), kind)
    turns_or_slides = kind in {"revolute", "prismatic"}
    return loop.replace(axis=tuple(frames.axis(joint).tolist())) if turns_or_slides else loop


def pose_of(element: Element, name: str) -> pinocchio.SE3:
    """Pose that an element states in its <pose>, x y z and roll pitch yaw."""
    node = element.find("pose")
    if node is None or not (node.text or "").strip():
        return pinocchio.SE3.Identity()
    values = numbers(node.text or "", 6, f"'{name}': pose")
    if node.get("degrees") in {"1", "true"}:
        values[3:] = np.radians(values[3:])
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(values[3:]), values[:3])
