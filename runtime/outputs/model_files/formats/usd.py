"""USD of a robot: UsdPhysics bodies and joints, joint friction and armature for PhysX and MuJoCo.

Mass, centre of mass, diagonal inertia and principal axes of UsdPhysics are single precision, a
relative 6e-8; the attributes `symgen:…` beside them hold the same in double precision. PhysX reads
PhysxJointAxisAPI, whose viscous coefficient of an angular axis is per degree; MuJoCo reads
MjcJointAPI in SI units.
"""

import re

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array
from runtime.outputs.model_files.bodies import RigidBody, digits, quaternion
from runtime.outputs.model_files.engines import usd
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.model import IdentifiedModel, require_no_coupling
from runtime.outputs.model_files.reload_check import unchecked
from runtime.outputs.model_files.urdf_tree import Edge

INERTIA_TOLERANCE = 1e-9
"""Of masses, first moments and inertias read again, relative to the largest one of the robot."""
PLACE_TOLERANCE = 1e-6
"""Of the placements of joints [m, 1]: single precision of lengths of a metre, twice rounded."""
_MOVING = {"revolute": "Revolute", "continuous": "Revolute", "prismatic": "Prismatic"}


def usd_text(model: IdentifiedModel) -> str:
    """Text of a USD stage (.usda); every link is placed at q = 0."""
    require_no_coupling(model, "usd")
    lib, tree = model.lib, model.tree
    names = _prim_names([*tree.links, *(edge.name for edge in tree.edges.values())])
    root = _prim_names([lib.name])[lib.name]
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
        f"    vector3f physics:gravityDirection = {_tuple(down)}",
        f"    float physics:gravityMagnitude = {digits(strength)}",
        "}",
        "",
        f'def Xform "{root}" (',
        '    prepend apiSchemas = ["PhysicsArticulationRootAPI"]',
        ")",
        "{",
    ]
    paths = _paths(model, f"/{root}", names)
    places = {tree.base: np.eye(4)}
    for link in tree.subtree(tree.base):
        edge = tree.edges.get(link)
        if edge is not None:
            places[link] = places[edge.parent] @ edge.placement
        if paths[link].count("/") == 2:
            lines += _indented(_link(model, link, names, places[link], paths), 4)
    lines += ['    def Scope "joints"', "    {"]
    if _is_body(model, tree.base):
        lines += _anchor(paths[tree.base])
    for edge in tree.edges.values():
        if paths[edge.child].count("/") == 2:
            ends = (paths[edge.parent], paths[edge.child])
            lines += _joint(model, edge, names[edge.name], ends)
    return "\n".join([*lines, "    }", "}", ""])


def check_usd(model: IdentifiedModel, text: str) -> str:
    """Reload a USD by usd-core: bodies in double precision, placements and friction of the joints.

    Args:
        model: what was written.
        text: the file.

    Returns:
        One sentence: verified, or not checked.

    Raises:
        ExportError: an inertia, a placement or the friction of a joint differs.
        Unreadable: usd-core refuses the file.
    """
    read = usd.reload(text, model)
    if read is None:
        return unchecked(usd.INSTALL)
    expected = model.pi.reshape(read.pi.shape)
    difference = np.abs(read.pi - expected) / np.abs(expected).max()
    if not difference.max() <= INERTIA_TOLERANCE:
        link = model.lib.link_names[int(difference.max(axis=1).argmax())]
        raise ExportError(
            f"not written: reloaded by {read.engine}, the inertia of the link '{link}' differs by "
            f"{difference.max():.1e} of the largest one, where {INERTIA_TOLERANCE:g} is allowed; "
            "report this as a fault of symgen"
        )
    for edge in model.tree.edges.values():
        if edge.kind not in _MOVING and not _is_body(model, edge.child):
            continue  # a frame without a joint
        axis = edge.axis if edge.kind in _MOVING else None
        if not read.place_error(edge.name, edge.placement, axis) <= PLACE_TOLERANCE:
            raise ExportError(
                f"not written: reloaded by {read.engine}, the joint '{edge.name}' is placed "
                "differently; report this as a fault of symgen"
            )
    for quantity in ("damping", "friction", "armature"):
        for name, value in zip(
            model.lib.joint_names, getattr(model.friction, quantity), strict=True
        ):
            if value is not None and not read.holds(name, quantity, value):
                raise ExportError(
                    f"not written: reloaded by {read.engine}, the {quantity} of joint '{name}' "
                    f"is not {value:g}; report this as a fault of symgen"
                )
    return (
        f"verified: reloaded by {read.engine}, inertias agree to {difference.max():.1e} of the "
        "largest one"
    )


def _prim_names(names: list[str]) -> dict[str, str]:
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


