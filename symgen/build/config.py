"""Configuration of a robot beyond its URDF: home, limits of drives and controller, proxies.

It is read from a TOML file beside the URDF and written into the manifest.
"""

import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from symgen.build.coupled_home import within_couplings
from symgen.chain import Chain, Joint
from symgen.collision import CollisionModel
from symgen.collision.tables import collision_from_tables
from symgen.documents import toml_of
from symgen.errors import BuildError

Vector = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Braking:
    """Velocity limits that decrease towards the ends of the position range, per joint.

    max(0, dq + c)² ≤ k (upper − q) and max(0, c − dq)² ≤ k (q − lower): the remaining range
    suffices to brake. Convex in (q, dq).

    Attributes:
        k: rad/s² or m/s².
        c: rad/s or m/s.
        upper, lower: rad or m, slightly outside the position limits.
    """

    k: Vector
    c: Vector
    upper: Vector
    lower: Vector


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """Facts that a URDF does not contain; None where unknown.

    Attributes:
        home: rad or m, per joint.
        acceleration: limit per joint, rad/s² or m/s².
        jerk: limit per joint, rad/s³ or m/s³.
        torque_rate: limit per joint, N·m/s or N/s.
        tip_speed: limit of the speed of the tip, m/s.
        braking: velocity limits near the ends of the range.
        collision: proxies and pairs.
    """

    home: Vector | None = None
    acceleration: Vector | None = None
    jerk: Vector | None = None
    torque_rate: Vector | None = None
    tip_speed: float | None = None
    braking: Braking | None = None
    collision: CollisionModel = field(default_factory=CollisionModel)

    def vectors(self) -> dict[str, Vector]:
        """Quantities with one value per joint, by their name in the TOML file."""
        vectors = {key: getattr(self, key) for key in _VECTORS}
        if self.braking is not None:
            vectors |= {f"braking.{key}": value for key, value in asdict(self.braking).items()}
        return {key: value for key, value in vectors.items() if value is not None}


_VECTORS = ("home", "acceleration", "jerk", "torque_rate")
_POSITIVE = {"acceleration", "jerk", "torque_rate"}
_COLLISION = ("proxy", "pair")
CONFIG_KEYS = (*_VECTORS, "tip_speed", "braking", *_COLLISION)
"""Keys of the TOML file; the manifest has the same keys, None where unknown."""


def read_config(*paths: Path) -> RobotConfig:
    """Read the configuration of one TOML file, or of several with different keys."""
    joined: dict[str, Any] = {}
    for path in paths:
        try:
            table = toml_of(path)
        except (OSError, ValueError) as error:
            raise BuildError(f"cannot read the robot configuration '{path}': {error}") from None
        table.pop("source", None)
        twice = sorted(joined.keys() & table.keys())
        if twice:
            raise BuildError(f"'{path}' gives {', '.join(twice)} once more; keep one of them")
        joined |= table
    return config_from_table(joined, " and ".join(f"'{path}'" for path in paths))


def read_masses(path: Path) -> dict[str, float]:
    """Masses of links from a TOML file, kg."""
    try:
        table = toml_of(path)
    except (OSError, ValueError) as error:
        raise BuildError(f"cannot read the masses '{path}': {error}") from None
    for link, mass in table.items():
        if not _is_number(mass):
            raise BuildError(f"'{path}': expected link = mass in kg, got '{link}' = {mass!r}")
    if not table:
        raise BuildError(f"'{path}' states no mass; write lines such as link1 = 2.7")
    return {link: float(mass) for link, mass in table.items()}


def config_from_table(table: dict[str, Any], where: str) -> RobotConfig:
    """Return the configuration of a parsed TOML table."""
    for key in table:
        if key not in CONFIG_KEYS:
            raise BuildError(
                f"{where} has the unknown key '{key}'; known are {', '.join(CONFIG_KEYS)}"
            )
    vectors = {key: _vector(table[key], key, where) for key in _VECTORS if key in table}
    for key in _POSITIVE & vectors.keys():
        if min(vectors[key]) <= 0:
            raise BuildError(
                f"{where}: {key} needs limits above 0 for every joint, got {min(vectors[key]):g}"
            )
    speed = table.get("tip_speed")
    if speed is not None and not (_is_number(speed) and speed > 0):
        raise BuildError(f"{where}: tip_speed needs a number above 0 m/s, got {speed!r}")
    return RobotConfig(
        **vectors,
        tip_speed=None if speed is None else float(speed),
        braking=_braking(table.get("braking"), where),
        collision=collision_from_tables(table.get("proxy", []), table.get("pair", []), where),
    )


def home_of(chain: Chain, config: RobotConfig) -> Vector:
    """Home position of a robot."""
    if config.home:
        return config.home
    if chain.loops is not None:
        return tuple(chain.loops.assembly[k] for k in chain.loops.independent)
    usual = tuple(_middle(joint) for joint in chain.coordinates)
    coupling = chain.coupling
    return usual if coupling is None else within_couplings(chain, coupling, usual)


def _middle(joint: Joint) -> float:
    """Zero where it lies well inside the limits, else the middle between them."""
    if joint.lower is None or joint.upper is None:
        return 0.0
    margin = 0.1 * (joint.upper - joint.lower)
    inside = joint.lower + margin <= 0.0 <= joint.upper - margin
    return 0.0 if inside else (joint.lower + joint.upper) / 2


def _braking(table: Any, where: str) -> Braking | None:
    if table is None:
        return None
    keys = tuple(Braking.__dataclass_fields__)
    if not isinstance(table, dict) or set(table) != set(keys):
        raise BuildError(f"{where}: braking needs exactly the lists {', '.join(keys)}")
    braking = Braking(**{key: _vector(table[key], f"braking.{key}", where) for key in keys})
    if min(braking.k) <= 0 or min(braking.c) < 0:
        raise BuildError(f"{where}: braking needs k above 0 and c not below 0 for every joint")
    return braking


def _vector(value: Any, key: str, where: str) -> Vector:
    if not isinstance(value, list) or not value or not all(map(_is_number, value)):
        raise BuildError(f"{where}: {key} needs a list of finite numbers, one per joint")
    return tuple(float(x) for x in value)


def _is_number(value: Any) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and abs(value) <= sys.float_info.max
