"""YAML files: inertials.yaml and dynamics.yaml of franka_description, actuators.yaml of Isaac Lab.

inertials.yaml has one inertial per link, link1: {origin: {xyz: x y z, rpy: 0 0 0}, mass: m,
inertia: {xx: …, xy: …, …}}. The group under `actuators` of actuators.yaml has the keys of
`isaaclab.actuators.ActuatorBaseCfg`, each a table from joint to value: stiffness, damping,
armature, friction, dynamic_friction, viscous_friction. `delay` [s], `encoder_bias` [rad, m]
(q_true = q + b), `offset` [N·m, N] and `sigma` stand beside it; a DelayedPDActuatorCfg takes the
delay as a number of physics steps. Source: Isaac Lab documentation, isaaclab.actuators.

A file is the text of nested tables, which PyYAML must read back; the URDF of the same bodies and
friction is read by pinocchio.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from runtime.errors import ExportError
from runtime.outputs.model_files.engines import pinocchio, yaml
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.urdf import urdf_text
from runtime.outputs.model_files.joint_friction import KEYS, Values
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.reload_check import compare_reloaded, reloaded_fault, unchecked
from runtime.outputs.model_files.urdf_tree import digits, link_keys, quoted, row, short_names

Tables = dict[str, Any]  # nested tables of numbers, texts, lists of texts and None
Content = Callable[[IdentifiedModel], tuple[tuple[str, ...], Tables]]  # comments, tables of a file


def text_of(content: Content, model: IdentifiedModel) -> str:
    """Text of a YAML file."""
    comment, tables = content(model)
    return "\n".join([*(f"# {line}" for line in comment), *_lines(tables, ""), ""])


def _lines(tables: Tables, space: str) -> Iterator[str]:
    for key, value in tables.items():
        if isinstance(value, dict):
            yield f"{space}{key}:"
            yield from _lines(value, f"{space}  ")
        else:
            yield f"{space}{key}: {_scalar(value)}"


def _scalar(value: Any) -> str:
    """A value as YAML 1.1 reads it: 1e-05 would be a text, 1.0e-05 is a number."""
    if isinstance(value, float):
        text = digits(value)
        return text if "." in text else text.replace("e", ".0e")
    if isinstance(value, list):
        return f"[{', '.join(map(quoted, value))}]"
    return "null" if value is None else str(value)


def check(content: Content, in_urdf: bool, model: IdentifiedModel, text: str) -> str:
    """Read a file again: its tables must be those that were written.

    in_urdf: whether a URDF holds the same numbers, which pinocchio then reads, too.
    """
    read, (_, written) = yaml.tables_of(text), content(model)
    if read is None:
        return unchecked(yaml.INSTALL)
    wrong = [key for key in {**written, **read} if read.get(key) != written.get(key)]
    if wrong:
        what = f"the entry '{wrong[0]}' is not the one that was written"
        raise reloaded_fault("PyYAML", what)
    if in_urdf:
        return compare_reloaded(pinocchio, model, urdf_text(model))
    return "verified: read again by PyYAML, all numbers are equal"


def friction(model: IdentifiedModel) -> tuple[tuple[str, ...], Tables]:
    """Damping and dry friction of every joint, 0 where none is known."""
    keys = short_names(model.lib.joint_names)
    damping, dry = (model.friction.filled(key).tolist() for key in ("damping", "friction"))
    units = "damping in N m s/rad or N s/m, friction in N m or N; 0 where none was identified"
    return model.comment("Joint friction", *model.friction.notes, units), {
        keys[name]: {"dynamic": {"damping": d, "friction": f}}
        for name, d, f in zip(model.lib.joint_names, damping, dry, strict=True)
    }


def inertials(model: IdentifiedModel) -> tuple[tuple[str, ...], Tables]:
    """Every link that has mass, in the order of the URDF."""
    keys, bodies = link_keys(model.tree), model.bodies.by_link
    return model.comment("Inertial parameters", *model.bodies.notes), {
        keys[name]: {
            "origin": {"xyz": row(bodies[name].com), "rpy": "0 0 0"},
            "mass": bodies[name].mass,
            "inertia": bodies[name].entries(),
        }
        for name in model.tree.links
        if name in bodies and bodies[name].mass > 0
    }


_OF_CONFIG = {  # key of Isaac Lab → key of a drive
    "armature": "armature",
    "friction": "coulomb",
    "dynamic_friction": "coulomb",
    "viscous_friction": "viscous",
}


def actuators(model: IdentifiedModel) -> tuple[tuple[str, ...], Tables]:
    """Drives of the joints."""
    drives = model.drives
    if drives is None:
        raise ExportError(
            "not written: the result has no drives; identify it with --delay auto, or from a log "
            "whose torque is commanded"
        )

    def by_joint(values: dict[str, Values]) -> Tables:
        return {key: dict(zip(drives.joints, each, strict=True)) for key, each in values.items()}

    group = {"stiffness": drives.kp, "damping": drives.kd}
    group |= {key: drives.values[name] for key, name in _OF_CONFIG.items()}
    known = {key: each for key, each in group.items() if any(value is not None for value in each)}
    beside = {"delay": drives.delay} | {k: drives.values[k] for k in ("encoder_bias", "offset")}
    sigma = {key: drives.sigma[key] for key in KEYS} | {"delay": drives.delay_sigma}
    lines = model.comment(
        "Drives",
        "SI units at the joint; null where the motion does not determine a value.",
        "The torque of the law kp (q_des - q) + kd (dq_des - dq) acts `delay` later.",
        "friction and dynamic_friction are the Coulomb friction; q_true = q + encoder_bias.",
    )
    joints = {"joint_names_expr": list(drives.joints)} | by_joint(known)
    tables = {"actuators": {"joints": joints}, **by_joint(beside), "sigma": by_joint(sigma)}
    return lines, tables


FRICTION = ExportFormat(
    "friction",
    "dynamics.yaml of franka_description, damping and dry friction per joint",
    "dynamics.yaml",
    partial(text_of, friction),
    partial(check, friction, True),
    holds_inertia=False,
)
INERTIALS = ExportFormat(
    "inertials",
    "inertials.yaml of franka_description, one inertial per link",
    "inertials.yaml",
    partial(text_of, inertials),
    partial(check, inertials, True),
)
ACTUATORS = ExportFormat(
    "actuators",
    "actuators.yaml with gains, armature, friction, delay, encoder bias and their standard "
    "deviations per joint, for Isaac Lab",
    "actuators.yaml",
    partial(text_of, actuators),
    partial(check, actuators, False),
    holds_inertia=False,
)
