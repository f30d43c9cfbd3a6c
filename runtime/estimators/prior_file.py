"""TOML file of inertial priors: what is known of the bodies of a robot before identification.

    trust = "cad"                     # cad | gripper | none, or κ itself
    total_mass = [17.0, 18.5]         # kg; one number holds exactly
    armature_from = "robot.xml"       # armature of <joint> in an MJCF, of its <dynamics> in a URDF

    [link.fr3_link7]
    mass = [0.5, 1.5]                 # kg
    com_box = [[-0.1, -0.1, 0.0], [0.1, 0.1, 0.1]]    # m, lowest and highest corner, link frame
    com_hull = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]
    symmetry = ["xz"]                 # planes of the link frame through its origin

    [armature]
    joint1 = 0.15                     # kg·m², σ half of it: a data sheet's times a squared ratio
    joint2 = [0.057, 0.01]            # value and σ

    [centre]                          # this and what follows is of a type, written by `fleet`
    fr3_link1 = [m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ]  # SI, about the link frame

    [friction]
    coulomb_speed = 0.02              # rad/s, width that the values belong to

    [friction.fr3_joint1]
    viscous = [0.51, 0.05]            # value and standard deviation

    [noise]
    inflation = 14.0                  # N/N_eff
    fr3_joint1 = 0.1                  # N·m, standard deviation of the torque's residual

Every entry is optional and those of bodies are linear in π. A link that is not listed keeps the
inertia of the URDF.
"""

import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NoReturn
from xml.etree import ElementTree

import numpy as np
from msgspec import Meta, field
from scipy.spatial import ConvexHull, QhullError

from runtime.common.files import text_of
from runtime.common.records import Record, Vector3, record_from_toml
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, GRIPPER, NONE, bodies_of
from runtime.estimators.convex.newton import ConstraintRow, Constraints
from runtime.estimators.problem import FrictionPrior, NoiseFloor
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, PI_NAMES, links
from runtime.recording import Friction
from runtime.recording.settings import COLUMNS, WIDTHS, widths_of

LARGEST_PRIOR = 1e9  # largest number of the tables [SI]
INFLATION = "inflation"
ALIKE = 1e-9  # relative difference below which two widths are the same

