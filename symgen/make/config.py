"""Configuration of a robot beyond its URDF: home, limits of drives and controller, proxies.

It is read from a TOML file beside the URDF and written into the manifest. Without a home, that of
coupled joints with limits, lower ≤ A q + b ≤ upper, leaves every joint the largest share t of half
of its range to both ends: max t with lower + t r ≤ A q + b ≤ upper − t r, r = (upper − lower)/2.

`reduced_config` is what remains for a robot that was cut or locked: values of the joints that still
move; proxies of links beyond --tip and below --base go; the link of a locked joint is fixed to its
parent, in whose frame its proxy gets the pose of the joint at the locked value.
"""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio
from msgspec import Meta, structs
from scipy.optimize import linprog

from runtime.common.records import Record, record_from_table, record_from_toml
from symgen.chain import Chain, Joint
from symgen.chain.coupling import Coupling
from symgen.chain.document import Document
from symgen.chain.reading import parse_with_pinocchio
from symgen.collision.model import BASE, CollisionModel, Pair, Proxy
from symgen.errors import BuildError

ROOM = 0.1  # share of half a range, or rad or m of a range with one end, that is enough at home
_MOST = 1.0  # upper bound of t: the middle of the range

Vector = Annotated[
    tuple[float, ...], Meta(min_length=1, description="a list of finite numbers, one per joint")
]
Above = Annotated[float, Meta(gt=0)]
Limit = Annotated[
    tuple[Above, ...], Meta(min_length=1, description="limits above 0 for every joint")
]


class Braking(Record, frozen=True):
    """Velocity limits that decrease towards the ends of the position range, per joint.

    max(0, dq + c)² ≤ k (upper − q) and max(0, c − dq)² ≤ k (q − lower): the remaining range
    suffices to brake. Convex in (q, dq).
    """

    k: Limit  # rad/s² or m/s²
    # rad/s or m/s
    c: Annotated[
        tuple[Annotated[float, Meta(ge=0)], ...],
        Meta(min_length=1, description="speeds not below 0 for every joint"),
    ]
    upper: Vector  # upper, lower: rad or m, slightly outside the position limits
    lower: Vector


class RobotConfig(Record, frozen=True):
    """The TOML file: facts that a URDF does not contain; None where unknown."""

    home: Vector | None = None  # rad or m, per joint
    acceleration: Limit | None = None  # limit per joint, rad/s² or m/s²
    jerk: Limit | None = None  # limit per joint, rad/s³ or m/s³
    torque_rate: Limit | None = None  # limit per joint, N·m/s or N/s
    tip_speed: Above | None = None  # limit of the speed of the tip, m/s
    braking: Braking | None = None  # velocity limits near the ends of the range
    proxy: tuple[Proxy, ...] = ()  # capsules around the links
    pair: tuple[Pair, ...] = ()  # pairs of them that a motion keeps apart

    @property
    def collision(self) -> CollisionModel:
        """Proxies and pairs."""
        return CollisionModel(self.proxy, self.pair)

    def vectors(self) -> dict[str, Vector]:
        """Quantities with one value per joint, by their name in the TOML file."""
        vectors = {key: getattr(self, key) for key in _VECTORS}
        if self.braking is not None:
            sides = structs.asdict(self.braking)
            vectors |= {f"braking.{key}": value for key, value in sides.items()}
        return {key: value for key, value in vectors.items() if value is not None}


_VECTORS = ("home", "acceleration", "jerk", "torque_rate")
CONFIG_KEYS = RobotConfig.__struct_fields__  # keys of TOML file and manifest, None where unknown


def read_config(*paths: Path) -> RobotConfig:
    """Read the configuration of one TOML file, or of several with different keys."""
    joined: dict[str, Any] = {}
    for path in paths:
        table = record_from_toml(
            dict[str, Any], path, f"the robot configuration '{path}'", BuildError
        )
        table.pop("source", None)
        twice = sorted(joined.keys() & table.keys())
        if twice:
            raise BuildError(f"'{path}' gives {', '.join(twice)} once more; keep one of them")
        joined |= table
    return config_from_table(joined, " and ".join(f"'{path}'" for path in paths))


def read_masses(path: Path) -> dict[str, float]:
    """Masses of links from a TOML file, kg."""
    kind = dict[str, Annotated[float, Meta(description="a mass in kg")]]
    masses = record_from_toml(kind, path, f"the masses '{path}'", BuildError)
    if not masses:
        raise BuildError(f"'{path}' states no mass; write lines such as link1 = 2.7")
    return masses


