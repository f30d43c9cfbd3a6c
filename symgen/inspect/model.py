"""Contents of a robot model file: links with inertials and shapes, joints, findings.

Nothing is rejected here. Inertias are about the centre of mass in the axes of the link.
"""

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from symgen.kernel import Array
from symgen.mechanics import inertia

ERROR = "error"  # severity of a value that is physically impossible
WARNING = "warning"  # severity of a value that is possible, but probably not intended


@dataclass(frozen=True, slots=True)
class Finding:
    """One fault: its place, the value, and the expected value."""

    severity: str  # `ERROR` or `WARNING`
    kind: str  # short name of the check, for programs
    where: str  # the link or joint, such as "link 'hand'"
    observed: str  # observed, expected: halves of the sentence
    expected: str

    @property
    def sentence(self) -> str:
        """The finding as one sentence."""
        return f"{self.where}: {self.observed}; {self.expected}"


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Mass properties of a link."""

    mass: float  # kg
    com: Array  # (3,) centre of mass in the link frame, m
    inertia: Array  # (3, 3) about the centre of mass in the link's axes, kg·m²

    @staticmethod
    def of(pseudo: Array) -> "Body":
        """The body of a P (4, 4)."""
        mass, com, tensor = map(np.array, map(ca.DM, inertia.com_inertia(ca.DM(pi_of(pseudo)))))
        return Body(float(mass.item()), com.ravel(), (tensor + tensor.T) / 2)

    @property
    def pi(self) -> Array:
        """(10,) π, inertia about the link origin."""
        pi = inertia.pi_from_com(self.mass, ca.DM(self.com), ca.DM(self.inertia))
        return np.asarray(ca.DM(pi), dtype=float).ravel()

    @property
    def pseudo_inertia(self) -> Array:
        """(4, 4) P = [[Σ, mc], [mcᵀ, m]] about the link origin."""
        return pseudo_of(self.pi)

    @property
    def sigma(self) -> Array:
        """(3, 3) Σ_com = ½ tr(I_com) 1 − I_com, second moments of mass about the centre, kg·m²."""
        return float(np.trace(self.inertia)) / 2 * np.eye(3) - self.inertia

    @property
    def moments(self) -> Array:
        """(3,) principal moments, ascending, kg·m²."""
        return np.asarray(np.linalg.eigvalsh(self.inertia), dtype=float)

    @property
    def slack(self) -> float:
        """J₁ + J₂ − J₃ of the ascending principal moments, kg·m²; negative is not consistent."""
        j = self.moments
        return float(j[0] + j[1] - j[2])

    @property
    def is_empty(self) -> bool:
        """True for a frame that is written as a body, with neither mass nor inertia."""
        return self.mass == 0 and not self.inertia.any()

    @property
    def size(self) -> float:
        """√(tr Σ_com / m), root mean square distance of the mass from its centre, m."""
        return float(np.sqrt(max(np.trace(self.inertia) / 2, 0.0) / self.mass))

    @property
    def is_realisable(self) -> bool:
        """True for m > 0, inertia above rounding, and Σ_com ⪰ 0 up to rounding."""
        trace = float(np.trace(self.inertia))
        if not (self.mass > 0 and trace > POINT**2 * self.mass):
            return False
        return self.slack >= -2 * inertia.REALISABLE_TOLERANCE * trace


def pseudo_of(pi: Array) -> Array:
    """P (4, 4) of π (10,)."""
    return np.array(ca.DM(inertia.pseudo_inertia(ca.DM(pi))))


def pi_of(pseudo: Array) -> Array:
    """π (10,) of P (4, 4): m, m·c, and I = tr(Σ) 1 − Σ about the same origin."""
    tensor = np.trace(pseudo[:3, :3]) * np.eye(3) - pseudo[:3, :3]
    pi = inertia.pi_of_body(pseudo[3, 3], ca.DM(pseudo[:3, 3]), ca.DM(tensor))
    return np.asarray(ca.DM(pi), dtype=float).ravel()


POINT = 1e-6  # size below which a body with mass counts as a point, m


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """One <geometry>: box, cylinder, sphere, capsule or mesh, placed in the link frame."""

    kind: str  # name of the primitive, or "mesh"
    size: tuple[float, ...]  # box x y z; radius, length; radius; scale of a mesh. m
    rotation: Array  # (3, 3) from the shape's frame to the link frame
    translation: Array  # (3,) m
    file: str = ""  # name of the mesh file, as written
    is_collision: bool = True  # False for visual shapes

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for equal shapes, wherever they are placed."""
        return (self.kind, self.size, self.file)


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A link with its mass properties and shapes as written; `body` is None without <inertial>."""

    name: str
    body: Body | None = None
    shapes: tuple[Shape, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A joint with its numbers as written; None where the file gives none."""

    name: str
    kind: str  # revolute, continuous, prismatic, fixed, …
    parent: str  # parent, child: names of links
    child: str
    offset: Array  # offset, rotation: frame at q = 0 in the parent link's frame, m
    axis: Array  # (3,) in the joint frame
    lower: float | None = None  # lower, upper: rad or m
    upper: float | None = None
    velocity: float | None = None  # velocity, effort: rad/s or m/s, N·m or N
    effort: float | None = None
    damping: float | None = None  # damping, friction: N·m·s/rad or N·s/m, N·m or N
    friction: float | None = None
    has_effort: bool = True  # False if the format has no effort and velocity limits
    rotation: Array = field(default_factory=lambda: np.eye(3))

    @property
    def moves(self) -> bool:
        """True unless the joint is fixed."""
        return self.kind != "fixed"


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Contents of a file; `findings` are the faults met while reading it."""

    name: str  # of the robot
    form: str  # "URDF" or "MJCF"
    links: dict[str, Link]  # name → link
    joints: tuple[Joint, ...]  # in the order of the file
    findings: tuple[Finding, ...] = ()  # faults of reading
    notes: tuple[str, ...] = ()  # sentences about parts that could not be checked
    _by_child: dict[str, Joint] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_child", {j.child: j for j in self.joints})

    @property
    def bodies(self) -> dict[str, Body]:
        """Bodies of the links that have one."""
        return {name: link.body for name, link in self.links.items() if link.body is not None}

    def joint_of(self, link: str) -> Joint | None:
        """The joint that carries a link, None for the root."""
        return self._by_child.get(link)

    def children(self, link: str) -> list[Joint]:
        """Joints whose parent is a link."""
        return [j for j in self.joints if j.parent == link]

    def subtree(self, link: str, rigid: bool = False) -> list[str]:
        """A link and all links beyond it; loops are followed once."""
        reached, pending = [], [link]
        while pending:
            here = pending.pop()
            if here in reached:
                continue
            reached.append(here)
            pending += [j.child for j in self.children(here) if not (rigid and j.moves)]
        return [name for name in reached if name in self.links]

    def poses(self, link: str) -> dict[str, Array]:
        """T (4, 4) to a link's frame from those of itself and of all links fixed to it."""
        poses = {link: np.eye(4)}
        for name in self.subtree(link, rigid=True):  # a link comes after the one that carries it
            joint, step = self.joint_of(name), np.eye(4)
            if name != link and joint is not None:
                step[:3, :3], step[:3, 3] = joint.rotation, joint.offset
                # Two joints with one child are an error of the file, which is reported.
                poses[name] = poses.get(joint.parent, np.eye(4)) @ step
        return poses
