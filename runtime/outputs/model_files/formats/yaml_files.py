"""YAML files: inertials.yaml and dynamics.yaml of franka_description, actuators.yaml of Isaac Lab.

inertials.yaml has one inertial per link, link1: {origin: {xyz: x y z, rpy: 0 0 0}, mass: m,
inertia: {xx: …, xy: …, …}}. The group under `actuators` of actuators.yaml has the keys of
`isaaclab.actuators.ActuatorBaseCfg`, each a table from joint to value: stiffness, damping,
armature, friction, dynamic_friction, viscous_friction. `delay` [s], `encoder_bias` [rad, m]
(q_true = q + b), `offset` [N·m, N] and `sigma` stand beside it; a DelayedPDActuatorCfg takes the
delay as a number of physics steps. Source: Isaac Lab documentation, isaaclab.actuators.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from runtime.errors import ExportError
from runtime.library import Library
from runtime.outputs.model_files.engines import pinocchio, yaml
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.urdf import urdf_text
from runtime.outputs.model_files.joint_friction import KEYS, Drives, Values
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.reload_check import compare_reloaded, unchecked
from runtime.outputs.model_files.urdf_tree import RigidBody, digits, link_keys, row, short_names


def yaml_number(value: float) -> str:
    """Shortest text of a number that YAML 1.1 reads as a number."""
    text = digits(value)
    return text if "." in text else text.replace("e", ".0e")


def yaml_comment(lines: tuple[str, ...]) -> str:
    """Comment lines at the head of a YAML file."""
    return "".join(f"# {line}\n" for line in lines)


def friction_text(model: IdentifiedModel) -> str:
    """dynamics.yaml with damping and dry friction of every joint, 0 where none is known."""
    keys = short_names(model.lib.joint_names)
    damping, friction = (model.friction.filled(key) for key in ("damping", "friction"))
    blocks = [
        f"{keys[name]}:\n  dynamic:\n    damping: {yaml_number(d)}\n    friction: "
        f"{yaml_number(f)}\n"
        for name, d, f in zip(model.lib.joint_names, damping, friction, strict=True)
    ]
    units = "damping in N m s/rad or N s/m, friction in N m or N; 0 where none was identified"
    lines = model.comment("Joint friction", *model.friction.notes, units)
    return yaml_comment(lines) + "".join(blocks)


def check_in_urdf(
    put: Callable[[str, Library, str], str | None], model: IdentifiedModel, text: str
) -> str:
    """Reload a URDF into which the numbers of the file were put."""
    urdf = put(text, model.lib, urdf_text(model))
    if urdf is None:
        return unchecked(yaml.INSTALL)
    return compare_reloaded(pinocchio, model, urdf)


FRICTION = ExportFormat(
    "friction",
    "dynamics.yaml of franka_description, damping and dry friction per joint",
    "dynamics.yaml",
    friction_text,
    partial(check_in_urdf, yaml.urdf_with_friction),
    holds_inertia=False,
)


def inertials_text(model: IdentifiedModel) -> str:
    """inertials.yaml with every link that has mass, in the order of the URDF."""
    bodies = {name: body for name, body in model.bodies.by_link.items() if body.mass > 0}
    ordered = {name: bodies[name] for name in model.tree.links if name in bodies}
    keys = link_keys(model.tree)
    blocks = [_inertial(keys[name], body) for name, body in ordered.items()]
    return yaml_comment(model.comment("Inertial parameters", *model.bodies.notes)) + "".join(blocks)


def _inertial(key: str, body: RigidBody) -> str:
    entries = "".join(
        f"    {name}: {yaml_number(value)}\n" for name, value in body.entries().items()
    )
    return (
        f"{key}:\n  origin:\n    xyz: {row(body.com)}\n    rpy: 0 0 0\n"
        f"  mass: {yaml_number(body.mass)}\n  inertia:\n{entries}"
    )


INERTIALS = ExportFormat(
    "inertials",
    "inertials.yaml of franka_description, one inertial per link",
    "inertials.yaml",
    inertials_text,
    partial(check_in_urdf, yaml.urdf_with_inertials),
)


_OF_CONFIG = {
    "armature": "armature",
    "friction": "coulomb",
    "dynamic_friction": "coulomb",
    "viscous_friction": "viscous",
}
"""Key of Isaac Lab → key of a drive."""


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
    for key in KEYS:
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
