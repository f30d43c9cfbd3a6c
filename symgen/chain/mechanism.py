"""Facts of a mechanism that a URDF does not contain, read from a TOML file beside it.

    [[coupling]]      a dependent joint,        x = Σ of[m] x_m + offset
    [[friction]]      a further coordinate with friction of its own, y = Σ of[m] x_m
    [[spring]]        torsional or linear along joints, or between points of two links
    [[known_torque]]  a torque curve along joints, by polynomial or by points
    [[loop]]          a loop joint: two frames of links that coincide
    [assembly]        positions of joints near which the loops close

The signs are those of τ: a torque that the drives must apply is positive.
"""

import math
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Any

from symgen.chain.coupling import CouplingRow, Vector
from symgen.errors import UrdfError

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
_POINTS = ("parent", "child", "parent_xyz", "child_xyz")
_PLACE = ("parent_xyz", "parent_rpy", "child_xyz", "child_rpy")
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
class Spring:
    """A spring with potential k (x − rest)² / 2 and the drives' torque k (x − rest) ∂x/∂q.

    x = Σ of[m] x_m, or the distance of a point of `parent` from a point of `child`.

    Attributes:
        name: name of its friction column, `spring:NAME`.
        of: joint → factor; empty for a spring between points.
        parent, child: links of the two points; "" for a spring along joints.
        parent_xyz, child_xyz: points in the frames of these links [m].
        rest: x without force [rad or m].
        stiffness: k [N·m/rad, N/m]; None where it is to be identified.
    """

    name: str
    of: dict[str, float] = field(default_factory=dict)
    parent: str = ""
    child: str = ""
    parent_xyz: Vector = _ORIGIN
    child_xyz: Vector = _ORIGIN
    rest: float = 0.0
    stiffness: float | None = None


@dataclass(frozen=True, slots=True)
class KnownTorque:
    """A torque curve p(x), x = Σ of[m] x_m, that adds p(x) ∂x/∂q to τ.

    Attributes:
        of: joint → factor.
        polynomial: coefficients of 1, x, x², …; empty where points are given.
        x, torque: points between which p is linear, constant beyond; x ascending.
    """

    of: dict[str, float]
    polynomial: Vector = ()
    x: Vector = ()
    torque: Vector = ()


@dataclass(frozen=True, slots=True)
class FrictionCoordinate:
    """A coordinate y = Σ of[m] x_m at whose speed friction acts."""

    name: str
    of: dict[str, float]


@dataclass(frozen=True, slots=True)
class Mechanism:
    """Everything of a mechanism file.

    Attributes:
        coupling: rows of dependent joints; a row replaces the <mimic> of its joint.
        independent: names of the independent joints in the order of q; empty: those without a row.
        friction: further coordinates with friction.
        spring: springs.
        known_torque: torque curves.
        loop: loop joints.
        assembly: joint → position of the assembly pose [rad or m]; others: 0 or mid-range.
    """

    coupling: tuple[CouplingRow, ...] = ()
    independent: tuple[str, ...] = ()
    friction: tuple[FrictionCoordinate, ...] = ()
    spring: tuple[Spring, ...] = ()
    known_torque: tuple[KnownTorque, ...] = ()
    loop: tuple[Loop, ...] = ()
    assembly: dict[str, float] = field(default_factory=dict)


_FAR = 1e3
"""Largest position of an assembly pose, rad or m; beyond it Newton would work on rounding error."""
_TABLES = ("coupling", "friction", "spring", "known_torque", "loop")


