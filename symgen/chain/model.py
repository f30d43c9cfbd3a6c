"""Frozen `Chain`: a kinematic tree with the inertias of its moving bodies."""

from dataclasses import dataclass, field

from symgen.chain.coupling import Coupling
from symgen.chain.joint import BASE_FREEDOM, FLOATING, Joint, Rows, Vector
from symgen.chain.loop import Loops
from symgen.chain.mechanism import Mechanism

LARGE = 20
"""Moving bodies above which a robot is large."""


@dataclass(frozen=True, slots=True)
class LumpedBody:
    """A link fixed to a moving link, whose mass counts into it.

    Attributes:
        name: the fixed link.
        onto: the moving link.
        mass: kg.
    """

    name: str
    onto: str
    mass: float


@dataclass(frozen=True, slots=True)
class Tip:
    """The frame of the `end_effector` kernel, fixed in the frame of joint `joint`.

    Attributes:
        link: name of the tip link.
        joint: index of the joint that moves it.
        rotation: R from the tip frame to the joint's frame.
        translation: origin of the tip frame in the joint's frame, m.
    """

    link: str
    joint: int
    rotation: Rows
    translation: Vector


@dataclass(frozen=True, slots=True)
class Chain:
    """A kinematic tree with the inertias of its moving bodies.

    Attributes:
        name: name of the robot in the URDF.
        base: name of the base link.
        joints: the moving joints, parents before children, one body each; of a free base the
            first one is the joint of six degrees of freedom between world and base link.
        gravity: m/s², in the frame of the base link, of a free base in that of the world.
        tip: the frame of the end effector.
        lumped: fixed bodies counted into moving links.
        removed: links cut off by --base and --tip.
        urdf: the normalised document that the chain describes.
        assumed: link → origin of a body that the URDF does not state (`assumed_bodies`).
        base_is_assumed: no fixed joint attaches the base to the world; it is taken as fixed.
        coupling: q_all = A q + b; None where every joint is independent.
        mechanism: springs, torque curves and further friction coordinates.
        loops: loop joints of a closed chain; None for a tree.
    """

    name: str
    base: str
    joints: tuple[Joint, ...]
    gravity: Vector
    tip: Tip
    lumped: tuple[LumpedBody, ...]
    removed: tuple[str, ...]
    urdf: str
    assumed: dict[str, str] = field(default_factory=dict)
    base_is_assumed: bool = False
    coupling: Coupling | None = None
    mechanism: Mechanism = field(default_factory=Mechanism)
    loops: Loops | None = None

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
