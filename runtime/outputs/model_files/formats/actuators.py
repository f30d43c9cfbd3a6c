"""actuators.yaml: drives of all joints in the layout of Isaac Lab's actuator configurations.

The group under `actuators` has the keys of `isaaclab.actuators.ActuatorBaseCfg`, each a table from
joint to value: stiffness, damping, armature, friction, dynamic_friction, viscous_friction.
`delay` [s], `encoder_bias` [rad, m] (q_true = q + b), `offset` [N·m, N] and `sigma` stand beside
it; a DelayedPDActuatorCfg takes the delay as a number of physics steps.
Source: Isaac Lab documentation, isaaclab.actuators.
"""

import numpy as np

from runtime.errors import ExportError
from runtime.outputs.model_files.drives import Drives
from runtime.outputs.model_files.engines import yaml
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.inertials import yaml_comment, yaml_number
from runtime.outputs.model_files.joint_friction import Values
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.reload_check import unchecked

_OF_CONFIG = {
    "armature": "armature",
    "friction": "coulomb",
    "dynamic_friction": "coulomb",
    "viscous_friction": "viscous",
}
"""Key of Isaac Lab → key of a drive."""
_SIGMA = ("armature", "viscous", "coulomb", "offset", "encoder_bias")


def actuators_text(model: IdentifiedModel) -> str:
    """actuators.yaml of the drives."""
    drives = model.drives
    if drives is None:
        raise ExportError(
            "not written: the result has no drives; identify it with --delay auto, or from a log "
            "whose torque is commanded"
        )
    lines = model.comment(
        "Drives",
        "SI units at the joint; null where the motion does not determine a value.",
        "The torque of the law kp (q_des - q) + kd (dq_des - dq) acts `delay` later.",
        "friction and dynamic_friction are the Coulomb friction; q_true = q + encoder_bias.",
    )
    group = {"stiffness": drives.kp, "damping": drives.kd}
    group |= {key: drives.values[name] for key, name in _OF_CONFIG.items()}
    names = ", ".join(f'"{joint}"' for joint in drives.joints)
    text = ["actuators:", "  joints:", f"    joint_names_expr: [{names}]"]
    for key, values in group.items():
        if any(value is not None for value in values):
            text += _table(key, drives, values, 4)
    text += _table("delay", drives, drives.delay, 0)
    text += _table("encoder_bias", drives, drives.values["encoder_bias"], 0)
    text += _table("offset", drives, drives.values["offset"], 0)
    text += ["sigma:"]
    for key in _SIGMA:
        text += _table(key, drives, drives.sigma[key], 2)
    text += _table("delay", drives, drives.delay_sigma, 2)
    return yaml_comment(lines) + "\n".join(text) + "\n"


def check_actuators(model: IdentifiedModel, text: str) -> str:
    """Read actuators.yaml again and compare every number."""
    tables = yaml.tables_of(text)
    if tables is None:
        return unchecked(yaml.INSTALL)
    drives = model.drives
    assert drives is not None  # noqa: S101  `actuators_text` has written them
    pairs = [
        (tables["actuators"]["joints"]["armature"], drives.values["armature"]),
        (tables["actuators"]["joints"]["viscous_friction"], drives.values["viscous"]),
        (tables["delay"], drives.delay),
        (tables["sigma"]["armature"], drives.sigma["armature"]),
    ]
    for read, written in pairs:
        got = [np.nan if read[name] is None else read[name] for name in drives.joints]
        wanted = [np.nan if value is None else value for value in written]
        if not np.array_equal(got, wanted, equal_nan=True):
            raise ExportError("not written: actuators.yaml reads back as other numbers")
    return "verified: read again by PyYAML, all numbers are equal"


def _table(key: str, drives: Drives, values: Values, indent: int) -> list[str]:
    """Lines of one table from joint to value."""
    space = " " * indent
    entries = [
        f"{space}  {joint}: {'null' if value is None else yaml_number(value)}"
        for joint, value in zip(drives.joints, values, strict=True)
    ]
    return [f"{space}{key}:", *entries]


ACTUATORS = ExportFormat(
    "actuators",
    "actuators.yaml with gains, armature, friction, delay, encoder bias and their standard "
    "deviations per joint, for Isaac Lab",
    "actuators.yaml",
    actuators_text,
    check_actuators,
    holds_inertia=False,
)
