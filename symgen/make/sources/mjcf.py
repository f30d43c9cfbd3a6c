"""MJCF → URDF, couplings and loops, by MuJoCo's compiler.

Hinges become revolute, slides prismatic joints; several joints of a body are a chain through links
of `SPECK_KG`. The frame of a link is at the anchor of its joint; at q = ref the body is where the
file shows it. Linear equalities of two joints become couplings, `connect` and `weld` loop joints
that are closed at the initial pose, where every joint is at its reference; `damping` and
`frictionloss` stand in <dynamics>. A URDF has no place for armature, which the friction column
`rotor` identifies.

    connect   a point of body 1 stays at a point of body 2          spherical
    weld      a frame of body 1 stays at a frame of body 2          fixed

MuJoCo opens what `file` attributes name, however large, and waits at a pipe for ever. Before it
does, every file that exists must be a regular one of bounded size, in included files too.
Attributes are searched in the text: MuJoCo accepts files that are not well-formed XML.
"""

import re
import stat
from collections.abc import Callable
from html import unescape
from itertools import chain, product
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio

from runtime.common.files import LARGEST_DOCUMENT
from symgen.chain.coupling import CouplingRow
from symgen.chain.mechanism import Loop, Mechanism
from symgen.chain.normalise import GRAVITY
from symgen.errors import BuildError
from symgen.make.sources.springs import springs_of_mjcf

