"""USD of a robot: UsdPhysics bodies and joints, joint friction and armature for PhysX and MuJoCo.

Mass, centre of mass, diagonal inertia and principal axes of UsdPhysics are single precision, a
relative 6e-8; the attributes `symgen:…` beside them hold the same in double precision. PhysX reads
PhysxJointAxisAPI, whose viscous coefficient of an angular axis is per degree; MuJoCo reads
MjcJointAPI in SI units. A joint x = f x_m + o has PhysxMimicJointAPI with the gearing −f and the
offset −o, which states x + gearing x_m + offset = 0. Loop joints have
physics:excludeFromArticulation.
"""

import re

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array
from runtime.library.manifest import FrameFacts
from runtime.outputs.model_files.engines import usd
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.model import IdentifiedModel, couplings, require_loop_frames
from runtime.outputs.model_files.reload_check import reloaded_fault, unchecked
from runtime.outputs.model_files.urdf_tree import Edge, RigidBody, digits, quaternion, quoted


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


MOVING = {"revolute": "Revolute", "continuous": "Revolute", "prismatic": "Prismatic"}
"""Kind of a joint of a URDF → word in the name of the prim."""
LOOPS = {  # kind of a loop joint → type of its prim
    "fixed": "PhysicsFixedJoint",
    "revolute": "PhysicsRevoluteJoint",
    "prismatic": "PhysicsPrismaticJoint",
    "cylindrical": "PhysicsJoint",
    "spherical": "PhysicsSphericalJoint",
}
_LOCKED = ("transX", "transY", "rotX", "rotY")


def joint_prim(
    model: IdentifiedModel, edge: Edge, names: dict[str, str], ends: tuple[str, str], q: float
) -> list[str]:
    """A joint of the tree."""
    kind = MOVING.get(edge.kind, "Fixed")
    align = np.eye(4)
    if kind != "Fixed":
        align[:3, :3] = onto(edge.axis)
    frames = _ends(ends, edge.placement @ align, align)
    inside = [f"custom string symgen:name = {quoted(edge.name)}", *frames]
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
    return indented(_prim(f"Physics{kind}Joint", names[edge.name], schemas, inside), 8)


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
        lines += indented(_prim(LOOPS[joint.kind], names[name], schemas, inside), 8)
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
    return [*opened, "{", *indented(inside, 4), "}"]


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
    for quantity, (mjc, names) in usd.TERMS.items():
        value = getattr(model.friction, quantity)[model.lib.joint_names.index(edge.name)]
        if value is not None:
            single = value * per_unit if quantity == "damping" else value
            lines += [f"float {name.format(axis=axis)} = {digits(single)}" for name in names]
            lines.append(f"uniform double {mjc} = {digits(value)}")
    return ['"PhysxJointAPI"', f'"PhysxJointAxisAPI:{axis}"', '"MjcJointAPI"'], lines


