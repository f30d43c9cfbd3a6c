"""Loop joints: pairs of frames of two links that coincide, and what they leave to the joints.

    φ(x) = 0,   x = (q, d):   d = g(q) by Newton from the assembly pose

φ are rows of the pose of the child's frame in the parent's frame: three of its origin, three of its
axes; where axes do not matter, the difference of the origins. The kind of a loop joint says which
of them may change. Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, Ch. 8.
"""

from dataclasses import dataclass
from typing import Any

from symgen.chain.entry import MechanismTable
from symgen.errors import UrdfError

Rows = tuple[tuple[float, ...], ...]
Vector = tuple[float, ...]

FREE_ROWS = {
    "fixed": (),
    "revolute": (5,),
    "prismatic": (2,),
    "cylindrical": (2, 5),
    "spherical": (3, 4, 5),
}
"""Kind of a loop joint → components (x, y, z, turn about x, y, z) of the frames that stay free."""

IN_SHARED = ("spherical",)
"""Kinds whose rows are in axes of the last joint that moves both links; others: of the parent."""

_KEYS = ("parent", "child", "parent_xyz", "parent_rpy", "child_xyz", "child_rpy", "kind", "axis")
_ORIGIN = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop joint as stated.

    Attributes:
        parent, child: links of the two frames.
        parent_xyz, child_xyz: their origins in the frames of these links [m].
        parent_rpy, child_rpy: their axes [rad].
        kind: key of `FREE_ROWS`; "" where the assembly pose decides (`symgen.chain.assembly`).
        axis: of a revolute, prismatic or cylindrical loop joint, in the two frames.
    """

    parent: str
    child: str
    parent_xyz: Vector = _ORIGIN
    parent_rpy: Vector = _ORIGIN
    child_xyz: Vector = _ORIGIN
    child_rpy: Vector = _ORIGIN
    kind: str = ""
    axis: Vector = (0.0, 0.0, 1.0)

    @property
    def name(self) -> str:
        """The loop in messages."""
        return f"the loop of '{self.parent}' and '{self.child}'"


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame rigid in the body of a joint.

    Attributes:
        joint: index of the joint, −1 for the base.
        rotation: R from this frame to that of the joint.
        translation: origin in the joint's frame, m.
    """

    joint: int
    rotation: Rows
    translation: Vector


@dataclass(frozen=True, slots=True)
class Closure:
    """One loop joint, its z axis along that of the joint.

    Attributes:
        name: for messages.
        kind: key of `FREE_ROWS`.
        parent, child: the two frames.
        rows: components of the frames that are closed; others follow from these, or are free.
    """

    name: str
    kind: str
    parent: Frame
    child: Frame
    rows: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Turn:
    """An independent joint that turns without end through postures that all close.

    Attributes:
        place: in q.
        windings: turns of the dependent coordinates per turn of the joint, (r,).
    """

    place: int
    windings: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Loops:
    """All loop joints of a chain and the choice of coordinates.

    x are the coordinates of the chain without its loops: all joints, or those that couplings leave.

    Attributes:
        closures: the loop joints.
        independent: (n,) places in x of q, in the order of q.
        dependent: (r,) places in x of the others, as many as there are rows.
        blocks: rows and places in `dependent` of systems that are solved one after the other.
        assembly: x of the assembly pose [rad, m].
        turns: joints that turn without end.
    """

    closures: tuple[Closure, ...]
    independent: tuple[int, ...]
    dependent: tuple[int, ...]
    blocks: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    assembly: Vector
    turns: tuple[Turn, ...] = ()


def read_loop(entry: dict[str, Any], where: str) -> Loop:
    """Return the loop joint of a table."""
    table = MechanismTable(entry, f"{where}: [[loop]]")
    table.require_keys(_KEYS)
    kind = entry.get("kind", "")
    if kind and kind not in FREE_ROWS:
        raise UrdfError(f"{table.what} has kind = {kind!r}, expected one of {', '.join(FREE_ROWS)}")
    places = {key: table.numbers(key, 3) for key in _KEYS[2:6] if key in entry}
    axis = table.numbers("axis", 3) if "axis" in entry else (0.0, 0.0, 1.0)
    if not any(axis):
        raise UrdfError(f"{table.what} has the axis 0 0 0; give it a direction")
    return Loop(table.text("parent"), table.text("child"), **places, kind=kind, axis=axis)
