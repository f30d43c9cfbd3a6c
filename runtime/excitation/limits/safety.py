"""What a design keeps beyond position, velocity and acceleration: numbers of `Safety`.

By default all that the manifest of the robot states; a table, a box of the tip and obstacles on
request. A certificate does not check what neither states; an export needs consent for it.

A body in the hand is rigid in a moving link. It adds its ten parameters to those of the link; its
box keeps a distance from other links and from a table. An obstacle is a box fixed in the base frame
and grown by a radius, which includes spheres (no edges) and capsules (one edge).
"""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta
from msgspec.structs import asdict
from scipy.spatial.transform import Rotation

from runtime.common.records import Record, Vector3, record_from_toml
from runtime.errors import ExportError, IdentificationError
from runtime.excitation.limits.distance_limits import OBSTACLE, PlacedBox
from runtime.library import Array, Library
from runtime.library.parameters import link_columns

TORQUE, BRAKING, RATE, TIP = "torque", "position-dependent velocity", "torque rate", "tip speed"
SELF_COLLISION, TABLE, CARRIED = "self-collision", "table", "carried body"
SPRINGS = "springs of unknown stiffness"
UNCHECKED = (TORQUE, BRAKING, RATE, TIP, SELF_COLLISION, TABLE, CARRIED, SPRINGS)
"""Kinds of limits that a certificate may leave out."""
EVERYTHING = "all"  # word that accepts all of them
EMPTY_HAND = "empty hand"  # what a certificate states of the load where no body is carried
LARGEST_LENGTH = 100.0  # largest coordinate, edge or radius [m]
_REMEDIES = {
    TABLE: "--table Z for a table at this height or --table none",
    SELF_COLLISION: "a library with collision proxies (python -m symgen proxies)",
    CARRIED: "a box in --carry",
    SPRINGS: "a library with their stiffness, which identify estimates",
}


@dataclass(frozen=True, slots=True)
class CarriedBox:
    """A box fixed in a link; picklable."""

    center: tuple[float, ...]  # in the link's frame, (3,) m
    rotation: tuple[tuple[float, ...], ...]  # axes of the box in the link's frame, rows of (3, 3)
    size: tuple[float, ...]  # lengths of its edges, (3,) m

    def __post_init__(self) -> None:
        if not (np.isfinite([*self.center, *self.size]).all() and min(self.size) > 0):
            raise IdentificationError(
                "the box of a carried body needs a finite place and edges above 0 m, got edges of "
                f"{', '.join(f'{x:g}' for x in self.size)} m"
            )

    def placed(self, link: int) -> PlacedBox:
        """The box in its link."""
        return PlacedBox(
            link, np.array(self.center), np.array(self.rotation), np.array(self.size) / 2
        )


@dataclass(frozen=True, slots=True)
class CarriedBody:
    """A body that moves with a link; picklable."""

    link: int  # index of the moving link that carries it
    pi: tuple[float, ...]  # its parameters in that link's frame, (10,): kg, kg·m ×3, kg·m² ×6
    box: CarriedBox | None = None  # box around it, or None where its shape is not known

    @property
    def sentence(self) -> str:
        """Mass and box, for certificates."""
        if self.box is None:
            return f"{self.pi[0]:g} kg, no box"
        edges = " x ".join(f"{1e3 * edge:g}" for edge in self.box.size)
        return f"{self.pi[0]:g} kg in a box of {edges} mm"


