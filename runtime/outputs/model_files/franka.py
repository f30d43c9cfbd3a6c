"""The YAML of franka_description: inertials per link, damping and friction per joint.

    link1: {origin: {xyz: x y z, rpy: 0 0 0}, mass: m, inertia: {xx: …, xy: …, …}}
    joint1: {dynamic: {damping: d, friction: f}}

Keys are names of the URDF less the prefix that they share (fr3_link1 → link1), as its xacro
expects. Numbers carry a decimal point, without which YAML 1.1 takes 1e-05 for text.
"""

from collections.abc import Iterable
from itertools import takewhile

from runtime.outputs.model_files.bodies import Body, digits, row
from runtime.outputs.model_files.model import Model
from runtime.outputs.model_files.urdf_tree import Tree


def inertials_text(model: Model) -> str:
    """inertials.yaml: every link that has mass."""
    bodies = {name: body for name, body in model.split.bodies.items() if body.mass > 0}
    ordered = {name: bodies[name] for name in model.tree.links if name in bodies}
    keys = link_keys(model.tree)
    blocks = [_inertial(keys[name], body) for name, body in ordered.items()]
    return _comment(model.comment("Inertial parameters", *model.split.notes)) + "".join(blocks)


def dynamics_text(model: Model) -> str:
    """dynamics.yaml: damping and dry friction of every joint, 0 where none is known."""
    keys = short_names(model.lib.joint_names)
    damping, friction = (model.drive.filled(key) for key in ("damping", "friction"))
    blocks = [
        f"{keys[name]}:\n  dynamic:\n    damping: {_float(d)}\n    friction: {_float(f)}\n"
        for name, d, f in zip(model.lib.joint_names, damping, friction, strict=True)
    ]
    units = "damping in N m s/rad or N s/m, friction in N m or N; 0 where none was identified"
    return _comment(model.comment("Joint friction", *model.drive.notes, units)) + "".join(blocks)


def link_keys(tree: Tree) -> dict[str, str]:
    """Keys of the links that have an inertial in the URDF or move."""
    return short_names(
        name for name in tree.links if name in tree.moving or tree.published(name) is not None
    )


def short_names(names: Iterable[str]) -> dict[str, str]:
    """Each name without the prefix up to the last underscore that all of them share."""
    listed = list(names)
    letters = takewhile(lambda each: len(set(each)) == 1, zip(*listed, strict=False))
    shared = "".join(each[0] for each in letters)
    cut = shared.rfind("_") + 1 if len(listed) > 1 else 0
    return {name: name[cut:] for name in listed}


def _inertial(key: str, body: Body) -> str:
    entries = "".join(f"    {name}: {_float(value)}\n" for name, value in body.entries().items())
    return (
        f"{key}:\n  origin:\n    xyz: {row(body.com)}\n    rpy: 0 0 0\n"
        f"  mass: {_float(body.mass)}\n  inertia:\n{entries}"
    )


def _float(value: float) -> str:
    text = digits(value)
    return text if "." in text else text.replace("e", ".0e")


def _comment(lines: tuple[str, ...]) -> str:
    return "".join(f"# {line}\n" for line in lines)
