"""Joints of a USD stage: UsdPhysics joints of the tree, mimic joints of PhysX, loop joints.

A joint x = f x_m + o has PhysxMimicJointAPI with the gearing −f and the offset −o, which states
x + gearing x_m + offset = 0. Loop joints have physics:excludeFromArticulation.
"""

import re

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array
from runtime.library.manifest import FrameFacts
from runtime.outputs.model_files.model import IdentifiedModel, couplings, require_loop_frames
from runtime.outputs.model_files.urdf_tree import Edge, digits, quaternion


def prim_names(names: list[str]) -> dict[str, str]:
    """Name → identifier of USD; two names that become alike get numbers."""
    chosen: dict[str, str] = {}
    for name in names:
        word = re.sub(r"\W", "_", name, flags=re.ASCII) or "_"
        word = f"_{word}" if word[0].isdigit() else word
        used, count = set(chosen.values()), 1
        base = word
        while word in used and name not in chosen:
            count += 1
            word = f"{base}_{count}"
        chosen.setdefault(name, word)
    return chosen


def indented(lines: list[str], columns: int) -> list[str]:
    """Lines that begin some columns further right."""
    return [f"{' ' * columns}{line}" for line in lines]


def tuple_of(values: Array) -> str:
    """Tuple of numbers."""
    return f"({', '.join(map(digits, values))})"


def quoted(name: str) -> str:
    """Quoted text of USD."""
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


MOVING = {"revolute": "Revolute", "continuous": "Revolute", "prismatic": "Prismatic"}
"""Kind of a joint of a URDF → word in the name of the prim."""
LOOPS = {
    "fixed": "PhysicsFixedJoint",
    "revolute": "PhysicsRevoluteJoint",
    "prismatic": "PhysicsPrismaticJoint",
    "cylindrical": "PhysicsJoint",
    "spherical": "PhysicsSphericalJoint",
}
"""Kind of a loop joint → type of its prim."""
_LOCKED = ("transX", "transY", "rotX", "rotY")


def anchor(base: str) -> list[str]:
    """Fixed joint of the base to the world."""
    return [
        '        def PhysicsFixedJoint "root_joint"',
        "        {",
        f"            rel physics:body1 = <{base}>",
        "        }",
    ]


def joint_prim(
    model: IdentifiedModel, edge: Edge, names: dict[str, str], ends: tuple[str, str], q: float
) -> list[str]:
    """A joint of the tree."""
    kind = MOVING.get(edge.kind, "Fixed")
    align = np.eye(4)
    if kind != "Fixed":
        align[:3, :3] = onto(edge.axis)
    inside = [
        f"custom string symgen:name = {quoted(edge.name)}",
        *_ends(ends, edge.placement @ align, align),
    ]
    schemas: list[str] = []
    if kind != "Fixed":
        schemas, more = _moving(model, edge, kind)
        inside += more
        following, more = _mimic(model, edge, names, ends)
        schemas += following
        inside += more
        if q:
            axis = "angular" if kind == "Revolute" else "linear"
            schemas.append(f'"PhysicsJointStateAPI:{axis}"')
            inside.append(f"float state:{axis}:physics:position = {digits(_shown(kind, q))}")
    return _prim(f"Physics{kind}Joint", names[edge.name], schemas, inside)


def loop_prims(model: IdentifiedModel, names: dict[str, str], paths: dict[str, str]) -> list[str]:
    """Joints that close the loops."""
    lines = []
    manifest = model.lib.manifest
    for name, joint in zip(manifest.loops, manifest.loop_joints, strict=True):
        ends = (paths[joint.parent.link], paths[joint.child.link])
        inside = [
            f"custom string symgen:name = {quoted(name)}",
            *_ends(ends, frame_matrix(joint.parent), frame_matrix(joint.child)),
            "bool physics:excludeFromArticulation = 1",
        ]
        schemas = []
        if joint.kind == "cylindrical":
            # A lower limit above the upper one locks an axis.
            schemas = [f'"PhysicsLimitAPI:{axis}"' for axis in _LOCKED]
            for axis in _LOCKED:
                inside += [
                    f"float limit:{axis}:physics:low = 1",
                    f"float limit:{axis}:physics:high = -1",
                ]
        elif joint.kind != "fixed":
            inside.append('uniform token physics:axis = "Z"')
        lines += _prim(LOOPS[joint.kind], names[name], schemas, inside)
    return lines


def moved(edge: Edge, q: float) -> Array:
    """T (4, 4) of a joint at a position."""
    T = np.eye(4)
    if edge.kind == "prismatic":
        T[:3, 3] = q * edge.axis
    elif q:
        x, y, z = edge.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        T[:3, :3] += np.sin(q) * cross + (1 - np.cos(q)) * cross @ cross
    return T


