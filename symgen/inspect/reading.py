"""URDF or MJCF → `Model`, tolerant: what cannot be read becomes a finding, and reading goes on.

MJCF is compiled by MuJoCo, whose model has the inertials that it infers from geoms. Its compiler
rejects inconsistent inertias; then the inertials written in the file are checked.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio

from symgen.chain.document import Document, numbers, parse
from symgen.errors import UrdfError
from symgen.inspect.model import ERROR, Body, Finding, Joint, Link, Model, Shape
from symgen.kernel import Array
from symgen.sources.compiled_mjcf import compile_mjcf, rotation_of

_SIZES = {
    "box": (("size", 3),),
    "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)),
    "sphere": (("radius", 1),),
}
HUGE = 1e9  # largest length, mass or inertia that is read (SI); products of larger ones overflow
SPECK = 1e-9  # smallest mass other than zero that is read, kg; quotients by smaller ones overflow
_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_COMPILES = "expected a file that compiles"


def read_urdf(text: str) -> Model:
    """Read everything in a URDF that can be read."""
    root = parse(text)
    reader = _Reader()
    links = {link.name: link for element in root.findall("link") for link in reader.link(element)}
    if not links:
        raise UrdfError("the URDF defines no link; a robot needs at least one")
    joints = [j for element in root.findall("joint") for j in reader.joint(element)]
    try:
        Document(text)
    except UrdfError as error:
        reader.fault("structure", "the tree", str(error).rstrip("."), "expected one tree of links")
    return Model(root.get("name") or "robot", "URDF", links, tuple(joints), tuple(reader.findings))


class _Reader:
    """Reads element by element and collects faults."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def fault(self, kind: str, where: str, observed: str, expected: str) -> None:
        self.findings.append(Finding(ERROR, kind, where, observed, expected))

    def link(self, element: Element) -> list[Link]:
        name = element.get("name")
        if not name:
            return []  # reported by the check of the structure
        where = f"link '{name}'"
        inertials = element.findall("inertial")
        if len(inertials) > 1:
            self.fault("structure", where, f"{len(inertials)} <inertial>", "expected at most one")
        body = self.body(inertials[0], where) if inertials else None
        shapes = [
            shape
            for tag in ("collision", "visual")
            for node in element.findall(tag)
            for shape in self.shape(node, where, tag == "collision")
        ]
        return [Link(name, body, tuple(shapes))]

    def body(self, inertial: Element, where: str) -> Body | None:
        mass, tensor = inertial.find("mass"), inertial.find("inertia")
        if mass is None or tensor is None:
            lacks = "<mass>" if mass is None else "<inertia>"
            self.fault("incomplete", where, f"an <inertial> without {lacks}", "expected both")
            return None
        m = self.number(mass, "value", where, "mass")
        entries = [self.number(tensor, key, where, f"inertia {key}") for key in _ENTRIES]
        place = self.placement(inertial, where)
        if m is None or place is None or any(x is None for x in entries):
            return None
        if 0 < abs(m) < SPECK:
            text = f"expected 0 or more than {SPECK:g} kg"
            self.fault("mass", where, f"the mass is {m:g} kg", text)
            return None
        xx, xy, xz, yy, yz, zz = entries
        rotation, com = place
        written = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)
        if np.array_equal(rotation, np.eye(3)):
            return Body(m, com, written)
        turned = rotation @ written @ rotation.T
        return Body(m, com, (turned + turned.T) / 2)

    def shape(self, node: Element, where: str, is_collision: bool) -> Iterator[Shape]:
        geometry = node.find("geometry")
        place = self.placement(node, where)
        if geometry is None or place is None:
            return
        for solid in geometry:
            if solid.tag == "mesh":
                scale = self.numbers(solid, "scale", 3, where, "mesh scale", np.ones(3))
                if scale is not None:
                    file = solid.get("filename", "")
                    size = tuple(map(float, scale))
                    yield Shape("mesh", size, *place, file, is_collision)
            elif solid.tag in _SIZES:
                parts = [
                    self.numbers(solid, key, count, where, f"{solid.tag} {key}", None)
                    for key, count in _SIZES[solid.tag]
                ]
                if all(part is not None for part in parts):
                    size = tuple(float(x) for part in parts if part is not None for x in part)
                    yield Shape(solid.tag, size, *place, "", is_collision)

    def joint(self, element: Element) -> list[Joint]:
        name, ends = element.get("name"), [element.find(tag) for tag in ("parent", "child")]
        if not name or any(end is None or not end.get("link") for end in ends):
            return []
        parent, child = (end.get("link", "") for end in ends if end is not None)
        where, kind = f"joint '{name}'", element.get("type", "")
        place = self.placement(element, where) or (np.eye(3), np.zeros(3))
        axis_node = element.find("axis")
        axis = np.array([1.0, 0.0, 0.0])
        if axis_node is not None:
            read = self.numbers(axis_node, "xyz", 3, where, "axis", axis)
            axis = axis if read is None else read
        values: dict[str, Any] = {}
        limits = ("lower", "upper", "velocity", "effort")
        for tag, keys in (("limit", limits), ("dynamics", ("damping", "friction"))):
            node = element.find(tag)
            for key in keys:
                if node is not None and key in node.attrib:
                    values[key] = self.number(node, key, where, f"{tag} {key}")
        return [Joint(name, kind, parent, child, place[1], axis, rotation=place[0], **values)]

    def placement(self, element: Element, where: str) -> tuple[Array, Array] | None:
        node = element.find("origin")
        if node is None:
            return np.eye(3), np.zeros(3)
        rpy = self.numbers(node, "rpy", 3, where, "origin rpy", np.zeros(3))
        xyz = self.numbers(node, "xyz", 3, where, "origin xyz", np.zeros(3))
        if rpy is None or xyz is None:
            return None
        return (pinocchio.rpy.rpyToMatrix(*rpy) if rpy.any() else np.eye(3)), xyz

    def numbers(
        self, node: Element, key: str, count: int, where: str, what: str, default: Array | None
    ) -> Array | None:
        if key not in node.attrib and default is not None:
            return default
        try:
            values = numbers(node.get(key, ""), count, what)
        except UrdfError as error:
            self.fault("unreadable", where, str(error), f"expected the {what} as plain numbers")
            return None
        # Limits may have any size; lengths, masses and inertias are multiplied with each other.
        if what.startswith(("limit", "dynamics")) or np.abs(values).max() < HUGE:
            return values
        observed = f"the {what} is {node.get(key)}"
        self.fault("unreadable", where, observed, f"expected numbers in SI units, below {HUGE:g}")
        return None

    def number(self, node: Element, key: str, where: str, what: str) -> float | None:
        values = self.numbers(node, key, 1, where, what, None)
        return None if values is None else float(values[0])


