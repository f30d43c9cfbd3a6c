"""Identified parameters → model files: written, read by their engine, compared, then kept.

The same texts become models of Pinocchio and MuJoCo in memory. Pinocchio's URDF has no rotor
inertia and requires limits: both are set in the model.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.common.files import require_unused
from runtime.errors import ExportError, NotRealisableError
from runtime.identification.result_file import AnyResult, opened
from runtime.library import Library
from runtime.outputs.model_files.engines import mujoco, pinocchio
from runtime.outputs.model_files.engines.answer import Unreadable
from runtime.outputs.model_files.export_format import (
    EXPORT_FORMATS,
    ExportFormat,
    require_base,
    save,
    usual_formats,
)
from runtime.outputs.model_files.joint_friction import Drives, drives_of
from runtime.outputs.model_files.model import IdentifiedModel, make_model, require_consistent
from runtime.recording import Friction


@dataclass(frozen=True, slots=True)
class Exported:
    """Outcome of one format."""

    kind: str  # name of the format
    path: Path | None  # file or folder that was written; None where it was refused
    sentence: str  # how the file was verified, or why it was refused
    # whether the file was refused because the model lacks what only this format holds, see
    # `ExportFormat.holds_inertia`
    is_optional: bool = False


def write_urdf(
    lib: Library,
    pi: ArrayLike,
    path: str | os.PathLike[str],
    terms: Friction | None = None,
    phi: ArrayLike | None = None,
) -> str:
    """Write the identified URDF, which reloads to the same torques; else an old file stays."""
    return write_model(make_model(lib, pi, terms, phi), EXPORT_FORMATS["urdf"], Path(path))


def export_model(
    lib: Library,
    pi: ArrayLike,
    kinds: Sequence[str],
    folder: Path,
    *,
    terms: Friction | None = None,
    phi: ArrayLike | None = None,
    drives: Drives | None = None,
    overwrite: bool = False,
) -> list[Exported]:
    """Write some of `EXPORT_FORMATS` into a folder, each one if its check passes."""
    paths = {kind: folder / EXPORT_FORMATS[kind].file.format(robot=lib.name) for kind in kinds}
    require_unused(paths.values(), overwrite)
    done = []
    for kind, path in paths.items():
        chosen = EXPORT_FORMATS[kind]
        try:
            require_base(lib, chosen)
            # Joint friction does not depend on whether the identified links are consistent.
            shown = pi if chosen.holds_inertia else lib.pi0
            model = make_model(lib, shown, terms, phi, drives=drives)
            done.append(Exported(kind, path, write_model(model, chosen, path)))
        except ExportError as error:
            is_optional = not chosen.holds_inertia or lib.manifest.floating
            done.append(Exported(kind, None, str(error), is_optional))
    return done


def write_model(model: IdentifiedModel, chosen: ExportFormat, path: Path) -> str:
    """Write one file or folder, checked before; return the sentence of the check."""
    require_consistent(model)
    if not chosen.holds_inertia and not model.friction.is_known:
        raise ExportError(
            "not written: the result has no viscous or dry friction; identify it with "
            "--friction viscous,coulomb"
        )
    text, verdict = _reloaded(model, chosen)
    save(path, text)
    return verdict


def _reloaded(model: IdentifiedModel, chosen: ExportFormat) -> tuple[Any, str]:
    """What a format writes, and the sentence of its check."""
    try:
        text = chosen.write(model)
        return text, chosen.check(model, text)
    except (Unreadable, NotRealisableError) as error:
        raise ExportError(f"not written: cannot reload the {chosen.name} ({error})") from None


STATES = 20  # random states at which the model is compared with the library
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
        return _reloaded(model, chosen)[0], model
    except ExportError as error:
        raise ExportError(str(error).removeprefix("not written: ")) from None