LARGEST_ASSET = 2**28
"""Largest mesh, texture or height field, bytes."""
MOST = 50_000
"""Largest number of pairs of a folder and a name."""
_NAMED = re.compile(r"""\b(file\w*|meshdir|texturedir|assetdir)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
"""Names of files (file, fileright, fileup, … of a texture) and of their folders."""


_FAR = 0.05
"""Difference of gravity, m/s², above which it is noted: more than that of any two places."""
SPECK_KG = 1e-9
"""Mass of the links between several joints of one body, kg: below the rounding of any torque."""


def robot_from_mjcf(
    path: Path, has_gravity: bool, note: Callable[[str], None]
) -> tuple[str, Mechanism]:
    """URDF of an MJCF file."""
    try:
        import mujoco
    except ImportError:
        raise BuildError(
            f"'{path}' is an MJCF file, which MuJoCo reads; run: pip install mujoco"
        ) from None
    require_bounded_files(path)
    mujoco.set_mju_user_warning(lambda _: None)  # else it writes MUJOCO_LOG.TXT
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise BuildError(f"MuJoCo rejects '{path}': {reason}; correct the file") from None
    if not has_gravity:
        _note_gravity(model, note)
    _note_compensated(model, note)
    robot = Element("robot", {"name": path.stem})
    names = _unique([model.body(k).name or f"body_{k}" for k in range(model.nbody)])
    SubElement(robot, "link", {"name": names[0]})
    shifts = {0: np.zeros(3)}  # body → anchor of its last joint in the body's frame
    for body in range(1, model.nbody):
        _add_body(robot, mujoco, model, body, names, shifts)
    indent(robot, space="  ")
    joint = int(mujoco.mjtEq.mjEQ_JOINT)
    active = [k for k in range(model.neq) if model.eq_active0[k]]
    rows = tuple(_coupling(model, k) for k in active if int(model.eq_type[k]) == joint)
    loops = tuple(
        loop_of_equality(mujoco, model, k, names, shifts)
        for k in active
        if int(model.eq_type[k]) != joint
    )
    assembly = assembly_of(model) if loops else {}
    springs = springs_of_mjcf(mujoco, model, names, shifts)
    mechanism = Mechanism(coupling=rows, spring=springs, loop=loops, assembly=assembly)
    return tostring(robot, "unicode") + "\n", mechanism


def _note_gravity(model: Any, note: Callable[[str], None]) -> None:
    """Note gravity other than that of a build."""
    gravity = np.array(model.opt.gravity)
    if np.linalg.norm(gravity - GRAVITY) > _FAR:
        stated = ",".join(f"{x:g}" for x in gravity)
        note(
            f"the file states the gravity {stated} m/s², and the build takes 0,0,-9.81 unless "
            "--gravity is given"
        )


def _note_compensated(model: Any, note: Callable[[str], None]) -> None:
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


def _add_body(
    robot: Element,
    mujoco: Any,
    model: Any,
    body: int,
    names: list[str],
    shifts: dict[int, np.ndarray],
) -> None:
    parent = int(model.body_parentid[body])
    rotation = _matrix(mujoco, model.body_quat[body])
    place = model.body_pos[body] - shifts[parent]
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    above, anchor = names[parent], np.zeros(3)
    for k in range(first, first + count):
        name = model.joint(k).name or f"joint_{k}"
        kind = int(model.jnt_type[k])
        if kind == int(mujoco.mjtJoint.mjJNT_FREE) and parent == 0:
            joint = _add_fixed(robot, name, above, names[body], place, rotation)
            joint.set("type", "floating")  # --floating --base BODY builds a free base
            continue
        slides = kind == int(mujoco.mjtJoint.mjJNT_SLIDE)
        if not slides and kind != int(mujoco.mjtJoint.mjJNT_HINGE):
            raise BuildError(
                f"joint '{name}' of the body '{names[body]}' is a ball or free joint; hinges and "
                "slides can be modelled, so replace it, or remove it to fix the body"
            )
        last = k == first + count - 1
        link = names[body] if last else f"{names[body]}_{name}"
        # The frame of the link turns about its anchor; at q = ref it is where the file shows it.
        new, axis = np.array(model.jnt_pos[k]), np.array(model.jnt_axis[k])
        at = place + rotation @ (new - anchor)
        ref = float(model.qpos0[model.jnt_qposadr[k]])
        if slides:
            at = at - rotation @ axis * ref
        else:
            rotation = rotation @ pinocchio.AngleAxis(-ref, axis).toRotationMatrix()
        _add_joint(robot, model, k, name, above, link, at, rotation, slides)
        above, place, rotation, anchor = link, np.zeros(3), np.eye(3), new
        if not last:
            SubElement(robot, "link", {"name": link}).append(_speck())
    if not count:
        _add_fixed(robot, f"{names[body]}_mount", above, names[body], place, rotation)
    shifts[body] = anchor
    element = SubElement(robot, "link", {"name": names[body]})
    mass = float(model.body_mass[body])
    if mass > 0:
        turn = _matrix(mujoco, model.body_iquat[body])
        inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
        element.append(_inertial(mass, model.body_ipos[body] - anchor, inertia))


def _add_joint(
    robot: Element,
    model: Any,
    k: int,
    name: str,
    parent: str,
    child: str,
    at: np.ndarray,
    rotation: np.ndarray,
    slides: bool,
) -> None:
    limited = bool(model.jnt_limited[k])
    kind = "prismatic" if slides else "revolute" if limited else "continuous"
    joint = _add_fixed(robot, name, parent, child, at, rotation)
    joint.set("type", kind)
    SubElement(joint, "axis", {"xyz": _words(model.jnt_axis[k])})
    if limited:
        lower, upper = (f"{float(x):.17g}" for x in model.jnt_range[k])
        effort = model.jnt_actfrcrange[k][1] if model.jnt_actfrclimited[k] else 0.0
        limits = {"lower": lower, "upper": upper, "effort": f"{float(effort):.17g}"}
        SubElement(joint, "limit", limits | {"velocity": "0"})
    dof = int(model.jnt_dofadr[k])
    damping, dry = float(np.min(model.dof_damping[dof])), float(model.dof_frictionloss[dof])
    if damping or dry:
        SubElement(joint, "dynamics", {"damping": f"{damping:.17g}", "friction": f"{dry:.17g}"})


def _add_fixed(
    robot: Element, name: str, parent: str, child: str, at: np.ndarray, rotation: np.ndarray
) -> Element:
    joint = SubElement(robot, "joint", {"name": name, "type": "fixed"})
    rpy = pinocchio.rpy.matrixToRpy(rotation)
    SubElement(joint, "origin", {"xyz": _words(at), "rpy": _words(rpy)})
    SubElement(joint, "parent", {"link": parent})
    SubElement(joint, "child", {"link": child})
    return joint


def _coupling(model: Any, k: int) -> CouplingRow:
    """Row of an equality x_1 − ref_1 = c_0 + c_1 (x_2 − ref_2)."""
    first, second = (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
    name = model.joint(first).name
    c = np.array(model.eq_data[k][:5])
    if np.any(c[2:]):
        raise BuildError(
            f"the equality of joint '{name}' is a polynomial of degree 2 or more, expected a "
            "linear one; remove it, or state [[coupling]] in a mechanism file"
        )
    offset = float(c[0] + model.qpos0[model.jnt_qposadr[first]])
    if second < 0:
        return CouplingRow(name, {}, offset)
    offset -= float(c[1] * model.qpos0[model.jnt_qposadr[second]])
    return CouplingRow(name, {model.joint(second).name: float(c[1])}, offset)


def _speck() -> Element:
    return _inertial(SPECK_KG, np.zeros(3), SPECK_KG * 1e-4 * np.eye(3))


def _inertial(mass: float, com: np.ndarray, inertia: np.ndarray) -> Element:
    element = Element("inertial")
    SubElement(element, "origin", {"xyz": _words(com)})
    SubElement(element, "mass", {"value": f"{mass:.17g}"})
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = inertia[np.triu_indices(3)]
    SubElement(element, "inertia", {k: f"{v:.17g}" for k, v in zip(keys, values, strict=True)})
    return element


def _matrix(mujoco: Any, quaternion: Any) -> np.ndarray:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array(quaternion, dtype=float))
    return matrix.reshape(3, 3)


def _words(values: Any) -> str:
    return " ".join(f"{x + 0.0:.17g}" for x in np.ravel(values))


def require_bounded_files(path: Path) -> None:
    """Refuse an MJCF file that names pipes, devices or files of hundreds of megabytes."""
    folders, names, known = set[Path](), set[str](), set[Path]()
    pending = [path]
    while pending:
        file = pending.pop()
        if file in known:
            continue
        known.add(file)
        listed, places = _named_in(_text_of(file))
        new = {path.parent, file.parent, *(f.parent / p for f in (path, file) for p in places)}
        fresh, more = new - folders, listed - names
        folders |= fresh
        names |= more
        if len(folders) * len(names) > MOST:
            raise BuildError(f"'{path}' names more than {MOST} files; leave some out")
        # An asset may lie in a folder that a later file names: each pair is looked at once.
        for folder, name in chain(product(fresh, names), product(folders - fresh, more)):
            if _is_bounded(path, folder / name):
                pending.append(folder / name)


def _named_in(text: str) -> tuple[set[str], set[str]]:
    """Names of files, and of their folders."""
    files, places = set[str](), set[str]()
    for key, *values in _NAMED.findall(text):
        (places if key.endswith("dir") else files).add(unescape("".join(values)))
    return files, places


def _is_bounded(path: Path, asset: Path) -> bool:
    """Whether a file exists."""
    try:
        status = asset.stat()
    except (OSError, ValueError):  # MuJoCo names what it does not find
        return False
    if stat.S_ISDIR(status.st_mode):
        return False
    if not stat.S_ISREG(status.st_mode):
        raise BuildError(f"'{path}' names '{asset}', which is not a regular file; remove it")
    if status.st_size > LARGEST_ASSET:
        raise BuildError(
            f"'{path}' names '{asset}' of more than {LARGEST_ASSET >> 20} MiB; remove it"
        )
    return True


def _text_of(file: Path) -> str:
    """Text of a file that may be XML; empty for a mesh, an image or a file of other text."""
    try:
        if file.stat().st_size > LARGEST_DOCUMENT:
            return ""
        data = file.read_bytes()
    except OSError:  # MuJoCo says why
        return ""
    head = data[:512].lstrip(b"\xef\xbb\xbf \t\r\n")
    return data.decode(errors="replace") if head.startswith(b"<") else ""


def loop_of_equality(
    mujoco: Any, model: Any, k: int, names: list[str], shifts: dict[int, np.ndarray]
) -> Loop:
    """Loop joint of an equality."""
    kind, data = int(model.eq_type[k]), np.array(model.eq_data[k])
    kinds = {int(mujoco.mjtEq.mjEQ_CONNECT): "spherical", int(mujoco.mjtEq.mjEQ_WELD): "fixed"}
    if kind not in kinds:
        raise BuildError(
            f"the equality {k + 1} of the file is none of joint, connect and weld; tendons and "
            "flexes of MJCF cannot be modelled, so remove it, or state [[coupling]] in a mechanism "
            "file"
        )
    first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    turn, other = np.eye(3), np.eye(3)
    if int(model.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
        (first, at, turn), (second, to, other) = (
            (int(model.site_bodyid[s]), model.site_pos[s], _matrix(mujoco, model.site_quat[s]))
            for s in (first, second)
        )
    elif kinds[kind] == "fixed":  # the pose of body 2 in body 1, of a point given in body 2
        at, to, turn = data[3:6], data[:3], _matrix(mujoco, data[6:10])
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


def assembly_of(model: Any) -> dict[str, float]:
    """Joint → position of the initial pose [rad, m], joints at 0 left out."""
    positions = {}
    for k in range(model.njnt):
        value = float(model.qpos0[model.jnt_qposadr[k]])
        if value:
            positions[model.joint(k).name or f"joint_{k}"] = value
    return positions
