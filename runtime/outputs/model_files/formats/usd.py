"""USD of a robot: UsdPhysics bodies and joints, joint friction and armature for PhysX and MuJoCo.

Mass, centre of mass, diagonal inertia and principal axes of UsdPhysics are single precision, a
relative 6e-8; the attributes `symgen:…` beside them hold the same in double precision. PhysX reads
PhysxJointAxisAPI, whose viscous coefficient of an angular axis is per degree; MuJoCo reads
MjcJointAPI in SI units.
"""

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array
from runtime.outputs.model_files.engines import usd
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.usd_joints import (
    MOVING,
    anchor,
    frame_matrix,
    indented,
    joint_prim,
    loop_prims,
    moved,
    prim_names,
    quoted,
    require_mechanism,
    tuple_of,
)
from runtime.outputs.model_files.model import IdentifiedModel, couplings
from runtime.outputs.model_files.reload_check import unchecked
from runtime.outputs.model_files.urdf_tree import RigidBody, digits, quaternion

INERTIA_TOLERANCE = 1e-9
"""Of masses, first moments and inertias read again, relative to the largest one of the robot."""
PLACE_TOLERANCE = 1e-6
"""Of the placements of joints [m, 1]: single precision of lengths of a metre, twice rounded."""


def usd_text(model: IdentifiedModel) -> str:
    """Text of a USD stage (.usda).

    Every link is placed at q = 0, or at `lib.home` where joints follow others, so that loops are
    closed.
    """
    require_mechanism(model)
    lib, tree = model.lib, model.tree
    names = prim_names(
        [*tree.links, *(edge.name for edge in tree.edges.values()), *lib.manifest.loops]
    )
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
    places, at = {tree.base: np.eye(4)}, _positions(model)
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
        lines += anchor(paths[tree.base])
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
        if edge.kind not in MOVING and not _is_body(model, edge.child):
            continue  # a frame without a joint
        axis = edge.axis if edge.kind in MOVING else None
        if not read.place_error(edge.name, edge.placement, axis) <= PLACE_TOLERANCE:
            raise ExportError(
                f"not written: reloaded by {read.engine}, the joint '{edge.name}' is placed "
                "differently; report this as a fault of symgen"
            )
    _require_mechanism_read(model, read)
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


def _require_mechanism_read(model: IdentifiedModel, read: usd.ReloadedStage) -> None:
    """Raise ExportError where a loop joint or a joint that follows another was read differently."""
    manifest = model.lib.manifest
    for name, joint in zip(manifest.loops, manifest.loop_joints, strict=True):
        frames = (frame_matrix(joint.parent), frame_matrix(joint.child))
        if not read.loop_error(name, frames) <= PLACE_TOLERANCE:
            raise ExportError(
                f"not written: reloaded by {read.engine}, {name} differs; "
                "report this as a fault of symgen"
            )
    for name, (masters, offset) in couplings(manifest).items():
        ((master, factor),) = masters.items()
        if not read.follows(name, master, factor, offset):
            raise ExportError(
                f"not written: reloaded by {read.engine}, the joint '{name}' does not follow "
                f"'{master}' as in the robot; report this as a fault of symgen"
            )


def _positions(model: IdentifiedModel) -> dict[str, float]:
    """Joint → position in which the stage places the bodies [rad, m]; empty for q = 0."""
    lib = model.lib
    if lib.all_joint_names == lib.joint_names:
        return {}
    return dict(zip(lib.all_joint_names, lib.all_positions(lib.home).tolist(), strict=True))


def _is_body(model: IdentifiedModel, link: str) -> bool:
    """Whether a link has mass or moves; others are frames on the link before them."""
    body, edge = model.bodies.by_link.get(link), model.tree.edges.get(link)
    return (body is not None and body.mass > 0) or (edge is not None and edge.kind in MOVING)


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
    head = f'def Xform "{names[link]}"'
    opened = [head]
    if schemas:
        opened = [f"{head} (", f"    prepend apiSchemas = [{', '.join(schemas)}]", ")"]
    return [*opened, "{", *indented(inside, 4), "}"]


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
