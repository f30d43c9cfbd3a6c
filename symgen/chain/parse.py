"""A URDF as a model of pinocchio, without shapes, limits and dynamics."""

import pinocchio

from symgen.chain.document import MOVING, Document, numbers
from symgen.errors import UrdfError


def parse_with_pinocchio(document: Document) -> pinocchio.Model:
    """Pinocchio's model; a continuous joint is passed as a revolute one, so that nq = nv."""
    copy = Document(document.text())
    for link in copy.links.values():  # shapes are not needed, and a faulty one stops the parser
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    for name, element in copy.joints.items():
        for tag in ("dynamics", "safety_controller", "limit", "calibration", "mimic"):
            node = element.find(tag)
            if node is not None:
                element.remove(node)
        if copy.kind(name) in MOVING:
            axis = element.find("axis")
            if axis is not None:
                direction = numbers(axis.get("xyz", "1 0 0"), 3, f"joint '{name}': axis")
                size = max(map(abs, direction))
                if not size > 0:
                    raise UrdfError(f"joint '{name}' has the axis 0 0 0; give it a direction")
                if not 1e-100 < size < 1e100:  # its square overflows or vanishes
                    raise UrdfError(
                        f"joint '{name}' has an axis of length {size:g}, expected about 1; give a "
                        "unit vector"
                    )
            element.set("type", "prismatic" if copy.kind(name) == "prismatic" else "revolute")
            element.append(element.makeelement("limit", {"effort": "1", "velocity": "1"}))
    try:
        return pinocchio.buildModelFromXML(copy.text())
    except (ValueError, RuntimeError) as error:
        raise UrdfError(f"pinocchio cannot read the URDF: {' '.join(str(error).split())}") from None
