"""MJCF → URDF, couplings and loops, by MuJoCo's compiler.

Hinges become revolute, slides prismatic joints; several joints of a body are a chain through links
of `SPECK_KG`. The frame of a link is at the anchor of its joint; at q = ref the body is where the
file shows it. Linear equalities of two joints become couplings, `connect` and `weld` loop joints
that are closed at the initial pose, where every joint is at its reference; `damping` and
`frictionloss` stand in <dynamics>. A URDF has no place for armature, which the friction column
`rotor` identifies.

    connect   a point of body 1 stays at a point of body 2          spherical
    weld      a frame of body 1 stays at a frame of body 2          fixed

An equality of tendons along joints is a coupling too. A body that floats freely beside a robot is
an object of the scene and left out.
"""

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio

from symgen.chain.coupling import CouplingRow
from symgen.chain.document import add_inertial, add_joint, listing
from symgen.chain.mechanism import Loop, Mechanism
from symgen.chain.normalise import Note, note_gravity
from symgen.errors import BuildError
from symgen.sources.compiled_mjcf import Bodies, compile_mjcf, rotation_of
from symgen.sources.springs import factors_of_tendon, springs_of_mjcf

SPECK_KG = 1e-9  # mass of links between joints of one body, kg: below the rounding of any torque


def robot_from_mjcf(
    path: Path, chosen: str | None, has_gravity: bool, note: Note
) -> tuple[str, Mechanism]:
    """URDF of an MJCF file, or of the body of the world of this name."""
    compiled = compile_mjcf(path)
    if compiled.model is None:
        raise BuildError(f"MuJoCo rejects '{path}': {compiled.reason}; correct the file")
    for sentence in compiled.notes:
        note(sentence)
    return robot_of_compiled(compiled.model, path.stem, chosen, has_gravity, note, f"'{path}'")


def robot_of_compiled(
    model: Any, name: str, chosen: str | None, has_gravity: bool, note: Note, where: str
) -> tuple[str, Mechanism]:
    """URDF of a compiled model of MuJoCo."""
    import mujoco

    if not has_gravity:
        note_gravity(np.array(model.opt.gravity), "the file states the gravity", "", note)
    _note_compensated(model, note)
    robot = Element("robot", {"name": name})
    names = _unique([model.body(k).name or f"body_{k}" for k in range(model.nbody)])
    SubElement(robot, "link", {"name": names[0]})
    bodies = Bodies(mujoco, model, names, {0: np.zeros(3)})
    kept = _chosen_bodies(bodies, chosen, where, note)
    for body in kept:
        _add_body(robot, bodies, body)
    indent(robot, space="  ")
    rows: list[CouplingRow] = []
    loops: list[Loop] = []
    targets = {k for k in kept if model.body_mocapid[k] >= 0}
    if targets:
        listed = listing(names[k] for k in sorted(targets))
        note(f"equalities with the targets {listed} (mocap) are left out: they belong to no robot")
    inside = {0, *kept} - targets
    for k in np.flatnonzero(model.eq_active0).tolist():
        kind = int(model.eq_type[k])
        if not _is_inside(bodies, k, inside):
            continue
        if kind == int(mujoco.mjtEq.mjEQ_JOINT):
            rows.append(_coupling(model, k))
        elif kind == int(mujoco.mjtEq.mjEQ_TENDON):
            rows.append(_tendon_coupling(bodies, k, {row.joint for row in rows}))
        else:
            loops.append(_loop_of_equality(bodies, k))
    assembly = _assembly_of(bodies, inside) if loops else {}
    mechanism = Mechanism(
        coupling=tuple(rows), spring=springs_of_mjcf(bodies), loop=tuple(loops), assembly=assembly
    )
    return tostring(robot, "unicode") + "\n", mechanism


def _chosen_bodies(bodies: Bodies, chosen: str | None, where: str, note: Note) -> list[int]:
    """Bodies of the robot: those of the chosen tree, or all but objects that float freely."""
    model, names = bodies.model, bodies.names
    root = np.array(model.body_rootid)
    tops = [k for k in range(1, model.nbody) if root[k] == k]
    free = int(bodies.mujoco.mjtJoint.mjJNT_FREE)
    owners = root[np.array(model.jnt_bodyid, dtype=int)]
    turning = set(owners[np.array(model.jnt_type) != free].tolist())
    floating = set(owners[np.array(model.jnt_type) == free].tolist())
    if chosen is not None:
        named = [k for k in tops if names[k] == chosen]
        if not named:
            listed = listing(names[k] for k in tops if k in turning) or "none with joints"
            raise BuildError(
                f"--model names '{chosen}', which is not a body of the world of {where}; its "
                f"bodies with joints are {listed}"
            )
        return [k for k in range(1, model.nbody) if root[k] == named[0]]
    objects = floating - turning if turning else set()
    if objects:
        listed = listing(names[k] for k in sorted(objects))
        note(f"bodies that float freely beside the robot are left out: {listed}")
    return [k for k in range(1, model.nbody) if root[k] not in objects]


