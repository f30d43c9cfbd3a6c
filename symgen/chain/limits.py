"""Limits of joints, and what the limits of coupled joints leave to the joint that moves them."""

from typing import TYPE_CHECKING, Any

from symgen.chain.coupling import Coupling
from symgen.chain.document import Document, numbers
from symgen.errors import UrdfError

if TYPE_CHECKING:
    from symgen.chain.joint import Joint


def limits_of(
    document: Document, name: str
) -> tuple[float | None, float | None, float | None, float | None]:
    """Limits of a joint."""
    node = document.joints[name].find("limit")
    values: dict[str, float | None] = dict.fromkeys(("lower", "upper", "velocity", "effort"))
    if node is not None:
        for key in values:
            if key in node.attrib:
                what = f"joint '{name}': limit {key}"
                values[key] = float(numbers(node.get(key, ""), 1, what)[0])
    lower, upper = values["lower"], values["upper"]
    if document.kind(name) == "continuous":
        lower = upper = None
    if lower is not None and upper is not None and lower > upper:
        raise UrdfError(
            f"joint '{name}' has lower limit {lower:g} above upper limit {upper:g}; correct <limit>"
        )
    for key in ("velocity", "effort"):
        value = values[key]
        if value is not None and value < 0:
            raise UrdfError(f"joint '{name}' has the negative {key} limit {value:g}; correct it")
        values[key] = value or None  # 0 is how exporters write "not given"
    if lower == upper == 0 and not (values["velocity"] or values["effort"]):
        lower = upper = None
    return lower, upper, values["velocity"], values["effort"]


def range_of_followers(
    joints: tuple["Joint", ...], coupling: Coupling
) -> dict[int, dict[str, Any]]:
    """Limits of independent joints after those of the joints that follow them.

    A joint with one master x = c q + b limits q to (lower − b)/c … (upper − b)/c and its speed to
    velocity/|c|. A joint with several masters limits no single one, and a range that is empty is
    not used: the joint keeps its limits.
    """
    changed: dict[int, dict[str, Any]] = {}
    for k, joint in enumerate(joints):
        masters = coupling.masters(k)
        if k in coupling.independent or len(masters) != 1:
            continue
        factor, offset = coupling.matrix[k][masters[0]], coupling.offset[k]
        ends = [None if x is None else (x - offset) / factor for x in (joint.lower, joint.upper)]
        lower, upper = ends if factor > 0 else ends[::-1]
        place = coupling.independent[masters[0]]
        master = joints[place]
        now = changed.get(
            place, {"lower": master.lower, "upper": master.upper, "velocity": master.velocity}
        )
        new = dict(now)
        if lower is not None:
            new["lower"] = lower if now["lower"] is None else max(lower, now["lower"])
        if upper is not None:
            new["upper"] = upper if now["upper"] is None else min(upper, now["upper"])
        if joint.velocity is not None:
            speed = joint.velocity / abs(factor)
            new["velocity"] = speed if now["velocity"] is None else min(speed, now["velocity"])
        if new["lower"] is None or new["upper"] is None or new["lower"] < new["upper"]:
            changed[place] = new
    return changed
