"""Facts of a mechanism that a URDF does not contain, read from a TOML file beside it.

    [[coupling]]      a dependent joint,        x = Σ of[m] x_m + offset
    [[friction]]      a further coordinate with friction of its own, y = Σ of[m] x_m
    [[spring]]        torsional or linear along joints, or between points of two links
    [[known_torque]]  a torque curve along joints, by polynomial or by points
    [[loop]]          a loop joint: two frames of links that coincide
    [assembly]        positions of joints near which the loops close

The signs are those of τ: a torque that the drives must apply is positive.
"""

from itertools import pairwise
from typing import Any

from msgspec import field, to_builtins

from runtime.common.records import Factors, Name, Record, Vector3, record_from_table
from symgen.chain.coupling import CouplingRow
from symgen.errors import UrdfError

FREE_ROWS = {  # kind of a loop joint → components (x, y, z, turns about x, y, z) that stay free
    "fixed": (),
    "revolute": (5,),
    "prismatic": (2,),
    "cylindrical": (2, 5),
    "spherical": (3, 4, 5),
}
IN_SHARED = ("spherical",)
"""Kinds whose rows are in axes of the last joint that moves both links; others: of the parent."""
_ORIGIN = (0.0, 0.0, 0.0)


class Loop(Record, frozen=True):
    """A loop joint as stated."""

    parent: Name  # parent, child: links of the two frames
    child: Name
    parent_xyz: Vector3 = _ORIGIN  # parent_xyz, child_xyz: origins in the frames of these links [m]
    parent_rpy: Vector3 = _ORIGIN  # parent_rpy, child_rpy: their axes [rad]
    child_xyz: Vector3 = _ORIGIN
    child_rpy: Vector3 = _ORIGIN
    kind: str = ""  # key of `FREE_ROWS`; "" leaves it to the assembly pose (`chain.assembly`)
    axis: Vector3 = (0.0, 0.0, 1.0)  # of a revolute, prismatic or cylindrical one, in both frames

    @property
    def name(self) -> str:
        """The loop in messages."""
        return f"the loop of '{self.parent}' and '{self.child}'"


class Spring(Record, frozen=True):
    """A spring with potential k (x − rest)² / 2; x = Σ of[m] x_m, or a distance of points."""

    name: str  # name of its friction column, `spring:NAME`
    of: dict[str, float] = field(default_factory=dict)  # joint → factor; empty between points
    parent: str = ""  # parent, child: links of the two points; "" for a spring along joints
    child: str = ""
    parent_xyz: Vector3 = _ORIGIN  # parent_xyz, child_xyz: points in the frames of these links [m]
    child_xyz: Vector3 = _ORIGIN
    rest: float = 0.0  # x without force [rad or m]
    stiffness: float | None = None  # k [N·m/rad, N/m]; None where it is to be identified


class KnownTorque(Record, frozen=True):
    """A torque curve p(x), x = Σ of[m] x_m, that adds p(x) ∂x/∂q to τ."""

    of: Factors  # joint → factor
    polynomial: tuple[float, ...] = ()  # coefficients of 1, x, x², …; empty where points are given
    x: tuple[float, ...] = ()  # x, torque: points of a linear p, constant beyond; x ascending
    torque: tuple[float, ...] = ()


class FrictionCoordinate(Record, frozen=True):
    """A coordinate y = Σ of[m] x_m at whose speed friction acts."""

    name: Name
    of: Factors


class Mechanism(Record, frozen=True):
    """Everything of a mechanism file."""

    # rows of dependent joints; a row replaces the <mimic> of its joint
    coupling: tuple[CouplingRow, ...] = ()
    independent: tuple[str, ...] = ()  # independent joints in the order of q; empty: without a row
    friction: tuple[FrictionCoordinate, ...] = ()  # further coordinates with friction
    spring: tuple[Spring, ...] = ()  # springs
    known_torque: tuple[KnownTorque, ...] = ()  # torque curves
    loop: tuple[Loop, ...] = ()  # loop joints
    assembly: dict[str, float] = field(default_factory=dict)  # [rad, m]; others: 0 or mid-range


_FAR = 1e3  # largest position of an assembly pose, rad or m; beyond it Newton works on rounding
_TABLES = ("coupling", "friction", "spring", "known_torque", "loop")
_POINTS = ("parent", "child", "parent_xyz", "child_xyz")