Real = Annotated[float, Meta(gt=-LARGEST_PRIOR, lt=LARGEST_PRIOR)]
Least = Annotated[float, Meta(ge=0, lt=LARGEST_PRIOR)]
Above = Annotated[float, Meta(gt=0, lt=LARGEST_PRIOR)]
_TEN = f"{N_PARAMETERS} numbers {', '.join(PI_NAMES)}"
_Body = Meta(min_length=N_PARAMETERS, max_length=N_PARAMETERS, description=_TEN)
BodyTables = dict[str, Annotated[tuple[Real, ...], _Body]]  # [centre]: π0 of links
Pair = Annotated[tuple[Real, Above], Meta(description="[value, σ] with σ above 0")]
FrictionTables = dict[str, Annotated[Above, Meta(description="a width above 0")] | dict[str, Pair]]
"""[friction]: widths, and per joint a table of columns."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownFriction:
    """Friction coefficients of a type."""

    columns: tuple[str, ...]  # names of columns
    widths: dict[str, float]  # name → width [rad/s, rad], of the columns that depend on one
    mean: Array  # value per joint and column, (n, k) [N·m per unit of the column]
    sigma: Array  # standard deviations, (n, k); infinite where nothing is known

    @property
    def model(self) -> Friction:
        """Friction model with these columns and widths."""
        return Friction.from_facts({"columns": self.columns, **self.widths})

    def of(self, friction: Friction, columns: tuple[str, ...]) -> FrictionPrior:
        """Prior of the coefficients of a friction model.

        Args:
            friction: model with its widths.
            columns: names of its columns.

        Returns:
            The prior of the columns that both have, and none of the others.
        """
        for name in widths_of(tuple(set(columns) & set(self.columns))) & set(self.widths):
            known, now = self.widths[name], float(np.mean(getattr(friction, name)))
            if abs(known - now) > ALIKE * known:
                way = "use the same width in the recipe"
                if name == "coulomb_speed":
                    way = f"give --settings coulomb_speed={known:g}"
                raise IdentificationError(
                    f"the friction of the prior belongs to {name} = {known:g}, but this log is "
                    f"identified with {now:g}; {way}"
                )
        shared = [name for name in columns if name in self.columns]
        to, of = ([each.index(name) for name in shared] for each in (columns, self.columns))
        shape, places = (len(self.mean), len(columns)), np.s_[:, to]
        return FrictionPrior.of_some(shape, places, self.mean[:, of], self.sigma[:, of])


def centre_of(stated: BodyTables, where: str, lib: Library) -> Array:
    """Centre of a type, (10 n,) [kg, kg·m, kg·m²]."""
    require_known("centre", stated, lib.link_names, where)
    centre = lib.pi0.copy()
    for name, body in stated.items():
        links(centre)[lib.link_names.index(name)] = body
    if bodies_of(lib).log_det(centre) is None:
        names = ", ".join(np.array(lib.link_names)[lib.relative_eigenvalues(centre) <= 0])
        _refuse(where, "physically consistent bodies in [centre]", f"another one for {names}")
    return centre


def friction_of(stated: FrictionTables, where: str, lib: Library) -> KnownFriction:
    """Friction of a type."""
    require_known("friction", stated.keys() - WIDTHS, lib.joint_names, where)
    widths = {key: entry for key, entry in stated.items() if isinstance(entry, float)}
    tables = {joint: entry for joint, entry in stated.items() if isinstance(entry, dict)}
    for name in [*(widths.keys() - WIDTHS), *(tables.keys() & WIDTHS)]:
        kind = "a width above 0" if name in WIDTHS else "a table of columns"
        _refuse(where, f"{kind} for friction.{name}", stated[name])
    columns = tuple(dict.fromkeys(column for table in tables.values() for column in table))
    shape = (lib.n_joints, len(columns))
    mean, sigma = np.zeros(shape), np.full(shape, np.inf)
    for joint, table in tables.items():
        require_known(f"friction.{joint}", table, COLUMNS, where)
        for column, pair in table.items():
            at = lib.joint_names.index(joint), columns.index(column)
            mean[at], sigma[at] = pair
    return KnownFriction(columns, widths, mean, sigma)


def noise_of(stated: dict[str, float], where: str, lib: Library) -> NoiseFloor:
    """Noise of a type."""
    require_known("noise", stated, (INFLATION, *lib.joint_names), where)
    inflation = stated.get(INFLATION, 1.0)
    if inflation < 1:
        _refuse(where, f"a number of at least 1 for noise.{INFLATION}", inflation)
    return NoiseFloor(np.array([stated.get(name, 0.0) for name in lib.joint_names]), inflation)


def require_known(place: str, names: Iterable[str], known: Iterable[str], where: str) -> None:
    """Refuse a name of a link, joint or column that a table states and the robot lacks."""
    for name in names:
        if name not in known:
            raise IdentificationError(
                f"{where} has the unknown entry '{place}.{name}'; known are {', '.join(known)}"
            )


def _refuse(where: str, wanted: str, came: object) -> NoReturn:
    raise IdentificationError(f"{where} expects {wanted}, got {came!s:.60}; correct it")


LARGEST_ROTOR = 1e6  # limit of a rotor inertia [kg·m², kg]
SHARE = 0.5  # standard deviation over the value where none is stated
TRUST = {"cad": CAD, "gripper": GRIPPER, "none": NONE}
MIRRORED = {"xy": ("mZ", "XZ", "YZ"), "xz": ("mY", "XY", "YZ"), "yz": ("mX", "XY", "XZ")}
"""Entries of π that vanish for a body that is symmetric about a plane of its link frame."""
_MASS = "a mass above 0 kg or [lowest, highest] in kg"
_BOX = "[[x, y, z], [x, y, z]] in m, lowest and highest corner"
_HULL = "at least four points [x, y, z] in m, not in one plane"
_ROTOR = "kg·m² above 0, or [kg·m², σ]"

Mass = Annotated[float | tuple[float, float], Meta(description=_MASS)]
Plane = Literal["xy", "xz", "yz"]
Planes = Annotated[tuple[Plane, ...], Meta(min_length=1)]
Symmetry = Annotated[Plane | Planes, Meta(description=f"a list of {', '.join(MIRRORED)}")]
Kappa = Annotated[float, Meta(gt=0, le=sys.float_info.max)]
Trust = Literal["cad", "gripper", "none"] | Kappa
_TRUST = Meta(description=f"one of {', '.join(TRUST)} or a number above 0")


class LinkPrior(Record, frozen=True):
    """[link.NAME]."""

    mass: Mass | None = None
    com_box: Annotated[tuple[Vector3, Vector3], Meta(description=_BOX)] | None = None
    com_hull: Annotated[tuple[Vector3, ...], Meta(min_length=4, description=_HULL)] | None = None
    symmetry: Symmetry | None = None


class Fleet(Record, frozen=True, forbid_unknown_fields=False):
    """[fleet], of which only the number of units is read."""

    units: Annotated[int, Meta(ge=0, description="a number of units, as fleet DIR writes it")]


class Stated(Record, frozen=True):
    """The file; a table of links or joints has their names as keys."""

    trust: Annotated[Trust, _TRUST] | None = None
    total_mass: Mass | None = None
    link: dict[str, LinkPrior] = field(default_factory=dict)
    armature: dict[str, Annotated[float | tuple[float, float], Meta(description=_ROTOR)]] = field(
        default_factory=dict
    )
    armature_from: str | None = None
    centre: BodyTables | None = None
    friction: FrictionTables | None = None
    noise: dict[str, Least] | None = None
    fleet: Annotated[Fleet, Meta(description="a table with units")] | None = None


@dataclass(frozen=True, slots=True)
class PriorFile:
    """Contents of a file of inertial priors."""

    kappa: float | None  # trust κ in the URDF; None where the file does not state it
    constraints: Constraints  # linear priors
    # rotor inertia and its standard deviation per joint, (n, 2) [kg·m², kg], infinite without a
    # prior; None where the file states none
    armature: Array | None = None
    # π0 of the type of robot, (10 n,) [kg, kg·m, kg·m²], in place of the URDF's; None where the
    # file states none
    centre: Array | None = None
    friction: KnownFriction | None = None  # friction coefficients of the type; None if not stated
    units: int = 0  # number of units of the fleet that the prior was computed from; 0 for none
    noise: NoiseFloor | None = None  # least torque noise of the type; None if not stated

    @property
    def friction_model(self) -> Friction | None:
        """Friction model that the units of a fleet share; None for a prior of other origin."""
        return self.friction.model if self.friction and self.units else None


def read_prior(path: Path, lib: Library) -> PriorFile:
    """Read a file of inertial priors and check it against a robot."""
    where = f"the prior '{path}'"
    stated = record_from_toml(Stated, path, where, IdentificationError)
    require_known("link", stated.link, lib.link_names, where)
    require_known("armature", stated.armature, lib.joint_names, where)
    rows = _Rows(lib, where)
    if stated.total_mass is not None:
        rows.interval("total_mass", stated.total_mass, lib.link_names)
    for link, prior in stated.link.items():
        if prior.mass is not None:
            rows.interval(f"{link}.mass", prior.mass, (link,))
        if prior.com_box is not None:
            rows.box(link, prior.com_box)
        if prior.com_hull is not None:
            rows.hull(link, prior.com_hull)
        if prior.symmetry is not None:
            rows.symmetry(link, prior.symmetry)
    return PriorFile(
        TRUST[stated.trust] if isinstance(stated.trust, str) else stated.trust,
        Constraints(tuple(rows.equations), tuple(rows.bounds)),
        _armature(stated, path, lib),
        None if stated.centre is None else centre_of(stated.centre, where, lib),
        None if stated.friction is None else friction_of(stated.friction, where, lib),
        stated.fleet.units if stated.fleet else 0,
        None if stated.noise is None else noise_of(stated.noise, where, lib),
    )


class _Rows:
    """Equations and bounds, collected entry by entry."""

    def __init__(self, lib: Library, where: str) -> None:
        self._lib, self._where = lib, where
        self.equations: list[ConstraintRow] = []
        self.bounds: list[ConstraintRow] = []

    def interval(
        self, name: str, given: float | tuple[float, float], links: tuple[str, ...]
    ) -> None:
        """Add Σ m = value, or lowest ≤ Σ m ≤ highest."""
        low, high = given if isinstance(given, tuple) else (given, given)
        if not high > 0 or low > high:
            _refuse(self._where, f"{_MASS} for {name}", given)
        total = np.asarray(sum(self._unit(link, "m") for link in links))
        if isinstance(given, tuple):
            self.bounds += [ConstraintRow(name, total, high), ConstraintRow(name, -total, -low)]
        else:
            self.equations.append(ConstraintRow(name, total, given))

    def box(self, link: str, corners: tuple[Vector3, Vector3]) -> None:
        """Add lowest ≤ c ≤ highest as lowest m ≤ m c ≤ highest m."""
        name, (low, high) = f"{link}.com_box", np.array(corners)
        if not (low <= high).all():
            _refuse(self._where, f"{_BOX} for {name}", corners)
        mass = self._unit(link, "m")
        for axis, key in enumerate(("mX", "mY", "mZ")):
            moment = self._unit(link, key)
            for row in (moment - high[axis] * mass, low[axis] * mass - moment):
                self.bounds.append(ConstraintRow(name, row, 0.0))

    def hull(self, link: str, points: tuple[Vector3, ...]) -> None:
        """Add that c lies in the convex hull of points: n·(m c) + d m ≤ 0 for its facets."""
        name = f"{link}.com_hull"
        try:
            facets = ConvexHull(np.array(points)).equations
        except (QhullError, ValueError):
            _refuse(self._where, f"{_HULL} for {name}", points)
        moments = np.array([self._unit(link, key) for key in ("mX", "mY", "mZ")])
        mass = self._unit(link, "m")
        for facet in facets:
            self.bounds.append(ConstraintRow(name, facet[:3] @ moments + facet[3] * mass, 0.0))

    def symmetry(self, link: str, given: Plane | tuple[Plane, ...]) -> None:
        """Add that m c and the products of inertia across planes vanish."""
        name, planes = f"{link}.symmetry", given if isinstance(given, tuple) else (given,)
        for key in sorted({key for plane in planes for key in MIRRORED[plane]}):
            self.equations.append(ConstraintRow(name, self._unit(link, key), 0.0))

    def _unit(self, link: str, key: str) -> Array:
        row = np.zeros(self._lib.pi0.size)
        links(row)[self._lib.link_names.index(link), PI_NAMES.index(key)] = 1.0
        return row


def _armature(stated: Stated, path: Path, lib: Library) -> Array | None:
    """Rotor inertia and standard deviation (n, 2) [kg·m², kg]."""
    read = {} if stated.armature_from is None else _from_model(path, stated.armature_from, lib)
    values = np.tile([0.0, np.inf], (lib.n_joints, 1))
    entries = {**read, **stated.armature}
    for name, given in entries.items():
        pair = given if isinstance(given, tuple) else (given, SHARE * given)
        if not all(0 < each < LARGEST_ROTOR for each in pair):
            raise IdentificationError(
                f"the prior '{path}': armature.{name} expects {_ROTOR}, got {given!r:.40}; "
                "correct it"
            )
        values[lib.joint_names.index(name)] = pair
    return values if entries else None


def _from_model(path: Path, name: str, lib: Library) -> dict[str, float]:
    """Armature per joint of this robot that an MJCF or URDF states."""
    place = path.parent / name
    try:
        text = text_of(place)
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
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