def frame_matrix(frame: FrameFacts) -> Array:
    """T (4, 4) from the frame of a loop joint to its link."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = frame.rotation, frame.translation
    return T


def require_mechanism(model: IdentifiedModel) -> None:
    """Raise ExportError where joints of USD cannot state a coupling."""
    require_loop_frames(model)
    manifest = model.lib.manifest
    kinds = {joint.name: joint.kind == "prismatic" for joint in manifest.all_joints}
    for name, (masters, _) in couplings(manifest).items():
        if len(masters) != 1 or kinds[name] != kinds[next(iter(masters))]:
            raise ExportError(
                f"not written: the joint '{name}' of '{model.lib.name}' follows "
                f"{', '.join(masters) or 'no joint'}, and joints of USD follow one joint of their "
                "own kind; export mjcf, which states this"
            )


def _mimic(
    model: IdentifiedModel, edge: Edge, names: dict[str, str], ends: tuple[str, str]
) -> tuple[list[str], list[str]]:
    """API schema and attributes of a joint that follows another."""
    following = couplings(model.lib.manifest).get(edge.name)
    if following is None:
        return [], []
    masters, offset = following
    ((master, factor),) = masters.items()
    root = ends[1].split("/")[1]
    kind = MOVING[edge.kind]
    return ['"PhysxMimicJointAPI:rotX"'], [
        f"float physxMimicJoint:rotX:gearing = {digits(-factor)}",
        f"float physxMimicJoint:rotX:offset = {digits(_shown(kind, -offset))}",
        f"rel physxMimicJoint:rotX:referenceJoint = </{root}/joints/{names[master]}>",
        'uniform token physxMimicJoint:rotX:referenceJointAxis = "rotX"',
    ]


def _shown(kind: str, value: float) -> float:
    """A position in the unit of USD: degrees or metres."""
    return value * 180 / np.pi if kind == "Revolute" else value


def _ends(ends: tuple[str, str], first: Array, second: Array) -> list[str]:
    """Bodies of a joint and its frames (4, 4) in them."""
    return [
        f"rel physics:body0 = <{ends[0]}>",
        f"rel physics:body1 = <{ends[1]}>",
        f"point3f physics:localPos0 = {tuple_of(first[:3, 3])}",
        f"quatf physics:localRot0 = {tuple_of(quaternion(first))}",
        f"point3f physics:localPos1 = {tuple_of(second[:3, 3])}",
        f"quatf physics:localRot1 = {tuple_of(quaternion(second))}",
    ]


def _prim(kind: str, name: str, schemas: list[str], inside: list[str]) -> list[str]:
    opened = [f'def {kind} "{name}"']
    if schemas:
        opened = [f"{opened[0]} (", f"    prepend apiSchemas = [{', '.join(schemas)}]", ")"]
    return indented([*opened, "{", *indented(inside, 4), "}"], 8)


def _moving(model: IdentifiedModel, edge: Edge, kind: str) -> tuple[list[str], list[str]]:
    """API schemas and attributes of a joint that moves."""
    axis = "angular" if kind == "Revolute" else "linear"
    per_unit = np.pi / 180 if kind == "Revolute" else 1.0  # N·m·s/rad → N·m·s/deg
    lines = ['uniform token physics:axis = "X"']
    if edge.lower is not None and edge.upper is not None and edge.lower < edge.upper:
        scale = 180 / np.pi if kind == "Revolute" else 1.0
        lines += [
            f"float physics:lowerLimit = {digits(scale * edge.lower)}",
            f"float physics:upperLimit = {digits(scale * edge.upper)}",
        ]
    if edge.name not in model.lib.joint_names:  # friction is that of the joints that it follows
        return [], lines
    index, friction = model.lib.joint_names.index(edge.name), model.friction
    armature, damping = friction.armature[index], friction.damping[index]
    dry = friction.friction[index]
    physx = f"physxJointAxis:{axis}"
    if armature is not None:
        lines += [
            f"float physxJoint:armature = {digits(armature)}",
            f"float {physx}:armature = {digits(armature)}",
            f"uniform double mjc:armature = {digits(armature)}",
        ]
    if dry is not None:
        lines += [
            f"float {physx}:staticFrictionEffort = {digits(dry)}",
            f"float {physx}:dynamicFrictionEffort = {digits(dry)}",
            f"uniform double mjc:frictionloss = {digits(dry)}",
        ]
    if damping is not None:
        lines += [
            f"float {physx}:viscousFrictionCoefficient = {digits(damping * per_unit)}",
            f"uniform double mjc:damping = {digits(damping)}",
        ]
    return ['"PhysxJointAPI"', f'"PhysxJointAxisAPI:{axis}"', '"MjcJointAPI"'], lines


def onto(axis: Array) -> Array:
    """Rotation that turns the x-axis onto a unit vector (3,)."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    second = np.cross(axis, other)
    second /= np.linalg.norm(second)
    return np.column_stack([axis, second, np.cross(axis, second)])
