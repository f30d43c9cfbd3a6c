"""MJCF → `Model` by MuJoCo's loader; files that its compiler rejects are read as written.

A compiled model has all inertials, including those that MuJoCo infers from geoms. MuJoCo's compiler
rejects inconsistent inertias; then the inertials written in the file are checked.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from symgen.errors import UrdfError
from symgen.inspect.model import ERROR, Body, Finding, Joint, Link, Model
from symgen.inspect.urdf import HUGE, SPECK

_COMPILES = "expected a file that compiles"


def read_mjcf(path: Path) -> Model:
    """Read an MJCF file."""
    try:
        import mujoco
    except ImportError:
        raise UrdfError(
            f"'{path}' is an MJCF file, which MuJoCo reads; install it: pip install mujoco"
        ) from None
    # Else MuJoCo writes MUJOCO_LOG.TXT into the working folder.
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except Exception as error:  # MuJoCo raises several types
        raise UrdfError(
            f"MuJoCo cannot parse '{path}' ({_line(error)}); correct the file"
        ) from None
    name = spec.modelname or path.stem
    try:
        model = spec.compile()
    except Exception as error:
        finding = Finding(
            ERROR, "structure", "the file", f"MuJoCo rejects it ({_line(error)})", _COMPILES
        )
        note = "inertias that MuJoCo infers from geoms are unknown: only written ones are read"
        links = {b.name or f"body {b.id}": _written(b, mujoco) for b in spec.bodies[1:]}
        links, unread = _readable(links)
        joints = tuple(_spec_joint(j, mujoco) for j in spec.joints)
        return Model(name, "MJCF", links, joints, (finding, *unread), (note,))
    links, all_joints = _compiled(model, mujoco)
    links, unread = _readable(links)
    return Model(name, "MJCF", links, all_joints, unread)


def _readable(links: dict[str, Link]) -> tuple[dict[str, Link], tuple[Finding, ...]]:
    """Links without the bodies whose numbers are out of range, and findings about these."""
    kept, findings = {}, []
    for name, link in links.items():
        kept[name], body = link, link.body
        if body is None:
            continue
        sizes = np.abs([body.mass, *body.com, *body.inertia.ravel()])
        if not (sizes < HUGE).all() or 0 < abs(body.mass) < SPECK:
            kept[name] = Link(name)
            observed = f"a mass of {body.mass:g} kg, an inertia up to {sizes[4:].max():g} kg·m²"
            wanted = f"expected masses from {SPECK:g} kg up and numbers below {HUGE:g}"
            findings.append(Finding(ERROR, "unreadable", f"link '{name}'", observed, wanted))
    return kept, tuple(findings)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


def _compiled(model: Any, mujoco: Any) -> tuple[dict[str, Link], tuple[Joint, ...]]:
    links, joints = {}, []
    names = [model.body(k).name or f"body {k}" for k in range(model.nbody)]
    for k in range(1, model.nbody):
        rotation = _rotation(model.body_iquat[k], mujoco)
        tensor = rotation @ np.diag(model.body_inertia[k]) @ rotation.T
        body = Body(float(model.body_mass[k]), model.body_ipos[k].copy(), (tensor + tensor.T) / 2)
        links[names[k]] = Link(names[k], None if body.is_empty else body)
        parent = names[model.body_parentid[k]]
        first, count = model.body_jntadr[k], model.body_jntnum[k]
        if count == 0:
            turned = _rotation(model.body_quat[k], mujoco)
            fixed = _joint(f"{names[k]} (fixed)", "fixed", parent, names[k], model.body_pos[k])
            joints.append(replace(fixed, rotation=turned))
        for j in range(first, first + count):
            dof, kind = model.jnt_dofadr[j], _kind(model.jnt_type[j], mujoco)
            limited = bool(model.jnt_limited[j])
            turns = kind == "revolute" and not limited
            joints.append(
                _joint(
                    model.joint(j).name or f"joint {j}",
                    "continuous" if turns else kind,
                    parent,
                    names[k],
                    model.body_pos[k],
                    model.jnt_axis[j],
                    limits=model.jnt_range[j] if limited else None,
                    damping=float(model.dof_damping[dof].min()),
                    friction=float(model.dof_frictionloss[dof]),
                )
            )
    return links, tuple(joints)


def _joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    offset: Any,
    axis: Any = (0.0, 0.0, 1.0),
    limits: Any = None,
    damping: float | None = None,
    friction: float | None = None,
) -> Joint:
    lower, upper = (None, None) if limits is None else map(float, limits)
    place = np.array(offset, dtype=float)
    return Joint(
        name,
        kind,
        parent,
        child,
        np.where(np.isfinite(place), place, 0.0),
        np.array(axis, dtype=float),
        lower=lower,
        upper=upper,
        damping=damping,
        friction=friction,
        has_effort=False,
    )


def _kind(code: int, mujoco: Any) -> str:
    kinds = mujoco.mjtJoint
    known = {int(kinds.mjJNT_HINGE): "revolute", int(kinds.mjJNT_SLIDE): "prismatic"}
    return known.get(int(code), "floating")


def _rotation(quaternion: Any, mujoco: Any) -> np.ndarray:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array(quaternion, dtype=float))
    return matrix.reshape(3, 3)


def _written(body: Any, mujoco: Any) -> Link:
    name = body.name or f"body {body.id}"
    if not body.explicitinertial:
        return Link(name)
    full = np.array(body.fullinertia, dtype=float)
    if np.isfinite(full).all():
        xx, yy, zz, xy, xz, yz = full
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        rotation = _rotation(body.iquat, mujoco)
        tensor = rotation @ np.diag(body.inertia) @ rotation.T
    com = np.array(body.ipos, dtype=float)
    return Link(name, Body(float(body.mass), np.where(np.isfinite(com), com, 0.0), tensor))


def _spec_joint(joint: Any, mujoco: Any) -> Joint:
    body = joint.parent
    kind = _kind(int(joint.type), mujoco)
    lower, upper = (float(x) for x in joint.range)
    limited = bool(joint.limited == mujoco.mjtLimited.mjLIMITED_TRUE) or lower != upper
    return _joint(
        joint.name or f"joint {joint.id}",
        "continuous" if kind == "revolute" and not limited else kind,
        body.parent.name or "world",
        body.name or f"body {body.id}",
        body.pos,
        joint.axis,
        limits=(lower, upper) if limited else None,
        damping=float(np.min(joint.damping)),
        friction=float(joint.frictionloss),
    )
