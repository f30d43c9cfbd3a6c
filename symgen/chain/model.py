"""Frozen `Chain`: joints, bodies and loop joints of a robot, with the inertias of moving bodies."""

import math
from dataclasses import dataclass, field

import numpy as np
import pinocchio

from symgen.chain.coupling import Coupling, MatrixRows, Vector
from symgen.chain.mechanism import Mechanism
from symgen.errors import UrdfError

LARGE = 20  # moving bodies above which a robot is large
FLOATING = "floating"  # kind of the joint of a free base
BASE_JOINT = "root_joint"  # name of the joint of a free base
BASE_FREEDOM = 6  # degrees of freedom of a free base
ROUNDING = 1e-12  # distance from 0 or ±1 within which entries of rotations and vectors snap


@dataclass(frozen=True, slots=True)
class Joint:
    """One moving joint and the body it moves; the joint frame is the frame of that link."""

    name: str
    kind: str  # revolute, continuous, prismatic, or floating for a free base
    parent: int  # index of the joint whose body carries this one, −1 for the base
    rotation: MatrixRows  # R from this joint's frame (at q = 0) to the parent's frame
    translation: Vector  # origin of this joint in the parent's frame, m
    axis: Vector  # unit vector in the joint frame
    lower: float | None  # lower, upper: position limits, rad or m; None without limit
    upper: float | None
    velocity: float | None  # velocity, effort: limits [rad/s, m/s; N·m, N]; None if not given
    effort: float | None
    link: str
    # mass, com, inertia: of the moved link with all bodies fixed to it [kg, m, kg·m²]; inertia
    # about the centre of mass, axes of the link frame
    mass: float
    com: Vector
    inertia: MatrixRows

    def ends(self, far: float = math.inf) -> tuple[float, float]:
        """Lower and upper position limit, ∓`far` where there is none."""
        return -far if self.lower is None else self.lower, far if self.upper is None else self.upper


@dataclass(frozen=True, slots=True)
class LumpedBody:
    """A link fixed to a moving link, whose mass counts into it."""

    name: str  # the fixed link
    onto: str  # the moving link
    mass: float  # kg


@dataclass(frozen=True, slots=True)
class Tip:
    """The frame of the `end_effector` kernel, fixed in the frame of joint `joint`."""

    link: str  # name of the tip link
    joint: int  # index of the joint that moves it
    rotation: MatrixRows  # R from the tip frame to the joint's frame
    translation: Vector  # origin of the tip frame in the joint's frame, m


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame rigid in the body of a joint."""

    joint: int  # index of the joint, −1 for the base
    rotation: MatrixRows  # R from this frame to that of the joint
    translation: Vector  # origin in the joint's frame, m


@dataclass(frozen=True, slots=True)
class Closure:
    """One loop joint; z of its frames is the axis of the joint."""

    name: str  # for messages
    kind: str  # key of `FREE_ROWS`
    parent: Frame  # parent, child: the two frames
    child: Frame
    rows: tuple[int, ...]  # components of the frames that are closed; others follow or are free


@dataclass(frozen=True, slots=True)
class Turn:
    """An independent joint that turns without end through postures that all close."""

    place: int  # in q
    windings: tuple[int, ...]  # turns of the dependent coordinates per turn of the joint, (r,)


@dataclass(frozen=True, slots=True)
class Loops:
    """Loop joints and the choice among x, the coordinates of the chain without its loops."""

    closures: tuple[Closure, ...]  # the loop joints
    independent: tuple[int, ...]  # (n,) places in x of q, in the order of q
    dependent: tuple[int, ...]  # (r,) places in x of the others, as many as there are rows
    # rows and places in `dependent` of systems that are solved one after the other
    blocks: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    assembly: Vector  # x of the assembly pose [rad, m]
    turns: tuple[Turn, ...] = ()  # joints that turn without end


@dataclass(frozen=True, slots=True)
class Chain:
    """A kinematic tree with the inertias of its moving bodies."""

    name: str  # name of the robot in the URDF
    base: str  # name of the base link
    # the moving joints, parents before children, one body each; of a free base the first one is the
    # joint of six degrees of freedom between world and base link
    joints: tuple[Joint, ...]
    gravity: Vector  # m/s², in the frame of the base link, of a free base in that of the world
    tip: Tip  # the frame of the end effector
    mount: Tip  # the frame that a payload is fixed to: the tip, or before the tool that holds it
    lumped: tuple[LumpedBody, ...]  # fixed bodies counted into moving links
    removed: tuple[str, ...]  # links cut off by --base and --tip
    urdf: str  # the normalised document that the chain describes
    # link → origin of a body that the URDF does not state (`assumed_bodies`)
    assumed: dict[str, str] = field(default_factory=dict)
    base_is_assumed: bool = False  # no fixed joint attaches the base to the world: taken as fixed
    coupling: Coupling | None = None  # q_all = A q + b; None where every joint is independent
    mechanism: Mechanism = field(default_factory=Mechanism)  # springs, curves, further friction
    loops: Loops | None = None  # loop joints of a closed chain; None for a tree

    @property
    def floating(self) -> bool:
        """Whether the base is free."""
        return self.joints[0].kind == FLOATING

    @property
    def is_large(self) -> bool:
        """Whether the robot has so many bodies that code without loops becomes too long."""
        return len(self.joints) > LARGE

    @property
    def single_joints(self) -> tuple[Joint, ...]:
        """The joints of one degree of freedom, which couplings count by."""
        return self.joints[1:] if self.floating else self.joints

    @property
    def coordinates(self) -> tuple[Joint, ...]:
        """The n independent joints of one degree of freedom, whose positions are q."""
        free = self.single_joints
        if self.coupling is not None:
            free = tuple(free[k] for k in self.coupling.independent)
        return free if self.loops is None else tuple(free[k] for k in self.loops.independent)

    @property
    def freedom(self) -> int:
        """Entries of q, dq, ddq and τ: n, or 6 + n with the base first."""
        return len(self.coordinates) + (BASE_FREEDOM if self.floating else 0)


def path_to(joints: tuple[Joint, ...], joint: int) -> list[int]:
    """Joints from the base to one joint, which comes last; none for the base."""
    path = list[int]()
    while joint >= 0:
        path.append(joint)
        joint = joints[joint].parent
    return path[::-1]


def free_base(link: str, body: pinocchio.Inertia) -> Joint:
    """The joint of six degrees of freedom between the world and a free base."""
    if not body.mass > 0:
        raise UrdfError(
            f"the free base '{link}' has no mass, nor do links fixed to it; give it "
            "an <inertial>, or name another base with --base"
        )
    return Joint(
        name=BASE_JOINT,
        kind=FLOATING,
        parent=-1,
        rotation=rows_of(np.eye(3)),
        translation=(0.0, 0.0, 0.0),
        axis=(0.0, 0.0, 0.0),
        lower=None,
        upper=None,
        velocity=None,
        effort=None,
        link=link,
        mass=float(body.mass),
        com=snapped(body.lever),
        inertia=tuple(tuple(float(x) for x in row) for row in body.inertia),
    )


def snapped(values: np.ndarray) -> Vector:
    """Numbers, with those near 0 or ±1 made exact."""
    array = np.asarray(values, dtype=float)
    nearest = np.round(array)
    meant = (np.abs(array - nearest) < ROUNDING) & (np.abs(nearest) <= 1)
    return tuple(float(x) for x in np.where(meant, nearest + 0.0, array))


def rows_of(matrix: np.ndarray) -> MatrixRows:
    """MatrixRows of a rotation, snapped."""
    return tuple(snapped(row) for row in matrix)
