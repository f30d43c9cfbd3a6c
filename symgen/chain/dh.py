"""Robots given by modified Denavit–Hartenberg rows in a TOML file → URDF and mechanism.

    T = Rot_x(α) Trans_x(a) Rot_z(θ + x) Trans_z(d)          revolute, x the joint's position
    T = Rot_x(α) Trans_x(a) Rot_z(θ) Trans_z(d + x)          prismatic

The position x is a coordinate of its own (`joint = "q1"`), or Σ of[m] x_m of others (`of = {…}`); a
row with neither is fixed. Limits are those of <limit>. The tables of a mechanism file may stand in
the same file.
Source: Craig, Introduction to Robotics, 3rd ed., Sec. 3.4.
"""

import math
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio

from symgen.chain.mechanism import Mechanism, MechanismTable, mechanism_from_table
from symgen.errors import UrdfError

_KEYS = ("name", "parent", "a", "alpha", "d", "theta", "joint", "of", "kind")
_BODY = ("mass", "com", "inertia")
_LIMITS = ("lower", "upper", "velocity", "effort")
_KINDS = ("revolute", "prismatic")


def robot_from_rows(table: dict[str, Any], where: str) -> tuple[str, Mechanism]:
    """URDF and mechanism of a robot given by modified DH rows."""
    rows = table.get("link")
    if not isinstance(rows, list) or not rows or not all(isinstance(r, dict) for r in rows):
        raise UrdfError(
            f"{where} describes a robot by tables [[link]] with name, parent, a, alpha, d, theta "
            "and joint or of; it has none"
        )
    name = table.get("name", "robot")
    if not isinstance(name, str):
        raise UrdfError(f"{where}: name needs a text, got {name!r}")
    robot = Element("robot", {"name": name})
    links: list[str] = []
    couplings: list[dict[str, Any]] = list(table.get("coupling", []))
    first = rows[0].get("parent", "base")
    links.append(str(first))
    SubElement(robot, "link", {"name": str(first)})
    for row in rows:
        couplings += _add(robot, links, row, where)
    rest = {key: value for key, value in table.items() if key not in {"link", "name"}}
    if couplings:
        rest["coupling"] = couplings
    indent(robot, space="  ")
    return tostring(robot, "unicode") + "\n", mechanism_from_table(rest, where)


def _add(robot: Element, links: list[str], row: dict[str, Any], where: str) -> list[dict[str, Any]]:
    """Add the link of a row and its joint; the coupling that it states, if any."""
    what = f"{where}: [[link]] {row.get('name', '')!r}"
    table = MechanismTable(row, what)
    table.require_keys((*_KEYS, *_BODY, *_LIMITS))
    link, parent = table.text("name"), row.get("parent", links[0])
    if link in links:
        raise UrdfError(f"{what} occurs twice; give every link its own name")
    if parent not in links:
        raise UrdfError(
            f"{what} has the parent {parent!r}, which no row before it describes; there are "
            f"{', '.join(links)}"
        )
    links.append(link)
    moves = "joint" in row or "of" in row
    if "joint" in row and "of" in row:
        raise UrdfError(f"{what} has joint and of; keep the one that its position follows")
    kind = row.get("kind", "revolute")
    if kind not in _KINDS:
        raise UrdfError(f"{what} needs the kind {' or '.join(_KINDS)}, got {kind!r}")
    name = table.text("joint") if "joint" in row else f"{link}_joint"
    limits = {key: f"{table.number(key):.17g}" for key in _LIMITS if key in row}
    if limits and not moves:
        raise UrdfError(f"{what} is fixed and has {next(iter(limits))}; give it a joint, or none")
    if kind == "revolute" and not {"lower", "upper"} & set(limits):
        kind = "continuous"
    joint = SubElement(robot, "joint", {"name": name, "type": kind if moves else "fixed"})
    a, alpha, d, theta = (table.number(key, 0.0) for key in ("a", "alpha", "d", "theta"))
    tilt = pinocchio.rpy.rpyToMatrix(alpha, 0.0, 0.0)
    turn = tilt @ pinocchio.rpy.rpyToMatrix(0.0, 0.0, theta)
    xyz = (a, -d * math.sin(alpha), d * math.cos(alpha))
    SubElement(
        joint, "origin", {"xyz": _words(xyz), "rpy": _words(pinocchio.rpy.matrixToRpy(turn))}
    )
    SubElement(joint, "parent", {"link": parent})
    SubElement(joint, "child", {"link": link})
    if moves:
        SubElement(joint, "axis", {"xyz": "0 0 1"})
        if limits:
            SubElement(joint, "limit", limits)
    _add_body(SubElement(robot, "link", {"name": link}), table)
    return [{"joint": name, "of": row["of"]}] if "of" in row else []


def _add_body(link: Element, table: MechanismTable) -> None:
    """<inertial> of a row with a mass: centre of mass, and inertia about it (xx, yy, zz, xy, …)."""
    if "mass" not in table.entry:
        return
    body = SubElement(link, "inertial")
    com = table.numbers("com", 3) if "com" in table.entry else (0.0, 0.0, 0.0)
    entries = table.numbers("inertia", 6) if "inertia" in table.entry else (0.0,) * 6
    SubElement(body, "origin", {"xyz": _words(com)})
    SubElement(body, "mass", {"value": f"{table.number('mass'):.17g}"})
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    SubElement(body, "inertia", {k: f"{v:.17g}" for k, v in zip(names, entries, strict=True)})


def _words(values: Any) -> str:
    return " ".join(f"{x:.17g}" for x in np.ravel(values))
