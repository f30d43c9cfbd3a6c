"""TOML file of inertial priors: what is known of the bodies of a robot before identification.

    trust = "cad"                     # cad | gripper | none, or κ itself
    total_mass = [17.0, 18.5]         # kg; one number holds exactly
    armature_from = "robot.xml"       # MJCF or URDF; see below for [armature]

    [link.fr3_link7]
    mass = [0.5, 1.5]                 # kg
    com_box = [[-0.1, -0.1, 0.0], [0.1, 0.1, 0.1]]    # m, lowest and highest corner, link frame
    com_hull = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]
    symmetry = ["xz"]                 # planes of the link frame through its origin

`[centre]`, `[friction]` and `[noise]` of a type of robot, which `fleet` writes, are those of
`type_prior`.
Every entry is optional and every one is linear in π.

Rotor inertia is stated per joint, or read from the armature of an MJCF or URDF:

    [armature]
    joint1 = 0.15                 # kg·m², σ half of it
    joint2 = [0.057, 0.01]        # value and σ

armature_from reads <joint name="…" armature="…"/>, or the armature of its <dynamics>. σ of half the
value stands for a rotor inertia from a data sheet times the square of a gear ratio.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from runtime.common.files import text_of, toml_of
from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD, GRIPPER, NONE
from runtime.estimators.convex.constraints import Constraints, Row
from runtime.estimators.problem import FrictionPrior, NoiseFloor
from runtime.estimators.type_prior import KnownFriction, read_centre, read_friction, read_noise
from runtime.library import Array, Library
from runtime.library.parameters import PI_NAMES, links
from runtime.recording import Friction
from runtime.recording.friction import ROTOR

LARGEST_ROTOR = 1e6
"""Limit of a rotor inertia [kg·m², kg]."""
SHARE = 0.5
"""Standard deviation over the value where none is stated."""
TRUST = {"cad": CAD, "gripper": GRIPPER, "none": NONE}
MIRRORED = {
    "xy": ("mZ", "XZ", "YZ"),
    "xz": ("mY", "XY", "YZ"),
    "yz": ("mX", "XY", "XZ"),
}
"""Entries of π that vanish for a body that is symmetric about a plane of its link frame."""
_LARGEST_TRUST = sys.float_info.max
_KEYS = (
    "trust",
    "total_mass",
    "link",
    "armature",
    "armature_from",
    "centre",
    "friction",
    "noise",
    "fleet",
)
_LINK_KEYS = ("mass", "com_box", "com_hull", "symmetry")


@dataclass(frozen=True, slots=True)
class PriorFile:
    """Contents of a file of inertial priors.

    Attributes:
        kappa: trust κ in the URDF; None where the file does not state it.
        constraints: linear priors.
        armature: rotor inertia and its standard deviation per joint, (n, 2) [kg·m², kg], infinite
            without a prior; None where the file states none.
        centre: π0 of the type of robot, (10 n,) [kg, kg·m, kg·m²], in place of the URDF's; None
            where the file states none.
        friction: friction coefficients of the type; None where the file states none.
        units: number of units of the fleet that the prior was computed from; 0 for none.
        noise: least noise of the torque of the type; None where the file states none.
    """

    kappa: float | None
    constraints: Constraints
    armature: Array | None = None
    centre: Array | None = None
    friction: KnownFriction | None = None
    units: int = 0
    noise: NoiseFloor | None = None

    @property
    def friction_model(self) -> Friction | None:
        """Friction model that the units of a fleet share; None for a prior of other origin."""
        return self.friction.model if self.friction and self.units else None


def read_prior(path: Path, lib: Library) -> PriorFile:
    """Read a file of inertial priors and check it against a robot."""
    try:
        facts = toml_of(path)
    except OSError:
        raise IdentificationError(f"the prior '{path}' cannot be read; check the path") from None
    except ValueError as error:
        raise IdentificationError(f"the prior '{path}' is not TOML: {error}; correct it") from None
    links = facts.get("link", {})
    tables = links if isinstance(links, dict) else {"": links}
    no_table = [name for name, table in tables.items() if not isinstance(table, dict)]
    if no_table:
        raise IdentificationError(
            f"the prior '{path}' expects a table [link.NAME] for each link that it describes, got "
            f"{tables[no_table[0]]!r:.40} for '{no_table[0]}'; write such a table"
        )
    unknown = [k for k in facts if k not in _KEYS]
    unknown += [f"link.{k}" for k in links if k not in lib.link_names]
    unknown += [
        f"link.{k}.{key}" for k, table in links.items() for key in table if key not in _LINK_KEYS
    ]
    if unknown:
        raise IdentificationError(
            f"the prior '{path}' has an unknown entry '{unknown[0]}'; known are trust, total_mass, "
            f"armature, armature_from, centre, friction, noise, and {', '.join(_LINK_KEYS)} in "
            f"tables [link.NAME] of {', '.join(lib.link_names)}"
        )
    rows = _Rows(lib, path)
    if "total_mass" in facts:
        rows.interval("total_mass", facts["total_mass"], lib.link_names)
    for link, table in links.items():
        if "mass" in table:
            rows.interval(f"{link}.mass", table["mass"], (link,))
        if "com_box" in table:
            rows.box(link, table["com_box"])
        if "com_hull" in table:
            rows.hull(link, table["com_hull"])
        if "symmetry" in table:
            rows.symmetry(link, table["symmetry"])
    constraints = Constraints(tuple(rows.equations), tuple(rows.bounds))
    armature = read_armature(facts, path, lib)
    return PriorFile(
        _trust(facts.get("trust"), path),
        constraints,
        armature,
        read_centre(facts, path, lib),
        read_friction(facts, path, lib),
        _units(facts.get("fleet"), path),
        read_noise(facts, path, lib),
    )


class _Rows:
    """Equations and bounds, collected entry by entry."""

    def __init__(self, lib: Library, path: Path) -> None:
        self._lib, self._path = lib, path
        self.equations: list[Row] = []
        self.bounds: list[Row] = []

    def interval(self, name: str, given: Any, links: tuple[str, ...]) -> None:
        """Add Σ m = value, or lowest ≤ Σ m ≤ highest."""
        total = sum(self._unit(link, "m") for link in links)
        if isinstance(given, int | float) and not isinstance(given, bool):
            (value,) = self._numbers(name, [given], (1,), "a mass or [lowest, highest] in kg")
            self._positive(name, value)
            self.equations.append(Row(name, np.asarray(total), float(value)))
            return
        low, high = self._numbers(name, given, (2,), "a mass or [lowest, highest] in kg")
        self._positive(name, high)
        if low > high:
            self._refuse(name, "[lowest, highest] in kg")
        self.bounds += [Row(name, np.asarray(total), high), Row(name, -np.asarray(total), -low)]

    def box(self, link: str, given: Any) -> None:
        """Add lowest ≤ c ≤ highest as lowest m ≤ m c ≤ highest m."""
        name, wanted = f"{link}.com_box", "[[x, y, z], [x, y, z]] in m, lowest and highest corner"
        low, high = self._numbers(name, given, (2, 3), wanted)
        if not (low <= high).all():
            self._refuse(name, wanted)
        mass = self._unit(link, "m")
        for axis, key in enumerate(("mX", "mY", "mZ")):
            moment = self._unit(link, key)
            self.bounds += [
                Row(name, moment - high[axis] * mass, 0.0),
                Row(name, low[axis] * mass - moment, 0.0),
            ]

    def hull(self, link: str, given: Any) -> None:
        """Add that c lies in the convex hull of points: n·(m c) + d m ≤ 0 for its facets."""
        name, wanted = f"{link}.com_hull", "at least four points [x, y, z] in m, not in one plane"
        points = self._numbers(name, given, (-1, 3), wanted)
        try:
            facets = ConvexHull(points).equations
        except (QhullError, ValueError):
            self._refuse(name, wanted)
        moments = np.array([self._unit(link, key) for key in ("mX", "mY", "mZ")])
        mass = self._unit(link, "m")
        for facet in facets:
            self.bounds.append(Row(name, facet[:3] @ moments + facet[3] * mass, 0.0))

    def symmetry(self, link: str, given: Any) -> None:
        """Add that m c and the products of inertia across planes vanish."""
        name = f"{link}.symmetry"
        planes = given if isinstance(given, list) else [given]
        if not planes or any(plane not in tuple(MIRRORED) for plane in planes):
            self._refuse(name, f"a list of {', '.join(MIRRORED)}")
        for key in sorted({key for plane in planes for key in MIRRORED[plane]}):
            self.equations.append(Row(name, self._unit(link, key), 0.0))

    def _unit(self, link: str, key: str) -> Array:
        row = np.zeros(self._lib.pi0.size)
        links(row)[self._lib.link_names.index(link), PI_NAMES.index(key)] = 1.0
        return row

    def _numbers(self, name: str, given: Any, shape: tuple[int, ...], wanted: str) -> Array:
        try:
            values = np.array(given, dtype=float)
        except (TypeError, ValueError, OverflowError):
            self._refuse(name, wanted)
        fits = values.ndim == len(shape) and all(
            want in {-1, size} for want, size in zip(shape, values.shape, strict=True)
        )
        if not fits or not np.isfinite(values).all():
            self._refuse(name, wanted)
        return values

    def _positive(self, name: str, value: float) -> None:
        if not value > 0:
            self._refuse(name, "a mass above 0 kg")

    def _refuse(self, name: str, wanted: str) -> Any:
        raise IdentificationError(
            f"the prior '{self._path}' expects {wanted} for {name}, got something else; correct it"
        )


def _units(given: Any, path: Path) -> int:
    """Number of units of the fleet; 0 without the table [fleet]."""
    units = 0 if given is None else given.get("units") if isinstance(given, dict) else None
    if isinstance(units, int) and not isinstance(units, bool) and units >= 0:
        return units
    raise IdentificationError(
        f"the prior '{path}' expects units = a number of units in [fleet], got {given!r:.60}; "
        "compute it again with: fleet DIR"
    )


def _trust(given: Any, path: Path) -> float | None:
    if given is None:
        return None
    if isinstance(given, str) and given in TRUST:
        return TRUST[given]
    if (
        isinstance(given, int | float)
        and not isinstance(given, bool)
        and 0 < given <= _LARGEST_TRUST
    ):
        return float(given)
    raise IdentificationError(
        f"the prior '{path}' needs trust = {', '.join(TRUST)} or a number above 0, got {given!r}"
    )


def read_armature(facts: dict[str, Any], path: Path, lib: Library) -> Array | None:
    """Rotor inertia that a file of priors states.

    Returns (n, 2) [kg·m², kg].
    """
    stated: dict[str, Any] = {}
    if "armature_from" in facts:
        stated |= _from_model(path, facts["armature_from"], lib)
    given = facts.get("armature", {})
    if not isinstance(given, dict):
        raise IdentificationError(
            f"the prior '{path}' expects a table [armature] with joint = kg·m², got {given!r:.40}"
        )
    unknown = [name for name in given if name not in lib.joint_names]
    if unknown:
        raise IdentificationError(
            f"the prior '{path}' has the unknown joint '{unknown[0]}' under [armature]; known are "
            f"{', '.join(lib.joint_names)}"
        )
    stated |= given
    if not stated:
        return None
    values = np.tile([0.0, np.inf], (lib.n_joints, 1))
    for name, value in stated.items():
        values[lib.joint_names.index(name)] = _pair(name, value, path)
    return values


def friction_prior_of(armature: Array, columns: tuple[str, ...]) -> FrictionPrior:
    """Prior of the friction coefficients.

    armature (n, 2) [kg·m², kg] → (n, k).
    """
    if ROTOR.name not in columns:
        raise IdentificationError(
            "the prior states armature, but rotor inertia is not among the friction columns "
            f"{', '.join(columns) or 'none'}; add rotor to --friction"
        )
    shape = (len(armature), len(columns))
    mean, sigma = np.zeros(shape), np.full(shape, np.inf)
    k = columns.index(ROTOR.name)
    mean[:, k], sigma[:, k] = armature.T
    return FrictionPrior(mean, sigma)


def _from_model(path: Path, name: object, lib: Library) -> dict[str, float]:
    """Armature per joint of this robot that an MJCF or URDF states."""
    place = path.parent / name if isinstance(name, str) else path
    try:
        text = text_of(place)
        if not isinstance(name, str) or "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise ValueError("a document type is not read")
        tree = ElementTree.fromstring(text)  # noqa: S314  without entities
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise IdentificationError(
            f"armature_from of the prior '{path}' expects an MJCF or URDF beside it, but '{place}' "
            f"cannot be read ({error}); correct the name"
        ) from None
    values: dict[str, float] = {}
    for joint in tree.iter("joint"):
        dynamics = joint.find("dynamics")
        written = joint.get("armature") or (dynamics is not None and dynamics.get("armature"))
        if joint.get("name") in lib.joint_names and written:
            try:
                values[str(joint.get("name"))] = float(written)
            except ValueError:
                values[str(joint.get("name"))] = math.nan  # refused with its joint
    if not values:
        raise IdentificationError(
            f"'{place}' states no armature for a joint of '{lib.name}' "
            f"({', '.join(lib.joint_names)}); leave out armature_from"
        )
    return {joint: value for joint, value in values.items() if value != 0}


def _pair(joint: str, given: Any, path: Path) -> tuple[float, float]:
    """Value and standard deviation of one entry."""
    pair = given if isinstance(given, list) else [given, given]
    if len(pair) == 2 and all(_is_positive(each) for each in pair):
        sigma = pair[1] if isinstance(given, list) else SHARE * given
        return float(pair[0]), float(sigma)
    raise IdentificationError(
        f"the prior '{path}' expects kg·m² above 0, or [kg·m², σ], as armature of {joint}, got "
        f"{given!r:.40}; correct it"
    )


def _is_positive(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and 0 < value < LARGEST_ROTOR
