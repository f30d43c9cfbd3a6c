"""Random closed chains, and their equations by an independent projection of the tree.

The oracle knows the tree from Pinocchio and the loop as the distance of two points, or of two
frames: M a + h = τ + Jᵀ λ, J a = −J̇ v as one linear system (KKT), positions by Newton in NumPy.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio
from numpy.typing import NDArray

from tests.oracle import pinocchio_model

Array = NDArray[np.float64]
LWA = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, slots=True)
class Linkage:
    """A closed chain.

    Attributes:
        urdf: the tree.
        mechanism: table of the mechanism file.
        independent: names of the independent joints.
        start: joint → position of the assembly pose.
        ends: two (link, point) that coincide.
    """

    urdf: str
    mechanism: dict
    independent: tuple[str, ...]
    start: dict[str, float]
    ends: tuple[tuple[str, Array], tuple[str, Array]]


def _link(name: str, rng: np.random.Generator, length: float) -> str:
    m = rng.uniform(0.3, 2.0)
    c = rng.uniform(-0.05, 0.05, 3) + np.array([length / 2, 0, 0])
    root = rng.normal(0, 0.05, (3, 3))
    s = root @ root.T + 1e-3 * np.eye(3)  # Σ ≻ 0: the inertia tr(Σ) 1 − Σ is realisable
    i = m * (np.trace(s) * np.eye(3) - s)
    return (
        f'<link name="{name}"><inertial><origin xyz="{c[0]} {c[1]} {c[2]}"/><mass value="{m}"/>'
        f'<inertia ixx="{i[0, 0]}" iyy="{i[1, 1]}" izz="{i[2, 2]}" ixy="{i[0, 1]}" '
        f'ixz="{i[0, 2]}" iyz="{i[1, 2]}"/></inertial></link>'
    )


def _joint(name: str, parent: str, child: str, place: str, axis: str = "0 0 1") -> str:
    return (
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin {place}/><axis xyz="{axis}"/></joint>'
    )


def _tilted(rng: np.random.Generator) -> str:
    """A fixed joint that tilts the plane of the linkage: gravity has all components."""
    rpy = rng.uniform(-1, 1, 3)
    return (
        '<link name="world"/><link name="ground"/><joint name="mount" type="fixed"><parent '
        f'link="world"/><child link="ground"/><origin rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/></joint>'
    )


def planar(rng: np.random.Generator, kind: str) -> Linkage:
    """A planar linkage of two legs on the ground.

    Args:
        rng: geometry, inertia and assembly pose.
        kind: "four-bar", "parallelogram" or "five-bar".

    Returns:
        Legs of one and two links, of equal opposite links, or of two links each.
    """
    ground = rng.uniform(0.5, 0.9)
    a = rng.uniform(0.3, 0.6)
    if kind == "parallelogram":
        angle = rng.uniform(0.6, 2.2)
        tip = a * np.array([np.cos(angle), np.sin(angle)]) + [ground, 0]
        first = np.array([np.cos(angle), np.sin(angle)]) * a
    else:
        angle = rng.uniform(0.9, 2.2)
        first = a * np.array([np.cos(angle), np.sin(angle)])
        tip = rng.uniform([0.3, 0.6], [0.9, 1.0])
    elbow = tip - first
    second = float(np.linalg.norm(elbow))
    q = {"a1": angle, "a2": float(np.arctan2(elbow[1], elbow[0]) - angle)}
    text = [_tilted(rng), _link("A1", rng, a), _link("A2", rng, second)]
    text.append(_joint("a1", "ground", "A1", 'xyz="0 0 0"'))
    text.append(_joint("a2", "A1", "A2", f'xyz="{a} 0 0"'))
    base = np.array([ground, 0])
    if kind == "five-bar":
        b = rng.uniform(0.3, 0.6)
        turn = rng.uniform(0.4, 1.6)
        knee = base + b * np.array([np.cos(turn), np.sin(turn)])
        last, end = "B2", float(np.linalg.norm(tip - knee))
        q |= {"b1": turn, "b2": float(np.arctan2(*(tip - knee)[::-1]) - turn)}
        text += [_link("B1", rng, b), _link("B2", rng, end)]
        text.append(_joint("b1", "ground", "B1", f'xyz="{ground} 0 0"'))
        text.append(_joint("b2", "B1", "B2", f'xyz="{b} 0 0"'))
    else:
        last, end = "B1", float(np.linalg.norm(tip - base))
        q |= {"b1": float(np.arctan2(*(tip - base)[::-1]))}
        text += [_link("B1", rng, end)]
        text.append(_joint("b1", "ground", "B1", f'xyz="{ground} 0 0"'))
    ends = (("A2", np.array([second, 0, 0])), (last, np.array([end, 0, 0])))
    loop = {
        "parent": ends[0][0],
        "child": ends[1][0],
        "parent_xyz": ends[0][1].tolist(),
        "child_xyz": ends[1][1].tolist(),
    }
    independent = ("a1", "b1") if kind == "five-bar" else ("a1",)
    table = {
        "loop": [loop],
        "independent": list(independent),
        "assembly": {name: float(x) for name, x in q.items()},
    }
    return Linkage(f'<robot name="p">{"".join(text)}</robot>', table, independent, q, ends)


def spatial(rng: np.random.Generator) -> Linkage:
    """Two shoulders, a fork of two axes and a rod: RSUR, closed at a point in space."""
    places = rng.uniform([0.3, -0.1, 0.2], [0.5, 0.1, 0.4])
    text = [_tilted(rng), *(_link(n, rng, 0.3) for n in ("A", "U", "R", "B"))]
    text.append(_joint("a", "ground", "A", 'rpy="0.3 -0.2 0"'))
    text.append(_joint("u", "A", "U", 'xyz="0.3 0 0"', "0 1 0"))
    text.append(_joint("v", "U", "R", 'xyz="0 0 0"'))
    axis = rng.normal(0, 1, 3)
    axis = axis / np.linalg.norm(axis)
    place = f'xyz="{places[0]} {places[1]} {places[2]}" rpy="0.5 0.4 0.3"'
    text.append(_joint("b", "ground", "B", place, f"{axis[0]} {axis[1]} {axis[2]}"))
    urdf = f'<robot name="s">{"".join(text)}</robot>'
    q = dict(zip("auvb", rng.uniform(-0.7, 0.7, 4), strict=True))
    point = rng.uniform(0.15, 0.3, 3)
    # The point of B where the rod ends in the assembly pose.
    model = pinocchio_model(urdf)
    data = model.createData()
    x = np.array([q[n] for n in model.names[1:]])
    pinocchio.forwardKinematics(model, data, x)
    at = {n: data.oMi[model.getJointId(n)] for n in ("v", "b")}
    other = at["b"].inverse() * (at["v"] * point)
    loop = {
        "parent": "R",
        "child": "B",
        "parent_xyz": point.tolist(),
        "child_xyz": other.tolist(),
        "kind": "spherical",
    }
    table = {
        "loop": [loop],
        "independent": ["a"],
        "assembly": {name: float(x) for name, x in q.items()},
    }
    return Linkage(urdf, table, ("a",), q, (("R", point), ("B", other)))


class Projection:
    """KKT equations of a linkage by Pinocchio's tree and the distance of its two points."""

    def __init__(self, linkage: Linkage, names: tuple[str, ...], gravity: Array) -> None:
        self.linkage = linkage
        self.model = pinocchio_model(linkage.urdf, gravity)
        self.data = self.model.createData()
        self.at = [self.model.joints[self.model.getJointId(n)].idx_v for n in names]
        own = [names.index(n) for n in linkage.independent]
        self.own = np.array([self.at[k] for k in own])
        self.rest = np.array([k for k in range(self.model.nv) if k not in self.own])
        self.start = np.array([linkage.start[n] for n in self.model.names[1:]])
        self.ids = [
            (self.model.getFrameId(link, pinocchio.BODY), np.array(point))
            for link, point in linkage.ends
        ]

    def gap(self, x: Array) -> tuple[Array, Array]:
        """Distance of the two points and its Jacobian, in axes of the base."""
        pinocchio.computeJointJacobians(self.model, self.data, x)
        pinocchio.updateFramePlacements(self.model, self.data)
        points, slopes = [], []
        for frame, point in self.ids:
            place = self.data.oMf[frame]
            j = pinocchio.getFrameJacobian(self.model, self.data, frame, LWA)
            lever = place.rotation @ point
            points.append(place.translation + lever)
            slopes.append(j[:3] - pinocchio.skew(lever) @ j[3:])
        return points[0] - points[1], slopes[0] - slopes[1]

    def bend(self, x: Array, v: Array) -> Array:
        """J̇ v: acceleration of the distance for a = 0."""
        zero = np.zeros(self.model.nv)
        pinocchio.forwardKinematics(self.model, self.data, x, v, zero)
        pinocchio.updateFramePlacements(self.model, self.data)
        accelerations = []
        for frame, point in self.ids:
            a = pinocchio.getFrameClassicalAcceleration(self.model, self.data, frame, LWA)
            twist = pinocchio.getFrameVelocity(self.model, self.data, frame, LWA)
            lever = self.data.oMf[frame].rotation @ point
            spin = np.cross(twist.angular, np.cross(twist.angular, lever))
            accelerations.append(a.linear + np.cross(a.angular, lever) + spin)
        return accelerations[0] - accelerations[1]

    def pose(self, q: Array) -> Array:
        """Positions of all joints, by Newton along 400 poses from the assembly."""
        x = self.start.copy()
        x0 = x[self.own].copy()
        for share in np.linspace(0, 1, 401)[1:]:
            x[self.own] = x0 + share * (q - x0)
            for _ in range(3):
                gap, slope = self.gap(x)
                x[self.rest] -= np.linalg.lstsq(slope[:, self.rest], gap, rcond=1e-9)[0]
        return x

    def rates(self, x: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        """v and a of all joints."""
        _, slope = self.gap(x)
        v, a = np.zeros(self.model.nv), np.zeros(self.model.nv)
        v[self.own] = dq
        v[self.rest] = np.linalg.lstsq(slope[:, self.rest], -slope[:, self.own] @ dq, rcond=1e-9)[0]
        a[self.own] = ddq
        right = -slope[:, self.own] @ ddq - self.bend(x, v)
        a[self.rest] = np.linalg.lstsq(slope[:, self.rest], right, rcond=1e-9)[0]
        return v, a

    def projector(self, x: Array) -> Array:
        """P with τ = P f: forces f of all joints = Sᵀ τ + Jᵀ λ."""
        _, slope = self.gap(x)
        drive = np.zeros((self.model.nv, len(self.own)))
        drive[self.own, np.arange(len(self.own))] = 1
        return np.linalg.pinv(np.hstack([drive, slope.T]), rcond=1e-9)[: len(self.own)]

    def torque(self, x: Array, v: Array, a: Array) -> Array:
        """τ of the drives: M a + h = Sᵀ τ + Jᵀ λ."""
        full = pinocchio.rnea(self.model, self.data, x, v, a)
        return np.asarray(self.projector(x) @ full)

    def acceleration(self, x: Array, v: Array, tau: Array) -> Array:
        """ddq of the independent joints from the KKT system."""
        _, slope = self.gap(x)
        n = self.model.nv
        mass = pinocchio.crba(self.model, self.data, x)
        mass = np.triu(mass) + np.triu(mass, 1).T
        force = -pinocchio.nonLinearEffects(self.model, self.data, x, v)
        force[self.own] += tau
        m = len(slope)
        system = np.block([[mass, slope.T], [slope, np.zeros((m, m))]])
        right = np.concatenate([force, -self.bend(x, v)])
        return np.linalg.lstsq(system, right, rcond=1e-11)[0][:n][self.own]


def palletizer(rng: np.random.Generator) -> Linkage:
    """A robot with a waist, an arm, and a forearm that a parallelogram of crank and rod moves."""
    text = ['<link name="ground"/>']
    text += [_link(n, rng, 0.4) for n in ("W", "A", "C", "R", "F")]
    text.append(_joint("waist", "ground", "W", 'xyz="0 0 0.3"'))
    text.append(_joint("arm", "W", "A", 'xyz="0.1 0 0.2"', "0 1 0"))
    text.append(_joint("crank", "W", "C", 'xyz="0.1 0.05 0.2"', "0 1 0"))
    text.append(_joint("rod", "C", "R", 'xyz="-0.15 0.02 0"', "0 1 0"))
    text.append(_joint("forearm", "A", "F", 'xyz="0 0 0.4"', "0 1 0"))
    ends = (("R", np.array([0, -0.07, 0.4])), ("F", np.array([-0.15, 0, 0])))
    loop = {
        "parent": "R",
        "child": "F",
        "parent_xyz": ends[0][1].tolist(),
        "child_xyz": ends[1][1].tolist(),
    }
    own = ("waist", "arm", "crank")
    start = dict.fromkeys(("waist", "arm", "crank", "rod", "forearm"), 0.0)
    urdf = f'<robot name="palletizer">{"".join(text)}</robot>'
    return Linkage(urdf, {"loop": [loop], "independent": list(own)}, own, start, ends)
