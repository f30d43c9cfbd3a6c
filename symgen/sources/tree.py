"""The robot among the trees of a URDF: one of them has moving joints, or one is named.

Exporters leave links of a cell, a camera or a world without a joint to the robot. A URDF has one
tree; the others are left out and named.
"""

from collections.abc import Callable
from xml.etree.ElementTree import Element, tostring

from symgen.chain.document import MOVING, listing, parse
from symgen.errors import BuildError


def robot_tree(text: str, chosen: str | None, where: str, note: Callable[[str], None]) -> str:
    """Text of the URDF with the links of one tree; unchanged where there is one."""
    root = parse(text)
    links = {link.get("name", ""): link for link in root.findall("link")}
    joints = [(j, _end(j, "parent"), _end(j, "child")) for j in root.findall("joint")]
    children = {child for _, _, child in joints}
    tops = [name for name in links if name not in children]
    ends = {end for _, parent, child in joints for end in (parent, child)}
    if "" in links or not ends <= links.keys():
        return text  # `chain` says what is wrong
    if len(tops) < 2:
        if chosen is not None:
            raise BuildError(
                f"--model chooses among the robots of a file, and {where} has one; leave it out"
            )
        return text
    trees = {top: _reached(top, joints) for top in tops}
    moving = [
        top
        for top, reached in trees.items()
        if any(j.get("type") in MOVING and parent in reached for j, parent, _ in joints)
    ]
    if chosen is None and len(moving) > 1:
        raise BuildError(
            f"{where} has {len(moving)} robots that no joint connects; choose one by its root link "
            f"with --model: {listing(moving)}"
        )
    if chosen is not None and chosen not in trees:
        raise BuildError(
            f"--model names '{chosen}', which is not the root link of a robot of {where}; these "
            f"are {listing(moving)}"
        )
    if chosen is None and not moving:
        return text
    kept = trees[chosen or moving[0]]
    for name, link in links.items():
        if name not in kept:
            root.remove(link)
    for joint, parent, child in joints:
        if parent not in kept and child not in kept:
            root.remove(joint)
    others = [top for top in tops if top not in kept]
    note(f"links that no joint connects to the robot are left out: {listing(others)}")
    return tostring(root, "unicode") + "\n"


def _end(joint: Element, which: str) -> str:
    node = joint.find(which)
    return "" if node is None else node.get("link", "")


def _reached(top: str, joints: list[tuple[Element, str, str]]) -> set[str]:
    reached, pending = {top}, [top]
    while pending:
        link = pending.pop()
        fresh = [child for _, parent, child in joints if parent == link and child not in reached]
        reached |= set(fresh)
        pending += fresh
    return reached
