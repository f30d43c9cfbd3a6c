"""A result of any kind → files, and models of Pinocchio and MuJoCo in memory of the same texts.

Pinocchio's URDF has no rotor inertia and requires limits: both are set in the model.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import ExportError
from runtime.identification.result_file import AnyResult, opened
from runtime.library import Library
from runtime.outputs.model_files.drives import drives_of
from runtime.outputs.model_files.engines import mujoco, pinocchio
from runtime.outputs.model_files.engines.answer import Unreadable
from runtime.outputs.model_files.export import Exported, export_model
from runtime.outputs.model_files.export_format import EXPORT_FORMATS, require_base, usual_formats
from runtime.outputs.model_files.model import IdentifiedModel, make_model, require_consistent

STATES = 20
"""Random states at which the model is compared with the library."""
MISSING = "expected {} to be installed, found none; run: {}"


def to_pinocchio(result: AnyResult, lib: Library | None = None) -> Any:
    """Identified model as a `pinocchio.Model`, compared with the library at 20 random states.

    `inertias[i]` is the link that joint i moves, together with every link that is fixed to it;
    links that are fixed to the base are in `inertias[0]`. Joints that follow others are joints of
    their own here, and closed loops are open. Friction without a counterpart is left out.

    Args:
        result: of `runtime.identify` or `runtime.read_result`, or a folder that identify wrote.
        lib: library of the robot; default that of the result.

    Returns:
        The model with gravity, `armature`, `damping`, dry `friction`, and the limits of position,
        velocity and effort, ±inf where there are none.

    Raises:
        IdentificationError: the argument is no result.
        RecordingError: the result cannot be read, or is of another robot.
        ExportError: a link that is not physically consistent, or no Pinocchio.
    """
    text, known = _checked(result, lib, "urdf")
    model = pinocchio.parsed(text, known.lib)
    if model is None:
        raise ExportError(MISSING.format("Pinocchio", pinocchio.INSTALL))
    facts = known.lib.manifest
    joints = {joint.name: joint for joint in (*facts.all_joints, *facts.joints)}
    armature = dict(zip(known.lib.joint_names, known.friction.filled("armature"), strict=True))
    for name in known.lib.all_joint_names:
        joint, place = joints[name], model.joints[model.getJointId(name)]
        model.armature[place.idx_v] = armature.get(name, 0.0)
        for kind, limit in (("Effort", joint.effort), ("Velocity", joint.velocity)):
            bound = np.inf if limit is None else limit
            getattr(model, f"{kind.lower()}Limit")[place.idx_v] = bound
            if hasattr(model, f"lower{kind}Limit"):  # since Pinocchio 4
                getattr(model, f"lower{kind}Limit")[place.idx_v] = -bound
        if place.nq == 1:  # the two coordinates of a continuous joint are cos q and sin q
            model.lowerPositionLimit[place.idx_q] = -np.inf if joint.lower is None else joint.lower
            model.upperPositionLimit[place.idx_q] = np.inf if joint.upper is None else joint.upper
    return model


def to_mujoco(result: AnyResult, lib: Library | None = None) -> Any:
    """Identified model as a `mujoco.MjSpec`, compared with the library at 20 random states.

    Bodies are the links, fixed ones included, with the inertials of `export --to mjcf`: a fixed
    link keeps its published inertial, and the moving link gets the identified one less that.
    Friction without a counterpart is left out.

    Args:
        result: of `runtime.identify` or `runtime.read_result`, or a folder that identify wrote.
        lib: library of the robot; default that of the result.

    Returns:
        The specification, to be compiled or attached to another: joints with ranges, `armature`,
        `damping` and `frictionloss`; motors within the efforts, or position actuators where the
        gains of the control law were identified; equalities of coupled joints and closed loops.

    Raises:
        IdentificationError: the argument is no result.
        RecordingError: the result cannot be read, or is of another robot.
        ExportError: a link that is not physically consistent, a free base, or no MuJoCo.
    """
    specification = mujoco.parsed(_checked(result, lib, "mjcf")[0])
    if specification is None:
        raise ExportError(MISSING.format("MuJoCo", mujoco.INSTALL))
    return specification


def export(
    result: AnyResult,
    folder: str | os.PathLike[str],
    to: str | Sequence[str] | None = None,
    lib: Library | None = None,
    *,
    overwrite: bool = False,
) -> list[Exported]:
    """Write an identified model to files of simulators and controllers, as the command does.

    Args:
        result: of `runtime.identify` or `runtime.read_result`, or a folder that identify wrote.
        folder: of the files, created where it is missing.
        to: formats of `symgen export --formats`, as a sequence or with commas; None is all
            that need no name.
        lib: library of the robot; None is that of the result.
        overwrite: replace existing files.

    Returns:
        Per format its name, its path (None where it was refused), and how it was checked.

    Raises:
        RuntimeFault: no result, an unknown format, another robot, or an existing file.
    """
    if not isinstance(folder, str | os.PathLike):
        raise ExportError(f"expected a folder for the files, got {folder!r:.60}")
    kinds = to.split(",") if isinstance(to, str) else usual_formats() if to is None else to
    saved, lib, _ = opened(result, lib, same_bodies=True)
    return export_model(
        lib,
        saved.pi,
        [each.strip() for each in kinds],
        Path(folder),
        terms=saved.friction,
        phi=saved.phi,
        drives=drives_of(saved.record),
        overwrite=overwrite,
    )


def _checked(result: AnyResult, lib: Library | None, kind: str) -> tuple[str, IdentifiedModel]:
    """Text of a format, reloaded and compared, and its model."""
    chosen = EXPORT_FORMATS[kind]
    try:
        saved, lib, _ = opened(result, lib, same_bodies=True)
        drives = drives_of(saved.record)
        terms, phi = saved.friction, saved.phi
        model = make_model(lib, saved.pi, terms, phi, states=STATES, drives=drives)
        require_base(model.lib, chosen)
        require_consistent(model)
        text = str(chosen.write(model))
        chosen.check(model, text)
    except Unreadable as error:
        raise ExportError(f"cannot reload the {kind} ({error})") from None
    except ExportError as error:
        raise ExportError(str(error).removeprefix("not written: ")) from None
    return text, model
