"""The URDF of the kernels with identified inertials and joint friction; all else is unchanged."""

from runtime.outputs.model_files.engines import pinocchio
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.model import IdentifiedModel, xml_comment
from runtime.outputs.model_files.reload_check import compare_reloaded
from runtime.outputs.model_files.urdf_edit import document_text, set_friction, set_inertial
from runtime.outputs.model_files.urdf_tree import Tree, number, read_tree


def urdf_text(model: IdentifiedModel) -> str:
    """URDF with m, c and I_com of every moving link, and joint friction where it is known."""
    tree = read_tree(model.lib)
    for link in model.bodies.emptied:
        set_inertial(tree, link, None)
    for link in model.lib.link_names:
        set_inertial(tree, link, model.bodies.by_link[link])
    for k, joint in enumerate(model.lib.joint_names):
        set_friction(tree, joint, model.friction.damping[k], model.friction.friction[k])
    return document_text(tree, xml_comment(model.robot_comment(*_remove_driving_friction(tree))))


def check_urdf(model: IdentifiedModel, text: str) -> str:
    """Reload a URDF by pinocchio."""
    return compare_reloaded(
        model, pinocchio.reload(text, model.lib, model.states), pinocchio.INSTALL
    )


def _remove_driving_friction(tree: Tree) -> list[str]:
    """Remove published friction below zero, which would drive the joint; one note per value."""
    removed = []
    for joint in tree.root.findall("joint"):
        for node in joint.findall("dynamics"):
            for key, text in list(node.attrib.items()):
                if key in {"damping", "friction"} and number(text, key) < 0:
                    del node.attrib[key]
                    removed.append(
                        f"The published {key} of {joint.get('name')}, {text}, is negative and "
                        "was removed."
                    )
    return removed


URDF = ExportFormat(
    "urdf",
    "URDF with inertials and joint friction, for pinocchio, ROS, PyBullet and Drake",
    "{robot}.urdf",
    urdf_text,
    check_urdf,
)
