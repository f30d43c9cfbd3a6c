"""Robots given by modified Denavit–Hartenberg rows in a TOML file → URDF and mechanism.

    T = Rot_x(α) Trans_x(a) Rot_z(θ + x) Trans_z(d)          revolute, x the joint's position
    T = Rot_x(α) Trans_x(a) Rot_z(θ) Trans_z(d + x)          prismatic

The position x is a coordinate of its own (`joint = "q1"`), or Σ of[m] x_m of others (`of = {…}`); a
row with neither is fixed. Limits are those of <limit>. The tables of a mechanism file may stand in
the same file.
Source: Craig, Introduction to Robotics, 3rd ed., Sec. 3.4.
"""

import math
from typing import Annotated, Any, Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio
from msgspec import Meta

from runtime.common.records import Factors, Name, Record, Vector3, record_from_table
from symgen.chain.document import add_inertial, add_joint
from symgen.chain.mechanism import Mechanism, mechanism_from_table
from symgen.errors import UrdfError

_LIMITS = ("lower", "upper", "velocity", "effort")


class Row(Record, frozen=True):
    """A link with the modified DH row of its frame, its limits [rad or m] and its body [SI]."""

    name: Name
    parent: str | None = None
    a: float = 0.0
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    joint: Name | None = None
    of: Factors | None = None
    kind: Literal["revolute", "prismatic"] = "revolute"
    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    effort: float | None = None
    mass: float | None = None
    com: Vector3 = (0.0, 0.0, 0.0)
    # xx, yy, zz, xy, xz, yz about the centre of mass
    inertia: tuple[float, float, float, float, float, float] = (0.0,) * 6


class Robot(Record, frozen=True):
    """The tables of a robot beside those of its mechanism."""

    link: Annotated[tuple[Row, ...], Meta(min_length=1)]
    name: str = "robot"


def robot_from_rows(table: dict[str, Any], where: str) -> tuple[str, Mechanism]:
    """URDF and mechanism of a robot given by modified DH rows."""
    if not table.get("link"):
        raise UrdfError(
            f"{where} describes a robot by tables [[link]] with name, parent, a, alpha, d, theta "
            "and joint or of; it has none"
        )
    rest = {key: value for key, value in table.items() if key not in {"link", "name"}}
    robot_table = {key: value for key, value in table.items() if key not in rest}
    stated = record_from_table(Robot, robot_table, where, UrdfError)
    robot = Element("robot", {"name": stated.name})
    links = [stated.link[0].parent or "base"]
    SubElement(robot, "link", {"name": links[0]})
    couplings: list[dict[str, Any]] = list(table.get("coupling", []))
    for row in stated.link:
        couplings += _add(robot, links, row, where)
    if couplings:
        rest["coupling"] = couplings
    indent(robot, space="  ")
    return tostring(robot, "unicode") + "\n", mechanism_from_table(rest, where)


def _add(robot: Element, links: list[str], row: Row, where: str) -> list[dict[str, Any]]:
    """Add the link of a row and its joint; the coupling that it states, if any."""
    what = f"{where}: [[link]] {row.name!r}"
    link, parent = row.name, row.parent or links[0]
    if link in links:
        raise UrdfError(f"{what} occurs twice; give every link its own name")
    if parent not in links:
        raise UrdfError(
            f"{what} has the parent {parent!r}, which no row before it describes; there are "
            f"{', '.join(links)}"
        )
    links.append(link)
    if row.joint is not None and row.of is not None:
        raise UrdfError(f"{what} has joint and of; keep the one that its position follows")
    moves = row.joint is not None or row.of is not None
    stated = {key: getattr(row, key) for key in _LIMITS}
    limits = {key: value for key, value in stated.items() if value is not None}
    if limits and not moves:
        raise UrdfError(f"{what} is fixed and has {next(iter(limits))}; give it a joint, or none")
    kind: str = row.kind if moves else "fixed"
    if kind == "revolute" and not {"lower", "upper"} & set(limits):
        kind = "continuous"
    name = row.joint or f"{link}_joint"
    tilt = pinocchio.rpy.rpyToMatrix(row.alpha, 0.0, 0.0)
    turn = tilt @ pinocchio.rpy.rpyToMatrix(0.0, 0.0, row.theta)
    xyz = (row.a, -row.d * math.sin(row.alpha), row.d * math.cos(row.alpha))
    axis = (0.0, 0.0, 1.0) if moves else None
    add_joint(robot, name, kind, (parent, link), xyz, turn, axis, limits or None)
    element = SubElement(robot, "link", {"name": link})
    if row.mass is not None:
        xx, yy, zz, xy, xz, yz = row.inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        add_inertial(element, row.mass, row.com, tensor)
    return [{"joint": name, "of": row.of}] if row.of is not None else []
