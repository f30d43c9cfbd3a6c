"""Frames of an SDF model: poses with `relative_to`, axes with `expressed_in`."""

from xml.etree.ElementTree import Element

import numpy as np
import pinocchio

from symgen.chain.document import listing, numbers
from symgen.errors import BuildError

_MODEL = "__model__"


class Frames:
    """Poses of links, joints and frames in the frame of the model, at the pose of the file.

    A link is placed in the model, a joint in its child link, a <frame> in what it is attached to,
    unless <pose relative_to=…> names another one.
    """

    def __init__(self, model: Element, where: str) -> None:
        self._where = where
        self._elements: dict[str, Element] = {}
        self._default: dict[str, str] = {}
        for tag in ("link", "joint", "loop_joint", "frame"):
            for element in model.findall(tag):
                name = element.get("name", "")
                if not name or name in self._elements:
                    raise BuildError(
                        f"{where}: expected a <{tag}> with a name of its own, got '{name}'"
                    )
                self._elements[name] = element
                self._default[name] = {
                    "link": _MODEL,
                    "frame": element.get("attached_to") or _MODEL,
                }.get(tag, (element.findtext("child") or "").strip())

    def of(self, name: str, pending: tuple[str, ...] = ()) -> pinocchio.SE3:
        """Pose of a frame in the model."""
        if name in {_MODEL, "world"}:
            return pinocchio.SE3.Identity()
        if name not in self._elements:
            raise BuildError(
                f"{self._where} refers to the frame '{name}', which the model does not have; its "
                f"frames are {listing(self._elements)}"
            )
        if name in pending:
            raise BuildError(
                f"{self._where}: the poses of {listing((*pending, name))} refer to each other; "
                "place one of them in the model"
            )
        element = self._elements[name]
        node = element.find("pose")
        base = (None if node is None else node.get("relative_to")) or self._default[name]
        return self.of(base, (*pending, name)) * pose_of(element, name)

    def axis(self, joint: Element) -> np.ndarray:
        """Axis of a joint in the joint's frame."""
        name = joint.get("name", "")
        node = joint.find("axis/xyz")
        text = "0 0 1" if node is None or not node.text else node.text
        direction = numbers(text, 3, f"joint '{name}': axis xyz")
        frame = "" if node is None else node.get("expressed_in", "")
        old = (joint.findtext("axis/use_parent_model_frame") or "").strip()
        if old in {"1", "true"}:
            frame = _MODEL
        if not frame:
            return direction
        return np.asarray(self.of(name).rotation.T @ self.of(frame).rotation @ direction)


def pose_of(element: Element, name: str) -> pinocchio.SE3:
    """Pose that an element states in its <pose>, x y z and roll pitch yaw."""
    node = element.find("pose")
    if node is None or not (node.text or "").strip():
        return pinocchio.SE3.Identity()
    values = numbers(node.text or "", 6, f"'{name}': pose")
    if node.get("degrees") in {"1", "true"}:
        values[3:] = np.radians(values[3:])
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(values[3:]), values[:3])
