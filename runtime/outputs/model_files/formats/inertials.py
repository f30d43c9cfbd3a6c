"""inertials.yaml of franka_description: one inertial per link.

link1: {origin: {xyz: x y z, rpy: 0 0 0}, mass: m, inertia: {xx: …, xy: …, …}}
"""

from runtime.outputs.model_files.bodies import RigidBody, digits, row
from runtime.outputs.model_files.engines import pinocchio, yaml
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.urdf import urdf_text
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.reload_check import compare_reloaded, unchecked
from runtime.outputs.model_files.urdf_tree import link_keys, short_names


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


def check_friction(model: IdentifiedModel, text: str) -> str:
    """Reload a URDF into which the friction of the file was put."""
    urdf = yaml.urdf_with_friction(text, model.lib, urdf_text(model))
    if urdf is None:
        return unchecked(yaml.INSTALL)
    return compare_reloaded(model, pinocchio.reload(urdf, model.lib), pinocchio.INSTALL)


FRICTION = ExportFormat(
    "friction",
    "dynamics.yaml of franka_description, damping and dry friction per joint",
    "dynamics.yaml",
    friction_text,
    check_friction,
    holds_inertia=False,
)


def inertials_text(model: IdentifiedModel) -> str:
    """inertials.yaml with every link that has mass, in the order of the URDF."""
    bodies = {name: body for name, body in model.bodies.by_link.items() if body.mass > 0}
    ordered = {name: bodies[name] for name in model.tree.links if name in bodies}
    keys = link_keys(model.tree)
    blocks = [_inertial(keys[name], body) for name, body in ordered.items()]
    return yaml_comment(model.comment("Inertial parameters", *model.bodies.notes)) + "".join(blocks)


def check_inertials(model: IdentifiedModel, text: str) -> str:
    """Reload a URDF into which the inertials of the file were put."""
    urdf = yaml.urdf_with_inertials(text, model.lib, urdf_text(model))
    if urdf is None:
        return unchecked(yaml.INSTALL)
    return compare_reloaded(model, pinocchio.reload(urdf, model.lib), pinocchio.INSTALL)


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
    check_inertials,
)
