"""Build of a robot in memory: a `pinocchio.Model`, a `mujoco.MjSpec` or the text of a file.

A `pinocchio.Model` becomes a URDF of one link per joint, with all bodies that Pinocchio has fixed
to it. The link of a joint has the name of its first body frame. A free flyer at the root is the
free base. Other frames, rotors and friction are left out.
"""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio

from symgen.chain import ChainOptions
from symgen.chain.document import add_inertial, add_joint
from symgen.errors import BuildError
from symgen.make import bundled_robots
from symgen.make.compiler import levels_of_processor
from symgen.make.pipeline import BuildResult
from symgen.make.pipeline import build as build_request
from symgen.make.request import BuildRequest
from symgen.sources import Source, read_source
from symgen.sources.mjcf import robot_of_compiled
from symgen.sources.springs import with_springs_of_file

UNLIMITED = 1e9  # limits from here on are none: libraries write the largest number


def build(
    model: Any,
    *,
    name: str,
    out: str | Path = "generated",
    options: ChainOptions | None = None,
    force: bool = False,
) -> BuildResult:
    """Generate and compile the library of a robot in memory, as `symgen build` does of a file.

    Of a `pinocchio.Model`, gravity and the limits of joints are taken, a free flyer at the root is
    the free base, and fixed links have become part of the moving ones. Of a `mujoco.MjSpec`,
    bodies, joints, couplings, loops and springs are taken as from a file. Friction, damping and
    rotors are left to the identification.

    Args:
        model: `pinocchio.Model`, `mujoco.MjSpec`, or the text of a URDF, MJCF or SDF file.
        name: of the folder and prefix of the C functions: a-z, 0-9, _.
        out: folder of generated folders.
        options: base, tip, locked joints, gravity, free base and others; None is the model's.
        force: rebuild even if the folder is up to date.

    Returns:
        The generated `folder`, which `runtime.load` takes, and `notes`.

    Raises:
        SymgenError: a model of another kind, a joint or body that cannot be built, or the name of
            a bundled robot.
    """
    if not isinstance(out, str | Path):
        raise BuildError(f"expected a folder for out, got {out!r:.60}")
    if name in bundled_robots():
        raise BuildError(f"'{name}' is the name of a bundled robot; choose another name")
    chosen, notes = options or ChainOptions(), list[str]()
    kind, package = type(model).__name__, type(model).__module__.partition(".")[0]
    if isinstance(model, str):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"{name}.urdf")
            path.write_text(model, encoding="utf-8")
            has_gravity = chosen.gravity is not None
            urdf, mechanism = read_source(Source(path), chosen.mechanism, notes.append, has_gravity)
    elif (package, kind) == ("mujoco", "MjSpec"):
        compiled, has_gravity = model.copy().compile(), chosen.gravity is not None
        place = f"the specification of '{name}'"
        urdf, mechanism = robot_of_compiled(compiled, name, None, has_gravity, notes.append, place)
    elif (package, kind) == ("pinocchio", "Model"):
        urdf, floats = urdf_of_model(model)
        x, y, z = map(float, model.gravity.linear)
        free, gravity = floats or chosen.floating, chosen.gravity or (x, y, z)
        chosen, mechanism = replace(chosen, gravity=gravity, floating=free), chosen.mechanism
    else:
        raise BuildError(
            "expected a pinocchio.Model, a mujoco.MjSpec or the text of a URDF, MJCF or SDF file, "
            f"got {model!r:.60}"
        )
    chosen = with_springs_of_file(urdf, chosen, mechanism, notes.append)
    done = build_request(BuildRequest(name, urdf, chosen), Path(out), force, levels_of_processor())
    return replace(done, notes=(*notes, *done.notes))


def urdf_of_model(model: Any) -> tuple[str, bool]:
    """Text of the URDF of a `pinocchio.Model`, and whether its base is free."""
    floats = model.njoints > 1 and model.joints[1].shortname() == "JointModelFreeFlyer"
    base, links, data = int(floats), _links(model), model.createData()
    pinocchio.forwardKinematics(model, data, pinocchio.neutral(model), np.zeros(model.nv))
    robot = Element("robot", {"name": model.name or "robot"})
    for k in range(base, model.njoints):
        link, body = SubElement(robot, "link", {"name": links[k]}), model.inertias[k]
        if body.mass > 0:
            add_inertial(link, body.mass, body.lever, body.inertia)
    for k in range(base + 1, model.njoints):
        if model.joints[k].nv != 1 or model.parents[k] < base:
            raise BuildError(
                f"expected joints of one axis behind the root, got '{model.names[k]}' "
                f"({model.joints[k].shortname()}); give several joints of one axis for it"
            )
        axis = np.ravel(data.joints[k].S)
        _joint_of_model(robot, model, k, (links[model.parents[k]], links[k]), axis)
    indent(robot, space="  ")
    return tostring(robot, "unicode") + "\n", floats


def _links(model: Any) -> list[str]:
    """Names of the links of all joints, the world's first."""
    names: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY:
            names.setdefault(frame.parentJoint, frame.name)
    return [names.get(k, f"{name}_link") for k, name in enumerate(model.names)]


def _joint_of_model(
    robot: Element, model: Any, k: int, ends: tuple[str, str], axis: np.ndarray
) -> None:
    joint, place = model.joints[k], model.jointPlacements[k]
    slides = not axis[3:].any()
    limits = {"effort": model.upperEffortLimit, "velocity": model.upperVelocityLimit}
    values = {key: limit[joint.idx_v] for key, limit in limits.items()}
    if joint.nq == 1:  # the two coordinates of a continuous joint are cos q and sin q
        values["lower"] = model.lowerPositionLimit[joint.idx_q]
        values["upper"] = model.upperPositionLimit[joint.idx_q]
    finite = {key: x for key, x in values.items() if abs(x) < UNLIMITED}
    kind = "prismatic" if slides else "revolute" if "lower" in finite else "continuous"
    pose, axis = (place.translation, place.rotation), axis[:3] if slides else axis[3:]
    add_joint(robot, model.names[k], kind, ends, *pose, axis, finite)