def read_mjcf(path: Path) -> Model:
    """Read an MJCF file."""
    compiled = compile_mjcf(path)
    import mujoco

    if compiled.model is None:
        finding = Finding(
            ERROR, "structure", "the file", f"MuJoCo rejects it ({compiled.reason})", _COMPILES
        )
        note = "inertias that MuJoCo infers from geoms are unknown: only written ones are read"
        links, unread = _readable({b["name"]: _written(b) for b in compiled.bodies})
        joints = tuple(_joint(_kind(j.pop("kind"), mujoco), **j) for j in compiled.joints)
        return Model(compiled.name, "MJCF", links, joints, (finding, *unread), (note,))
    links, all_joints = _compiled(compiled.model, mujoco)
    links, unread = _readable(links)
    return Model(compiled.name, "MJCF", links, all_joints, unread, compiled.notes)


def _readable(links: dict[str, Link]) -> tuple[dict[str, Link], tuple[Finding, ...]]:
    """Links without the bodies whose numbers are out of range, and findings about these."""
    readable, findings = {}, []
    for name, link in links.items():
        readable[name], body = link, link.body
        if body is None:
            continue
        sizes = np.abs([body.mass, *body.com, *body.inertia.ravel()])
        if not (sizes < HUGE).all() or 0 < abs(body.mass) < SPECK:
            readable[name] = Link(name)
            observed = f"a mass of {body.mass:g} kg, an inertia up to {sizes[4:].max():g} kg·m²"
            wanted = f"expected masses from {SPECK:g} kg up and numbers below {HUGE:g}"
            findings.append(Finding(ERROR, "unreadable", f"link '{name}'", observed, wanted))
    return readable, tuple(findings)


def _compiled(model: Any, mujoco: Any) -> tuple[dict[str, Link], tuple[Joint, ...]]:
    links, joints = {}, []
    names = [model.body(k).name or f"body {k}" for k in range(model.nbody)]
    for k in range(1, model.nbody):
        rotation = rotation_of(model.body_iquat[k])
        tensor = rotation @ np.diag(model.body_inertia[k]) @ rotation.T
        body = Body(float(model.body_mass[k]), model.body_ipos[k].copy(), (tensor + tensor.T) / 2)
        links[names[k]] = Link(names[k], None if body.is_empty else body)
        parent = names[model.body_parentid[k]]
        first, count = model.body_jntadr[k], model.body_jntnum[k]
        place = {"parent": parent, "child": names[k], "offset": model.body_pos[k]}
        if count == 0:
            turned = rotation_of(model.body_quat[k])
            joints.append(_joint("fixed", name=f"{names[k]} (fixed)", rotation=turned, **place))
        for j in range(first, first + count):
            dof = model.jnt_dofadr[j]
            joints.append(
                _joint(
                    _kind(model.jnt_type[j], mujoco),
                    name=model.joint(j).name or f"joint {j}",
                    axis=model.jnt_axis[j],
                    limits=model.jnt_range[j] if model.jnt_limited[j] else None,
                    damping=float(model.dof_damping[dof].min()),
                    friction=float(model.dof_frictionloss[dof]),
                    **place,
                )
            )
    return links, tuple(joints)


def _joint(
    kind: str, offset: Any, axis: Any = (0.0, 0.0, 1.0), limits: Any = None, **rest: Any
) -> Joint:
    """A joint of MJCF, which states no limits of effort; a hinge without limits is continuous."""
    lower, upper = (None, None) if limits is None else map(float, limits)
    place = np.array(offset, dtype=float)
    return Joint(
        kind="continuous" if kind == "revolute" and limits is None else kind,
        offset=np.where(np.isfinite(place), place, 0.0),
        axis=np.array(axis, dtype=float),
        lower=lower,
        upper=upper,
        has_effort=False,
        **rest,
    )


def _kind(code: int, mujoco: Any) -> str:
    kinds = mujoco.mjtJoint
    names = {int(kinds.mjJNT_HINGE): "revolute", int(kinds.mjJNT_SLIDE): "prismatic"}
    return names.get(int(code), "floating")


def _written(body: dict[str, Any]) -> Link:
    if body["mass"] is None:
        return Link(body["name"])
    return Link(body["name"], Body(body["mass"], np.array(body["com"]), np.array(body["inertia"])))
