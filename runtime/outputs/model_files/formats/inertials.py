"""inertials.yaml of franka_description: one inertial per link.

link1: {origin: {xyz: x y z, rpy: 0 0 0}, mass: m, inertia: {xx: …, xy: …, …}}
"""

from runtime.outputs.model_files.bodies import RigidBody, row
from runtime.outputs.model_files.engines import pinocchio, yaml
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.urdf import urdf_text
from runtime.outputs.model_files.franka_yaml import link_keys, yaml_comment, yaml_number
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.reload_check import compare_reloaded, unchecked


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