def mechanism_from_table(table: dict[str, Any], where: str) -> Mechanism:
    """Return the mechanism of a parsed TOML table."""
    mechanism = record_from_table(Mechanism, _written_out(table, where), where, UrdfError)
    for spring in mechanism.spring:
        _check_spring(spring, f"{where}: [[spring]]")
    if len({spring.name for spring in mechanism.spring}) < len(mechanism.spring):
        raise UrdfError(f"{where}: two springs have one name; give each [[spring]] its own")
    for torque in mechanism.known_torque:
        _check_torque(torque, f"{where}: [[known_torque]]")
    for row in mechanism.coupling:
        if not row.of:
            raise UrdfError(f"{where}: [[coupling]] needs of = {{JOINT = factor, …}}, got none")
    for loop in mechanism.loop:
        if loop.kind and loop.kind not in FREE_ROWS:
            raise UrdfError(
                f"{where}: [[loop]] has kind = {loop.kind!r}, expected one of "
                f"{', '.join(FREE_ROWS)}"
            )
        if not any(loop.axis):
            raise UrdfError(f"{where}: [[loop]] has the axis 0 0 0; give it a direction")
    for joint, value in mechanism.assembly.items():
        if abs(value) > _FAR:
            raise UrdfError(
                f"{where}: [assembly] states {joint} = {value:g}, expected at most {_FAR:g} "
                "rad or m; correct it"
            )
    return mechanism


def table_from_mechanism(mechanism: Mechanism) -> dict[str, Any]:
    """Return the table that `mechanism_from_table` reads as this mechanism."""

    def filled(entry: Any) -> dict[str, Any]:
        points = isinstance(entry, Spring) and entry.parent
        dropped: tuple[str, ...] = ("of",) if points else _POINTS
        if isinstance(entry, Loop):
            dropped = () if entry.kind else ("kind",)
        values = to_builtins(entry)
        return {k: v for k, v in values.items() if v not in (None, (), []) and k not in dropped}

    table: dict[str, Any] = {
        key: [filled(entry) for entry in getattr(mechanism, key)] for key in _TABLES
    }
    table["independent"] = list(mechanism.independent)
    table["assembly"] = mechanism.assembly
    return {key: value for key, value in table.items() if value}


def _written_out(table: dict[str, Any], where: str) -> dict[str, Any]:
    """The table with `of` in place of `joint` and with names of all springs."""
    written = dict(table)
    for key in ("spring", "known_torque"):
        entries = table.get(key)
        if not isinstance(entries, list) or not all(isinstance(each, dict) for each in entries):
            continue  # the record refuses it
        written[key] = [dict(each) for each in entries]
        for k, entry in enumerate(written[key], start=1):
            lacking = [name for name in _POINTS if name not in entry]
            points = key == "spring" and len(lacking) < len(_POINTS)
            if points and lacking:
                raise UrdfError(f"{where}: [[spring]] between points needs {lacking[0]}; add it")
            if ("joint" in entry) + ("of" in entry) + points != 1:
                ways = "joint or of" if key == "known_torque" else "joint, of, or points of links"
                raise UrdfError(
                    f"{where}: [[{key}]] needs one of {ways}; it has {', '.join(entry) or 'none'}"
                )
            if "joint" in entry:
                entry["of"] = {str(entry.pop("joint")): 1.0}
            if key == "spring":
                entry.setdefault("name", str(k))
    return written


def _check_spring(spring: Spring, what: str) -> None:
    if not spring.name.replace("_", "a").isalnum():
        raise UrdfError(f"{what} needs a name of letters, digits and _, got {spring.name!r}")
    if spring.stiffness is not None and spring.stiffness < 0:
        raise UrdfError(
            f"{what} '{spring.name}' has the stiffness {spring.stiffness:g}, expected at least 0; "
            "correct its sign, or describe the torque by [[known_torque]]"
        )


def _check_torque(torque: KnownTorque, what: str) -> None:
    points = torque.x or torque.torque
    if bool(torque.polynomial) == bool(points):
        raise UrdfError(
            f"{what} needs either polynomial = [c0, c1, …], or points x = […] with torque = […]"
        )
    x = torque.x
    ascends = len(x) > 1 and all(b > a for a, b in pairwise(x))
    if points and not (ascends and len(x) == len(torque.torque)):
        raise UrdfError(
            f"{what} needs two points or more with ascending x and one torque each, got "
            f"{len(x)} x and {len(torque.torque)} torques"
        )
