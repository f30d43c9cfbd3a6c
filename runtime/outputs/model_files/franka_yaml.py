"""Keys, numbers and comments of the YAML files of franka_description.

Keys are names of the URDF without their common prefix (fr3_link1 → link1), as its xacro expects.
Numbers carry a decimal point, because YAML 1.1 reads 1e-05 as text.
"""

from collections.abc import Iterable
from itertools import takewhile

from runtime.outputs.model_files.bodies import digits
from runtime.outputs.model_files.urdf_tree import Tree


def link_keys(tree: Tree) -> dict[str, str]:
    """Keys of the links that move or have an inertial in the URDF, by link name."""
    return short_names(
        name for name in tree.links if name in tree.moving or tree.published(name) is not None
    )


def short_names(names: Iterable[str]) -> dict[str, str]:
    """Each name without the common prefix that ends at the last shared underscore."""
    listed = list(names)
    letters = takewhile(lambda each: len(set(each)) == 1, zip(*listed, strict=False))
    shared = "".join(each[0] for each in letters)
    cut = shared.rfind("_") + 1 if len(listed) > 1 else 0
    return {name: name[cut:] for name in listed}


def yaml_number(value: float) -> str:
    """Shortest text of a number that YAML 1.1 reads as a number."""
    text = digits(value)
    return text if "." in text else text.replace("e", ".0e")


def yaml_comment(lines: tuple[str, ...]) -> str:
    """Comment lines at the head of a YAML file."""
    return "".join(f"# {line}\n" for line in lines)