def onto(axis: Array) -> Array:
    """Rotation that turns the x-axis onto a unit vector (3,)."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    second = np.cross(axis, other)
    second /= np.linalg.norm(second)
    return np.column_stack([axis, second, np.cross(axis, second)])


INERTIA_TOLERANCE = 1e-9  # of inertial parameters read again, over the robot's largest one
PLACE_TOLERANCE = 1e-6  # placements of joints [m, 1]: twice rounded to single precision


def usd_text(model: IdentifiedModel) -> str:
    """Text of a USD stage (.usda) at q = 0, or at `lib.home` where loops must be closed."""
    require_mechanism(model)
    lib, tree = model.lib, model.tree
    everything = [*tree.links, *(edge.name for edge in tree.edges.values()), *lib.manifest.loops]
    names = prim_names(everything)
    root = prim_names([lib.name])[lib.name]
    strength = float(np.linalg.norm(lib.gravity))
    down = lib.gravity / (strength or 1.0)
    lines = [
        "#usda 1.0",
        "(",
        *(f"    # {line}" for line in model.robot_comment()),
        f'    defaultPrim = "{root}"',
        "    kilogramsPerUnit = 1",
        "    metersPerUnit = 1",
        '    upAxis = "Z"',
        ")",
        "",
        'def PhysicsScene "physicsScene"',
        "{",
        f"    vector3f physics:gravityDirection = {tuple_of(down)}",
        f"    float physics:gravityMagnitude = {digits(strength)}",
        "}",
        "",
        f'def Xform "{root}" (',
        '    prepend apiSchemas = ["PhysicsArticulationRootAPI"]',
        ")",
        "{",
    ]
    paths = _paths(model, f"/{root}", names)
    places, at = {tree.base: np.eye(4)}, dict[str, float]()
    if lib.all_joint_names != lib.joint_names:  # the bodies stand at home
        home = lib.all_positions(lib.home).tolist()
        at = dict(zip(lib.all_joint_names, home, strict=True))
    for link in tree.subtree(tree.base):
        edge = tree.edges.get(link)
        if edge is not None:
            places[link] = (
                places[edge.parent] @ edge.placement @ moved(edge, at.get(edge.name, 0.0))
            )
        if paths[link].count("/") == 2:
            lines += indented(_link(model, link, names, places[link], paths), 4)
    lines += ['    def Scope "joints"', "    {"]
    if _is_body(model, tree.base):
        fixed = [f"rel physics:body1 = <{paths[tree.base]}>"]
        lines += indented(_prim("PhysicsFixedJoint", "root_joint", [], fixed), 8)
    for edge in tree.edges.values():
        if paths[edge.child].count("/") == 2:
            ends = (paths[edge.parent], paths[edge.child])
            lines += joint_prim(model, edge, names, ends, at.get(edge.name, 0.0))
    lines += loop_prims(model, names, paths)
    return "\n".join([*lines, "    }", "}", ""])


def check_usd(model: IdentifiedModel, text: str) -> str:
    """Reload a USD by usd-core: bodies in double precision, placements, joint friction."""
    read = usd.reload(text, model)
    if read is None:
        return unchecked(usd.INSTALL)
    expected = model.lib.pseudo_inertia(model.pi)
    difference = np.abs(read.bodies - expected).max(axis=(1, 2)) / np.abs(expected).max()
    if not difference.max() <= INERTIA_TOLERANCE:
        link = model.lib.link_names[int(difference.argmax())]
        raise reloaded_fault(
            read.engine,
            f"the inertia of the link '{link}' differs by {difference.max():.1e} of the largest "
            f"one, where {INERTIA_TOLERANCE:g} is allowed",
        )
    for edge in model.tree.edges.values():
        if edge.kind not in MOVING and not _is_body(model, edge.child):
            continue  # a frame without a joint
        axis = edge.axis if edge.kind in MOVING else None
        if not read.place_error(edge.name, edge.placement, axis) <= PLACE_TOLERANCE:
            raise reloaded_fault(read.engine, f"the joint '{edge.name}' is placed differently")
    _require_mechanism_read(model, read)
    for quantity in usd.TERMS:
        values = getattr(model.friction, quantity)
        for name, value in zip(model.lib.joint_names, values, strict=True):
            if value is not None and not read.holds(name, quantity, value):
                what = f"the {quantity} of joint '{name}' is not {value:g}"
                raise reloaded_fault(read.engine, what)
    return (
        f"verified: reloaded by {read.engine}, inertias agree to {difference.max():.1e} of the "
        "largest one"
    )


def _require_mechanism_read(model: IdentifiedModel, read: usd.ReloadedStage) -> None:
    """Raise ExportError where a loop joint or a joint that follows another was read differently."""
    manifest = model.lib.manifest
    for name, joint in zip(manifest.loops, manifest.loop_joints, strict=True):
        frames = (frame_matrix(joint.parent), frame_matrix(joint.child))
        if not read.loop_error(name, frames) <= PLACE_TOLERANCE:
            raise reloaded_fault(read.engine, f"{name} differs")
    for name, (masters, offset) in couplings(manifest).items():
        ((master, factor),) = masters.items()
        if not read.follows(name, master, factor, offset):
            what = f"the joint '{name}' does not follow '{master}' as in the robot"
            raise reloaded_fault(read.engine, what)


def _is_body(model: IdentifiedModel, link: str) -> bool:
    """Whether a link has mass or moves; others are frames on the link before them."""
    body, edge = model.bodies.by_link.get(link), model.tree.edges.get(link)
    return (body is not None and body.mass > 0) or (edge is not None and edge.kind in MOVING)


def _paths(model: IdentifiedModel, root: str, names: dict[str, str]) -> dict[str, str]:
    """Link → path of its prim: bodies below the root, frames on bodies.

    PhysX gives a body without mass the mass 1 kg, so that a flange without mass is no body.
    """
    tree = model.tree
    paths: dict[str, str] = {}
    for link in tree.subtree(tree.base):
        edge = tree.edges.get(link)
        is_frame = edge is not None and not _is_body(model, link)
        above = paths[edge.parent] if edge is not None and is_frame else root
        paths[link] = f"{above}/{names[link]}"
    return paths


def _link(
    model: IdentifiedModel, link: str, names: dict[str, str], place: Array, paths: dict[str, str]
) -> list[str]:
    """A link with the frames on it."""
    body = model.bodies.by_link.get(link)
    inside = [f"custom string symgen:name = {quoted(link)}"]
    schemas = ['"PhysicsRigidBodyAPI"'] if _is_body(model, link) else []
    if body is not None and body.mass > 0:
        schemas.append('"PhysicsMassAPI"')
        inside += _mass(body)
    # USD multiplies rows from the left, so that it holds the transposed matrix.
    rows = ", ".join(tuple_of(row) for row in place.T)
    inside += [
        f"matrix4d xformOp:transform = ( {rows} )",
        'uniform token[] xformOpOrder = ["xformOp:transform"]',
    ]
    for edge in model.tree.children(link):
        if paths[edge.child].startswith(f"{paths[link]}/"):
            inside += _link(model, edge.child, names, edge.placement, paths)
    return _prim("Xform", names[link], schemas, inside)


def _mass(body: RigidBody) -> list[str]:
    """Attributes of UsdPhysics, and the same in double precision."""
    diagonal, axes = np.linalg.eigh(body.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    turn = np.eye(4)
    turn[:3, :3] = axes
    values = {
        ("float", "double", "mass"): digits(body.mass),
        ("point3f", "double3", "centerOfMass"): tuple_of(body.com),
        ("float3", "double3", "diagonalInertia"): tuple_of(diagonal),
        ("quatf", "quatd", "principalAxes"): tuple_of(quaternion(turn)),
    }
    single = [f"{kind} physics:{name} = {value}" for (kind, _, name), value in values.items()]
    double = [f"custom {kind} symgen:{name} = {value}" for (_, kind, name), value in values.items()]
    return single + double


USD = ExportFormat(
    "usd",
    "USD with UsdPhysics bodies and joints, friction and armature for PhysX and MuJoCo",
    "{robot}.usda",
    usd_text,
    check_usd,
)
