"""Functions for CasADi with identified π: a serialised file, and C with CasADi's own ABI.

Inverse and forward dynamics, mass matrix, bias forces, gravity and end effector without friction,
`friction` and `torque` of rigid bodies, rotors and friction. They are written and read again by a
process of symgen.
"""

from collections.abc import Mapping
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from runtime.common.child import ExceededError, Limits, answer_of
from runtime.errors import ExportError
from runtime.outputs.model_files.engines.answer import random_states
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.header import comment_text
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.reload_check import require_torques, verified
from runtime.recording.friction import model as friction
from runtime.recording.friction.columns import ROTOR
from runtime.recording.settings import JointMotion

OF_SPEED = ("viscous", "coulomb", "offset", "asymmetric", "stribeck")
"""Friction columns that the functions have, beside the inertia of rotors."""
WRITER = "symgen.make.casadi_files"
LIMITS = Limits(seconds=600, patience=900.0, memory=8 * 2**30, file=2**28)  # 30 joints take 1 min


def casadi_texts(model: IdentifiedModel) -> dict[str, str]:
    """Both files by name."""
    joints = model.friction
    terms, phi = joints.terms, joints.values
    kept = [name for name in terms.columns if name in OF_SPEED]
    left_out = [name for name in terms.columns if name not in (*OF_SPEED, ROTOR.name)]
    note = f"Friction columns left out: {', '.join(left_out) or 'none'}."
    lines = "".join(f" * {comment_text(line)}\n" for line in model.comment("Functions", note))
    columns = {} if phi is None else {n: phi[:, terms.columns.index(n)].tolist() for n in kept}
    widths = {"coulomb_speed": terms.coulomb_speed, "stribeck_speed": terms.stribeck_speed}
    job = {
        "folder": str(model.lib.folder),
        "pi": model.pi.tolist(),
        "armature": joints.filled("armature").tolist(),
        "friction": columns,
        "widths": widths,
        "head": f"/*\n{lines} */\n",
    }
    if find_spec("casadi") is None or find_spec("symgen") is None:
        raise ExportError(
            "not written: expected CasADi, found none; run: pip install 'symgen[build]'"
        )
    try:
        texts: dict[str, str] = answer_of(WRITER, job, LIMITS)
    except ExceededError as error:
        raise ExportError(f"not written: the functions take more than {error}") from None
    if "error" in texts:
        raise ExportError(f"not written: {texts['error']}")
    return texts


def check_casadi(model: IdentifiedModel, texts: Mapping[str, str]) -> str:
    """Read the serialised file; `torque` must be that of the library and its friction columns."""
    lib, joints = model.lib, model.friction
    q, dq, ddq = random_states(lib, model.states)
    text, motion = texts[f"{lib.name}_identified.casadi"], [x.T.tolist() for x in (q, dq, ddq)]
    read = np.transpose(answer_of(WRITER, {"text": text, "motion": motion}, LIMITS)["tau"])
    expected = lib.inverse_dynamics(q, dq, ddq, model.pi) + joints.filled("armature") * ddq
    kept = [k for k, name in enumerate(joints.terms.columns) if name in OF_SPEED]
    if joints.values is not None and kept:
        terms = replace(joints.terms, columns=tuple(joints.terms.columns[k] for k in kept))
        columns = friction.columns(JointMotion(dq), terms)
        expected = expected + friction.torque(columns, joints.values[:, kept])
    what, remedy = "the torques of the functions differ", "report this as a fault of symgen"
    difference = require_torques(read, expected, what, remedy)
    return verified("CasADi", difference, model.states)


CASADI = ExportFormat(
    "casadi",
    "functions for CasADi and acados with π fixed: serialised, and C with CasADi's ABI; on request",
    "{robot}_casadi",
    casadi_texts,
    check_casadi,
    is_folder=True,
    on_request=True,
)