def config_from_table(table: dict[str, Any], where: str) -> RobotConfig:
    """Return the configuration of a parsed TOML table."""
    config = record_from_table(RobotConfig, table, where, BuildError)
    CollisionModel(config.proxy, config.pair)  # checks them
    return config


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


def within_couplings(
    chain: Chain, coupling: Coupling, usual: tuple[float, ...]
) -> tuple[float, ...]:
    """A home (n,) [rad, m] at which coupled joints have room to both sides."""
    # A joint with one master has already narrowed the range of that one.
    every = range(len(coupling.matrix))
    rows = [k for k in every if k in coupling.independent or len(coupling.masters(k)) > 1]
    matrix, offset = np.array(coupling.matrix)[rows], np.array(coupling.offset)[rows]
    lower, upper = np.array([chain.single_joints[k].ends() for k in rows]).T
    both = np.isfinite(lower) & np.isfinite(upper)
    with np.errstate(invalid="ignore"):
        half = np.where(both, (upper - lower) / 2, 1.0)
    x = matrix @ np.array(usual) + offset
    several = ~np.isin(rows, coupling.independent)
    if (np.minimum(x - lower, upper - x) >= ROOM * half)[several].all():
        return usual
    return _roomiest(matrix, offset, lower, upper, half) or usual


def _roomiest(
    matrix: np.ndarray, offset: np.ndarray, lower: np.ndarray, upper: np.ndarray, half: np.ndarray
) -> tuple[float, ...] | None:
    """Solution q of the programme; None where no posture has room."""
    up, down = np.isfinite(upper), np.isfinite(lower)
    rows = np.vstack([np.column_stack([matrix, half])[up], np.column_stack([-matrix, half])[down]])
    ends = np.concatenate([(upper - offset)[up], (offset - lower)[down]])
    n = matrix.shape[1]
    bounds = [*[(None, None)] * n, (None, _MOST)]
    answer = linprog(np.append(np.zeros(n), -1.0), rows, ends, bounds=bounds)
    if answer.x is None or not answer.x[-1] > 0:
        return None
    return tuple(float(f"{value:.6g}") for value in answer.x[:-1])


def reduced_config(config: RobotConfig, whole: Chain, chain: Chain) -> RobotConfig:
    """Configuration of a chain from that of the whole robot."""
    names = [joint.name for joint in whole.coordinates]
    kept = [names.index(joint.name) for joint in chain.coordinates]

    def of_joints(values: Any) -> Any:
        if values is None or len(values) != len(names):
            return values
        return tuple(values[k] for k in kept)

    facts: dict[str, Any] = {key: of_joints(getattr(config, key)) for key in _VECTORS}
    if config.braking is not None:
        sides: dict[str, Any] = structs.asdict(config.braking)
        facts["braking"] = Braking(**{key: of_joints(value) for key, value in sides.items()})
    robot = parse_with_pinocchio(Document(chain.urdf))
    carried = (_carried(proxy, robot, whole, chain) for proxy in config.proxy)
    proxies = tuple(proxy for proxy in carried if proxy is not None)
    carrier = {proxy.name: proxy.link for proxy in proxies}
    pairs = tuple(
        pair
        for pair in config.pair
        if pair.first in carrier
        and pair.second in carrier
        and carrier[pair.first] != carrier[pair.second]  # their distance does not change
    )
    return config.replace(**facts, proxy=proxies, pair=pairs)


def _carried(proxy: Proxy, robot: pinocchio.Model, whole: Chain, chain: Chain) -> Proxy | None:
    """The proxy on the link that carries it now; None where its link was cut off."""
    link = whole.base if proxy.link == BASE else proxy.link
    if not robot.existFrame(link, pinocchio.BODY):
        return None
    frame = robot.frames[robot.getFrameId(link, pinocchio.BODY)]
    joint = int(frame.parentJoint) - 1
    carrier = BASE if joint < 0 else chain.joints[joint].link
    if carrier == proxy.link:
        return proxy
    ends = [frame.placement.act(np.array(point)) for point in (proxy.start, proxy.end)]
    start, end = (tuple(float(x) for x in point) for point in ends)
    return proxy.replace(link=carrier, start=start, end=end)
