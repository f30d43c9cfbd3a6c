"""Process that compiles one MJCF file with MuJoCo: a job of `compiled_mjcf`, an answer as JSON.

The compiled model is written as MuJoCo's binary file. Where MuJoCo rejects the file, the bodies and
joints as written are the answer, for `inspect`.

Mesh files that are missing matter only where MuJoCo infers inertias from them. Where every body
that moves states its own, the geoms, which no rigid-body equation needs, are left out.
"""

from typing import Any

import mujoco
import numpy as np

from runtime.common.child import serve  # and nothing of symgen: it would load pinocchio

_MISSING = "Error opening file"


def _compile(job: dict[str, Any]) -> dict[str, Any]:
    mujoco.set_mju_user_warning(lambda _: None)  # else it writes MUJOCO_LOG.TXT
    try:
        spec = mujoco.MjSpec.from_file(job["path"])
    except Exception as error:  # MuJoCo raises several types
        return {"unparsed": _line(error)}
    answer: dict[str, Any] = {"name": spec.modelname, "notes": []}
    try:
        try:
            model = spec.compile()
        except ValueError as error:
            if _MISSING not in str(error) or not _states_inertials(spec):
                raise
            _drop_geoms(spec)
            model = spec.compile()
            answer["notes"].append(
                f"{_line(error).removeprefix('Error: ')}: geoms are left out, and the inertials "
                "are those that the file states"
            )
    except Exception as error:
        return answer | {
            "reason": _line(error),
            "bodies": [_body(body) for body in spec.bodies[1:]],
            "joints": [_joint(joint) for joint in spec.joints],
        }
    mujoco.mj_saveModel(model, job["out"], None)
    return answer


def _states_inertials(spec: Any) -> bool:
    """Whether no body needs its geoms for its inertia."""
    if int(spec.compiler.inertiafromgeom) == int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE):
        return False
    return all(body.explicitinertial or not list(body.geoms) for body in spec.bodies[1:])


def _drop_geoms(spec: Any) -> None:
    """Delete everything that names files or geoms."""
    kinds = "sensors pairs skins geoms meshes hfields materials textures"
    for kind in kinds.split():
        for element in list(getattr(spec, kind)):
            spec.delete(element)


def _body(body: Any) -> dict[str, Any]:
    """Name and written inertial of a body."""
    answer: dict[str, Any] = {"name": body.name or f"body {body.id}", "mass": None}
    if not body.explicitinertial:
        return answer
    full = np.array(body.fullinertia, dtype=float)
    if np.isfinite(full).all():
        xx, yy, zz, xy, xz, yz = full
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, np.array(body.iquat, dtype=float))
        rotation = turn.reshape(3, 3)
        tensor = rotation @ np.diag(body.inertia) @ rotation.T
    com = np.array(body.ipos, dtype=float)
    com = np.where(np.isfinite(com), com, 0.0)
    return answer | {"mass": float(body.mass), "com": com.tolist(), "inertia": tensor.tolist()}


def _joint(joint: Any) -> dict[str, Any]:
    """Joint as written."""
    body = joint.parent
    lower, upper = (float(x) for x in joint.range)
    limited = bool(joint.limited == mujoco.mjtLimited.mjLIMITED_TRUE) or lower != upper
    return {
        "name": joint.name or f"joint {joint.id}",
        "kind": int(joint.type),
        "parent": body.parent.name or "world",
        "child": body.name or f"body {body.id}",
        "offset": np.array(body.pos, dtype=float).tolist(),
        "axis": np.array(joint.axis, dtype=float).tolist(),
        "limits": [lower, upper] if limited else None,
        "damping": float(np.min(joint.damping)),
        "friction": float(joint.frictionloss),
    }


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


if __name__ == "__main__":
    serve(_compile)
