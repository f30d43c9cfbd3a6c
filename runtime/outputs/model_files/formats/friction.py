"""dynamics.yaml of franka_description: damping and dry friction of every joint.

joint1: {dynamic: {damping: d, friction: f}}
"""

from runtime.outputs.model_files.engines import pinocchio, yaml
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.urdf import urdf_text
from runtime.outputs.model_files.franka_yaml import short_names, yaml_comment, yaml_number
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.reload_check import compare_reloaded, unchecked


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
