"""Elements of a URDF that readers of other formats write: joints, inertials, origins."""

from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio


def add_joint(
    robot: Element, name: str, kind: str, parent: str, child: str, at: Any, rotation: Any
) -> Element:
    """Joint without axis and limits."""
    joint = SubElement(robot, "joint", {"name": name, "type": kind})
    add_origin(joint, at, rotation)
    SubElement(joint, "parent", {"link": parent})
    SubElement(joint, "child", {"link": child})
    return joint


def add_origin(element: Element, at: Any, rotation: Any) -> None:
    """Placement of a joint or of an inertial."""
    rpy = pinocchio.rpy.matrixToRpy(rotation)
    SubElement(element, "origin", {"xyz": words(at), "rpy": words(rpy)})


def add_inertial(link: Element, mass: float, com: Any, inertia: np.ndarray) -> None:
    """Inertial of a link, its inertia (3, 3) about the centre of mass."""
    element = SubElement(link, "inertial")
    SubElement(element, "origin", {"xyz": words(com)})
    SubElement(element, "mass", {"value": words(mass)})
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = inertia[np.triu_indices(3)]
    SubElement(element, "inertia", {k: words(v) for k, v in zip(keys, values, strict=True)})


def words(values: Any) -> str:
    """Numbers with all their digits."""
    return " ".join(f"{x + 0.0:.17g}" for x in np.ravel(values))