def _is_inside(bodies: Bodies, k: int, inside: set[int]) -> bool:
    """Whether an equality acts on bodies of the robot alone; one with an object does not."""
    model, kinds = bodies.model, bodies.mujoco.mjtObj
    owners = {
        int(kinds.mjOBJ_BODY): lambda at: at,
        int(kinds.mjOBJ_SITE): lambda at: int(model.site_bodyid[at]),
        int(kinds.mjOBJ_JOINT): lambda at: int(model.jnt_bodyid[at]),
    }
    owner = owners.get(int(model.eq_objtype[k]))
    ends = (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
    return owner is None or all(at < 0 or owner(at) in inside for at in ends)


def _note_compensated(model: Any, note: Note) -> None:
    """Note bodies whose weight MuJoCo compensates."""
    compensated = [model.body(k).name or f"body_{k}" for k in np.flatnonzero(model.body_gravcomp)]
    if compensated:
        note(
            f"the gravcomp of {', '.join(compensated)} is left out: their weight counts in full; "
            "[[known_torque]] of a mechanism file describes a counterweight"
        )


def _unique(names: list[str]) -> list[str]:
    seen: set[str] = set()
    for k, name in enumerate(names):
        names[k] = name if name not in seen else f"{name}_{k}"
        seen.add(names[k])
    return names


def _add_body(robot: Element, bodies: Bodies, body: int) -> None:
    model, names = bodies.model, bodies.names
    parent = int(model.body_parentid[body])
    rotation = rotation_of(model.body_quat[body])
    place = model.body_pos[body] - bodies.shifts[parent]
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    above, anchor = names[parent], np.zeros(3)
    for k in range(first, first + count):
        name = bodies.joint(k)
        if bodies.is_joint(k, "FREE") and parent == 0:
            # --floating --base BODY builds a free base
            add_joint(robot, name, "floating", (above, names[body]), place, rotation)
            continue
        slides, ball = bodies.is_joint(k, "SLIDE"), bodies.is_joint(k, "BALL")
        last = k == first + count - 1
        link = names[body] if last else f"{names[body]}_{name}"
        # The frame of the link turns about its anchor; at q = ref it is where the file shows it.
        new, axis = np.array(model.jnt_pos[k]), np.array(model.jnt_axis[k])
        at = place + rotation @ (new - anchor)
        ref = 0.0 if ball else float(model.qpos0[model.jnt_qposadr[k]])
        if slides:
            at = at - rotation @ axis * ref
        else:
            rotation = rotation @ pinocchio.AngleAxis(-ref, axis).toRotationMatrix()
        limited = bool(model.jnt_limited[k])
        kind = "prismatic" if slides else "revolute" if limited else "continuous"
        # `chain` refuses a ball unless it is locked or cut off
        kind = "spherical" if ball else kind
        of_axis = () if ball else _of_axis(model, k, limited)
        add_joint(robot, name, kind, (above, link), at, rotation, *of_axis)
        above, place, rotation, anchor = link, np.zeros(3), np.eye(3), new
        if not last:
            speck = SubElement(robot, "link", {"name": link})
            add_inertial(speck, SPECK_KG, np.zeros(3), SPECK_KG * 1e-4 * np.eye(3))
    if not count:
        mount, ends = f"{names[body]}_mount", (above, names[body])
        add_joint(robot, mount, "fixed", ends, place, rotation)
    bodies.shifts[body] = anchor
    element = SubElement(robot, "link", {"name": names[body]})
    mass = float(model.body_mass[body])
    if mass > 0:
        turn = rotation_of(model.body_iquat[body])
        inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
        add_inertial(element, mass, model.body_ipos[body] - anchor, inertia)


def _of_axis(
    model: Any, k: int, limited: bool
) -> tuple[Any, dict[str, float] | None, dict[str, float]]:
    """Axis, limits and friction of a joint."""
    limits: dict[str, float] | None = None
    if limited:
        lower, upper = model.jnt_range[k]
        effort = model.jnt_actfrcrange[k][1] if model.jnt_actfrclimited[k] else 0.0
        limits = {"lower": lower, "upper": upper, "effort": effort}
    dof = int(model.jnt_dofadr[k])
    dynamics = {"damping": np.min(model.dof_damping[dof]), "friction": model.dof_frictionloss[dof]}
    return model.jnt_axis[k], limits, dynamics


def _coupling(model: Any, k: int) -> CouplingRow:
    """Row of an equality x_1 − ref_1 = c_0 + c_1 (x_2 − ref_2)."""
    first, second = (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
    name = model.joint(first).name
    c = _linear(model, k, f"joint '{name}'")
    offset = float(c[0] + model.qpos0[model.jnt_qposadr[first]])
    if second < 0:
        return CouplingRow(name, {}, offset)
    offset -= float(c[1] * model.qpos0[model.jnt_qposadr[second]])
    return CouplingRow(name, {model.joint(second).name: float(c[1])}, offset)


def _linear(model: Any, k: int, what: str) -> np.ndarray:
    """Coefficients of the polynomial of an equality, which has the degree 1."""
    c = np.array(model.eq_data[k][:5])
    if np.any(c[2:]):
        raise BuildError(
            f"the equality of {what} is a polynomial of degree 2 or more, expected a linear one; "
            "remove it, or state [[coupling]] in a mechanism file"
        )
    return c


def _tendon_coupling(bodies: Bodies, k: int, dependent: set[str]) -> CouplingRow:
    """Row of an equality L_1 − L_1⁰ = c_0 + c_1 (L_2 − L_2⁰) of lengths L = Σ a x along joints.

    The joint that follows is the last one of a nonzero factor that follows no other row.
    """
    model = bodies.model
    first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    name = bodies.tendon(first)
    c = _linear(model, k, f"tendon '{name}'")
    factors: dict[str, float] = {}
    total = float(c[0])
    for tendon, share in ((first, 1.0), (second, -float(c[1]))):
        if tendon < 0:
            continue
        total += share * float(model.tendon_length0[tendon])
        along = factors_of_tendon(bodies, tendon)
        if along is None:
            raise BuildError(
                f"the equality of tendon '{name}' is not one of tendons along joints; remove "
                "it, or state [[coupling]] in a mechanism file"
            )
        for key, factor in along.items():
            factors[key] = factors.get(key, 0.0) + share * factor
    free = [key for key, factor in factors.items() if factor and key not in dependent]
    if not free:
        raise BuildError(
            f"the equality of tendon '{name}' determines no joint that another equality leaves "
            "free; remove it"
        )
    factor = factors.pop(free[-1])
    others = {key: -f / factor for key, f in factors.items() if f}
    return CouplingRow(free[-1], others, total / factor)


def _loop_of_equality(bodies: Bodies, k: int) -> Loop:
    """Loop joint of an equality."""
    mujoco, model, names, shifts = bodies.mujoco, bodies.model, bodies.names, bodies.shifts
    kind, data = int(model.eq_type[k]), np.array(model.eq_data[k])
    kinds = {int(mujoco.mjtEq.mjEQ_CONNECT): "spherical", int(mujoco.mjtEq.mjEQ_WELD): "fixed"}
    if kind not in kinds:
        raise BuildError(
            f"the equality {k + 1} of the file is none of joint, tendon, connect and weld; flexes "
            "of MJCF cannot be modelled, so remove it"
        )
    first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    turn, other = np.eye(3), np.eye(3)
    if int(model.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
        (first, at, turn), (second, to, other) = (
            (int(model.site_bodyid[s]), model.site_pos[s], rotation_of(model.site_quat[s]))
            for s in (first, second)
        )
    elif kinds[kind] == "fixed":  # the pose of body 2 in body 1, of a point given in body 2
        at, to, turn = data[3:6], data[:3], rotation_of(data[6:10])
    else:
        at, to = data[:3], data[3:6]
    at, to = at - shifts[first], to - shifts[second]
    return Loop(
        names[first],
        names[second],
        tuple(at.tolist()),
        tuple(pinocchio.rpy.matrixToRpy(turn).tolist()),
        tuple(to.tolist()),
        tuple(pinocchio.rpy.matrixToRpy(other).tolist()),
        kinds[kind],
    )


def _assembly_of(bodies: Bodies, inside: set[int]) -> dict[str, float]:
    """Joint → position of the initial pose [rad, m], joints at 0 left out."""
    model, positions = bodies.model, {}
    for k in range(model.njnt):
        value = float(model.qpos0[model.jnt_qposadr[k]])
        one = bodies.is_joint(k, "SLIDE", "HINGE")  # one number
        if value and int(model.jnt_bodyid[k]) in inside and one:
            positions[bodies.joint(k)] = value
    return positions