def with_load(pi: Array, body: CarriedBody | None) -> Array:
    """Parameters (10 n,) of the links with a carried body, π_link + π_body."""
    if body is None:
        return pi
    loaded = pi.copy()
    loaded[link_columns(body.link)] += body.pi
    return loaded


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A box grown by a radius, fixed in the base frame; picklable."""

    name: str  # in certificates
    center: tuple[float, ...]  # (3,) m
    size: tuple[float, ...] = (0.0, 0.0, 0.0)  # lengths of the edges, (3,) m; zeros are a sphere
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)  # Rz(yaw) Ry(pitch) Rx(roll) of the box, rad
    radius: float = 0.0  # of the rounding, m

    def __post_init__(self) -> None:
        vectors = self.center, self.size, self.rpy
        numbers = np.array([x for vector in vectors for x in vector] + [self.radius])
        shaped = all(len(vector) == 3 for vector in vectors)
        if not (shaped and (np.abs(numbers) <= LARGEST_LENGTH).all()):  # false for NaN, too
            raise IdentificationError(
                f"the obstacle '{self.name}' needs center, size and rpy of three finite numbers "
                f"and a radius, up to {LARGEST_LENGTH:g} m; correct them"
            )
        if min(*self.size, self.radius) < 0 or max(*self.size, self.radius) == 0:
            raise IdentificationError(
                f"the obstacle '{self.name}' needs edges and a radius from 0 m up of which one is "
                "above 0 m; correct size or radius"
            )

    @property
    def placed(self) -> PlacedBox:
        """The box in the base frame."""
        turn = np.asarray(Rotation.from_euler("xyz", self.rpy).as_matrix())
        center, half = np.array(self.center), np.array(self.size) / 2
        return PlacedBox(-1, center, turn, half, self.radius)


class _Entry(Record, frozen=True, kw_only=True):
    """[[obstacle]]."""

    name: str = ""
    center: Vector3
    size: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)
    radius: float = 0.0


class _Cell(Record, frozen=True):
    """The file."""

    obstacle: Annotated[tuple[_Entry, ...], Meta(min_length=1)]


def read_obstacles(path: Path) -> tuple[Obstacle, ...]:
    """Read a file of obstacles.

    [[obstacle]]
    name = "post"
    center = [0.4, 0.3, 0.5]    # m in the base frame
    size = [0.1, 0.1, 1.0]      # m, edges; left out for a sphere
    rpy = [0.0, 0.0, 0.0]       # rad
    radius = 0.0                # m, rounding
    """
    cell = record_from_toml(_Cell, path, f"the obstacles '{path}'", IdentificationError)
    return tuple(
        Obstacle(**asdict(each.replace(name=each.name or f"{OBSTACLE} {k}")))
        for k, each in enumerate(cell.obstacle, 1)
    )


@dataclass(frozen=True, slots=True)
class Safety:
    """Limits of a design beyond those of the joints; picklable."""

    torque_fraction: float = 0.95  # share of the effort limit that may be used, 0 < share ≤ 1
    # margin of pairs, table and obstacles, m; by default the margins of the pairs and
    # `TABLE_MARGIN` of `distances`. Pairs that the robot allows closer than its others keep their
    # margin
    clearance: float | None = None
    table: float | None = None  # nothing goes below this height, m in the base frame
    box: tuple[float, ...] | None = None  # xmin, xmax, … zmax of the tip, base frame, m; ±inf: open
    viscous: tuple[float, ...] = ()  # viscous, coulomb: per joint, N·m·s/rad and N·m, or empty
    coulomb: tuple[float, ...] = ()
    carried: CarriedBody | None = None  # body in the hand, part of torques and distances
    obstacles: tuple[Obstacle, ...] = ()  # fixed in the base frame; links keep away from them
    band: tuple[float, ...] = ()  # half-widths of π within which torques keep limits, (10 L,)
    friction_band: float = 0.0  # half-width of viscous and Coulomb friction, as a share of both

    @property
    def models(self) -> str:
        """Models whose torques keep the limits, for certificates; empty for one model."""
        masses = ", ".join(f"{1e3 * mass:.4g} g" for mass in self.band[::10] if mass > 0)
        stated = [f"masses ± {masses}"] if masses else []
        if self.friction_band:
            stated.append(f"friction ± {100 * self.friction_band:g} %")
        return " and ".join(stated)

    def __post_init__(self) -> None:
        require_share(self.torque_fraction, "a torque fraction", "the effort limit unused")
        if self.clearance is not None and not 0 <= self.clearance < np.inf:
            raise IdentificationError(
                f"a clearance from 0 m up is needed, got {self.clearance:g}; 0.02 is usual"
            )
        if self.table is not None and not np.isfinite(self.table):
            raise IdentificationError(
                f"the table needs a finite height in m in the base frame, got {self.table:g}"
            )
        if (box := self.box) is not None:
            if len(box) != 6 or np.isnan(box).any():
                raise IdentificationError(
                    "a box for the tip needs xmin, xmax, ymin, ymax, zmin, zmax in m, got "
                    + ", ".join(f"{x:g}" for x in box)
                )
            for axis, low, high in zip("xyz", box[::2], box[1::2], strict=True):
                if not low < high:
                    raise IdentificationError(
                        f"the box for the tip is empty: {axis} from {low:g} m to {high:g} m; "
                        f"give {axis}min below {axis}max"
                    )
        if not 0 <= self.friction_band < np.inf:
            raise IdentificationError(
                f"a band of friction from 0 up is needed, got {100 * self.friction_band:g} %; 20 % "
                "is usual"
            )
        given = {"viscous friction": self.viscous, "coulomb friction": self.coulomb}
        for name, numbers in (given | {"a band of models": self.band}).items():
            values = np.array(numbers, dtype=float)
            if not (np.isfinite(values) & (values >= 0)).all():
                raise IdentificationError(
                    f"{name} needs finite numbers from 0 up, got {values.tolist()}"
                )


def require_share(share: float, what: str, left: str) -> None:
    """Refuse a number that is no share above 0 and up to 1."""
    if not 0 < share <= 1:
        raise IdentificationError(
            f"{what} above 0 and up to 1 is needed, got {share:g}; 0.95 leaves 5 % of {left}"
        )


def unchecked(lib: Library, safety: Safety | None) -> tuple[str, ...]:
    """Kinds of limits that are not checked although they exist."""
    limits = lib.limits()
    if safety is None:
        stated = {
            BRAKING: lib.braking is not None,
            RATE: bool(np.isfinite(limits["torque_rate"]).any()),
            TIP: bool(np.isfinite(limits["tip_speed"])),
        }
        known = (kind for kind, is_stated in stated.items() if is_stated)
        return (TORQUE, *known, SELF_COLLISION, TABLE)
    missing: list[str] = []
    if not lib.pairs:
        missing.append(SELF_COLLISION)
    if safety.table is None:
        missing.append(TABLE)
    if safety.carried is not None and safety.carried.box is None:
        missing.append(CARRIED)
    of_torque = (limits[key] for key in ("effort", "torque_rate"))
    if lib.manifest.springs and any(np.isfinite(limit).any() for limit in of_torque):
        missing.append(SPRINGS)
    return tuple(missing)


def unstated(lib: Library) -> tuple[str, ...]:
    """Limits beyond those of the joints' motion that the robot does not state."""
    limits, names = lib.limits(), np.array(lib.joint_names)
    missing = []
    for key, what in (("effort", TORQUE), ("torque_rate", RATE)):
        free = ~np.isfinite(limits[key])
        if free.any():
            missing.append(f"{what} of {', '.join(names[free])}")
    if lib.braking is None:
        missing.append(BRAKING)
    if not np.isfinite(limits["tip_speed"]):
        missing.append(TIP)
    return tuple(missing)


def require_consent(missing: Collection[str], accepted: Collection[str]) -> None:
    """Check that every limit which is not checked was accepted as such."""
    known = {_word(kind) for kind in UNCHECKED}
    words = {_word(kind) for kind in accepted}
    if unknown := sorted(words - known - {EVERYTHING}):
        raise ExportError(
            f"the setting unchecked takes {', '.join(sorted(known))} or {EVERYTHING}, got "
            f"'{unknown[0]}'"
        )
    left = [] if EVERYTHING in words else [kind for kind in missing if _word(kind) not in words]
    if left:
        remedies = [_REMEDIES[kind] for kind in left if kind in _REMEDIES]
        if {TORQUE, BRAKING, RATE, TIP} & set(left):
            remedies.insert(0, "--criterion cond in place of --settings document=true")
        consent = " ".join(f"--settings unchecked={_word(kind)}" for kind in left)
        raise ExportError(
            f"nothing is exported for a robot, these limits are not checked: {', '.join(left)}; "
            f"give {', '.join(remedies)}, or accept that with {consent}"
        )


def _word(kind: str) -> str:
    return kind.strip().replace(" ", "-")