def _is_body(model: IdentifiedModel, link: str) -> bool:
    """Whether a link has mass or moves; others are frames on the link before them."""
    body, edge = model.bodies.by_link.get(link), model.tree.edges.get(link)
    return (body is not None and body.mass > 0) or (edge is not None and edge.kind in _MOVING)


def _paths(model: IdentifiedModel, root: str, names: dict[str, str]) -> dict[str, str]:
    """Link → path of its prim: bodies below the root, since bodies are not nested; frames on them.

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
    """A link with the frames on it.

    Args:
        model: the robot.
        link: name.
        names: name → identifier.
        place: T (4, 4) from the link's frame to that of the prim above.
        paths: of all links.

    Returns:
        Lines.
    """
    body = model.bodies.by_link.get(link)
    inside = [f"custom string symgen:name = {_text(link)}"]
    schemas = ['"PhysicsRigidBodyAPI"'] if _is_body(model, link) else []
    if body is not None and body.mass > 0:
        schemas.append('"PhysicsMassAPI"')
        inside += _mass(body)
    # USD multiplies rows from the left, so that it holds the transposed matrix.
    rows = ", ".join(_tuple(row) for row in place.T)
    inside += [
        f"matrix4d xformOp:transform = ( {rows} )",
        'uniform token[] xformOpOrder = ["xformOp:transform"]',
    ]
    for edge in model.tree.children(link):
        if paths[edge.child].startswith(f"{paths[link]}/"):
            inside += _link(model, edge.child, names, edge.placement, paths)
    head = f'def Xform "{names[link]}"'
    opened = [head]
    if schemas:
        opened = [f"{head} (", f"    prepend apiSchemas = [{', '.join(schemas)}]", ")"]
    return [*opened, "{", *_indented(inside, 4), "}"]


def _indented(lines: list[str], columns: int) -> list[str]:
    return [f"{' ' * columns}{line}" for line in lines]


def _mass(body: RigidBody) -> list[str]:
    """Attributes of UsdPhysics, and the same in double precision."""
    diagonal, axes = np.linalg.eigh(body.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    turn = np.eye(4)
    turn[:3, :3] = axes
    values = {
        ("float", "double", "mass"): digits(body.mass),
        ("point3f", "double3", "centerOfMass"): _tuple(body.com),
        ("float3", "double3", "diagonalInertia"): _tuple(diagonal),
        ("quatf", "quatd", "principalAxes"): _tuple(quaternion(turn)),
    }
    single = [f"{kind} physics:{name} = {value}" for (kind, _, name), value in values.items()]
    double = [f"custom {kind} symgen:{name} = {value}" for (_, kind, name), value in values.items()]
    return single + double


def _anchor(base: str) -> list[str]:
    """Fixed joint of the base to the world."""
    return [
        '        def PhysicsFixedJoint "root_joint"',
        "        {",
        f"            rel physics:body1 = <{base}>",
        "        }",
    ]


def _joint(model: IdentifiedModel, edge: Edge, prim: str, ends: tuple[str, str]) -> list[str]:
    kind = _MOVING.get(edge.kind, "Fixed")
    align = np.eye(4)
    if kind != "Fixed":
        align[:3, :3] = _onto(edge.axis)
    first = edge.placement @ align
    inside = [
        f"custom string symgen:name = {_text(edge.name)}",
        f"rel physics:body0 = <{ends[0]}>",
        f"rel physics:body1 = <{ends[1]}>",
        f"point3f physics:localPos0 = {_tuple(edge.placement[:3, 3])}",
        f"quatf physics:localRot0 = {_tuple(quaternion(first))}",
        "point3f physics:localPos1 = (0.0, 0.0, 0.0)",
        f"quatf physics:localRot1 = {_tuple(quaternion(align))}",
    ]
    schemas: list[str] = []
    if kind != "Fixed":
        schemas, more = _moving(model, edge, kind)
        inside += more
    head = f'        def Physics{kind}Joint "{prim}"'
    opened = (
        [f"{head} (", f"            prepend apiSchemas = [{', '.join(schemas)}]", "        )"]
        if schemas
        else [head]
    )
    return [*opened, "        {", *(f"            {line}" for line in inside), "        }"]


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


def _onto(axis: Array) -> Array:
    """Rotation that turns the x-axis onto a unit vector (3,)."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    second = np.cross(axis, other)
    second /= np.linalg.norm(second)
    return np.column_stack([axis, second, np.cross(axis, second)])


def _tuple(values: Array) -> str:
    return f"({', '.join(map(digits, values))})"


def _text(name: str) -> str:
    """Quoted text of USD."""
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


USD = ExportFormat(
    "usd",
    "USD with UsdPhysics bodies and joints, friction and armature for PhysX and MuJoCo",
    "{robot}.usda",
    usd_text,
    check_usd,
)