def mechanism_from_table(table: dict[str, Any], where: str) -> Mechanism:
    """Return the mechanism of a parsed TOML table."""
    keys = (*_TABLES, "independent", "assembly")
    for key in table:
        if key not in keys:
            raise UrdfError(f"{where} has the unknown key '{key}'; known are {', '.join(keys)}")
    for key in _TABLES:
        entries = table.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            raise UrdfError(f"{where}: expected tables [[{key}]], got {key} = {entries!r}")
    names = table.get("independent", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise UrdfError(f"{where}: independent needs a list of names of joints, got {names!r}")
    springs = tuple(_spring(e, k, where) for k, e in enumerate(table.get("spring", [])))
    if len({s.name for s in springs}) < len(springs):
        raise UrdfError(f"{where}: two springs have one name; give each [[spring]] its own")
    return Mechanism(
        coupling=tuple(_coupling(e, where) for e in table.get("coupling", [])),
        independent=tuple(names),
        friction=tuple(_friction(e, where) for e in table.get("friction", [])),
        spring=springs,
        known_torque=tuple(_known_torque(e, where) for e in table.get("known_torque", [])),
        loop=tuple(_loop(e, where) for e in table.get("loop", [])),
        assembly=_assembly(table.get("assembly", {}), where),
    )


def table_from_mechanism(mechanism: Mechanism) -> dict[str, Any]:
    """Return the table that `mechanism_from_table` reads as this mechanism."""

    def filled(entry: Any) -> dict[str, Any]:
        values = {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(entry).items()}
        points = isinstance(entry, Spring) and entry.parent
        dropped: tuple[str, ...] = ("of",) if points else _POINTS
        if isinstance(entry, Loop):
            dropped = () if entry.kind else ("kind",)
        return {k: v for k, v in values.items() if v not in (None, []) and k not in dropped}

    table: dict[str, Any] = {
        key: [filled(entry) for entry in getattr(mechanism, key)] for key in _TABLES
    }
    table["independent"] = list(mechanism.independent)
    table["assembly"] = mechanism.assembly
    return {key: value for key, value in table.items() if value}


def _assembly(table: Any, where: str) -> dict[str, float]:
    if not isinstance(table, dict):
        raise UrdfError(f"{where}: [assembly] needs lines JOINT = position, got {table!r}")
    read = MechanismTable(table, f"{where}: [assembly]")
    positions = {joint: read.number(joint) for joint in table}
    for joint, value in positions.items():
        if abs(value) > _FAR:
            raise UrdfError(
                f"{where}: [assembly] states {joint} = {value:g}, expected at most {_FAR:g} "
                "rad or m; correct it"
            )
    return positions


def _coupling(entry: dict[str, Any], where: str) -> CouplingRow:
    table = MechanismTable(entry, f"{where}: [[coupling]]")
    table.require_keys(("joint", "of", "offset"))
    return CouplingRow(table.text("joint"), table.factors(), table.number("offset", 0.0))


def _friction(entry: dict[str, Any], where: str) -> FrictionCoordinate:
    table = MechanismTable(entry, f"{where}: [[friction]]")
    table.require_keys(("name", "of"))
    return FrictionCoordinate(table.text("name"), table.factors())


def _spring(entry: dict[str, Any], index: int, where: str) -> Spring:
    table = MechanismTable(entry, f"{where}: [[spring]]")
    table.require_keys(("name", "joint", "of", *_POINTS, "rest", "stiffness"))
    name = entry.get("name", str(index + 1))
    if not isinstance(name, str) or not name or not name.replace("_", "a").isalnum():
        raise UrdfError(f"{table.what} needs a name of letters, digits and _, got {name!r}")
    rest = table.number("rest", 0.0)
    stiffness = table.number("stiffness") if "stiffness" in entry else None
    if stiffness is not None and stiffness < 0:
        raise UrdfError(
            f"{table.what} '{name}' has the stiffness {stiffness:g}, expected at least 0; correct "
            "its sign, or describe the torque by [[known_torque]]"
        )
    if not any(key in entry for key in _POINTS):
        return Spring(name, of=table.along(), rest=rest, stiffness=stiffness)
    if "of" in entry or "joint" in entry:
        raise UrdfError(f"{table.what} '{name}' has joints and points of links; keep one of them")
    return Spring(
        name,
        parent=table.text("parent"),
        child=table.text("child"),
        parent_xyz=table.numbers("parent_xyz", 3),
        child_xyz=table.numbers("child_xyz", 3),
        rest=rest,
        stiffness=stiffness,
    )


def _known_torque(entry: dict[str, Any], where: str) -> KnownTorque:
    table = MechanismTable(entry, f"{where}: [[known_torque]]")
    table.require_keys(("joint", "of", "polynomial", "x", "torque"))
    of = table.along()
    if "polynomial" in entry:
        if "x" in entry or "torque" in entry:
            raise UrdfError(f"{table.what} has a polynomial and points x, torque; keep one of them")
        return KnownTorque(of, polynomial=table.numbers("polynomial"))
    if not {"x", "torque"} <= entry.keys():
        raise UrdfError(
            f"{table.what} needs polynomial = [c0, c1, …], or points x = […] with torque = […]"
        )
    x, torque = table.numbers("x"), table.numbers("torque")
    if len(x) != len(torque) or len(x) < 2 or any(b <= a for a, b in pairwise(x)):
        raise UrdfError(
            f"{table.what} needs two points or more with ascending x and one torque each, got "
            f"{len(x)} x and {len(torque)} torques"
        )
    return KnownTorque(of, x=x, torque=torque)


def _loop(entry: dict[str, Any], where: str) -> Loop:
    table = MechanismTable(entry, f"{where}: [[loop]]")
    table.require_keys(("parent", "child", *_PLACE, "kind", "axis"))
    kind = entry.get("kind", "")
    if kind and kind not in FREE_ROWS:
        raise UrdfError(f"{table.what} has kind = {kind!r}, expected one of {', '.join(FREE_ROWS)}")
    places = {key: table.numbers(key, 3) for key in _PLACE if key in entry}
    axis = table.numbers("axis", 3) if "axis" in entry else (0.0, 0.0, 1.0)
    if not any(axis):
        raise UrdfError(f"{table.what} has the axis 0 0 0; give it a direction")
    return Loop(table.text("parent"), table.text("child"), **places, kind=kind, axis=axis)


@dataclass(frozen=True, slots=True)
class MechanismTable:
    """Typed access to one table of a TOML file; messages name the table and the key.

    Attributes:
        entry: keys and values.
        what: name of file and table, for messages.
    """

    entry: dict[str, Any]
    what: str

    def require_keys(self, keys: tuple[str, ...]) -> None:
        """Refuse keys other than these."""
        for key in self.entry:
            if key not in keys:
                raise UrdfError(
                    f"{self.what} has the unknown key '{key}'; known are {', '.join(keys)}"
                )

    def text(self, key: str) -> str:
        """A name that must be given."""
        value = self.entry.get(key)
        if not isinstance(value, str) or not value:
            raise UrdfError(f'{self.what} needs {key} = "NAME", got {value!r}')
        return value

    def factors(self) -> dict[str, float]:
        """Joint → factor, from `of`."""
        of = self.entry.get("of")
        if not isinstance(of, dict) or not of or not all(map(_is_number, of.values())):
            raise UrdfError(
                f"{self.what} needs of = {{JOINT = factor, …}} with finite factors, got {of!r}"
            )
        return {joint: float(factor) for joint, factor in of.items()}

    def along(self) -> dict[str, float]:
        """Factors of joints from `joint = "j"` or `of = {…}`."""
        if "joint" in self.entry and "of" not in self.entry:
            return {self.text("joint"): 1.0}
        return self.factors()

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number."""
        value = self.entry.get(key, default)
        if value is None or not _is_number(value):
            raise UrdfError(f"{self.what} needs a finite number for {key}, got {value!r}")
        return float(value)

    def numbers(self, key: str, count: int | None = None) -> Vector:
        """A list of finite numbers."""
        value = self.entry.get(key)
        size = f"{count} finite numbers" if count else "a list of finite numbers"
        fits = isinstance(value, list) and value and all(map(_is_number, value))
        if not isinstance(value, list) or not fits or (count and len(value) != count):
            raise UrdfError(f"{self.what} needs {size} for {key}, got {value!r}")
        return tuple(float(x) for x in value)


def _is_number(value: Any) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and math.isfinite(value)
