"""One moving joint of a `Chain`, and the joint of six degrees of freedom of a free base."""

from dataclasses import dataclass

import numpy as np
import pinocchio

from symgen.errors import UrdfError

Rows = tuple[tuple[float, ...], ...]
Vector = tuple[float, ...]

FLOATING = "floating"
"""Kind of the joint of a free base."""
BASE_JOINT = "root_joint"
"""Name of the joint of a free base."""
BASE_FREEDOM = 6
"""Degrees of freedom of a free base."""
ROUNDING = 1e-12
"""Distance from 0 or ±1 within which entries of rotations, axes and translations are snapped."""


@dataclass(frozen=True, slots=True)
class Joint:
    """One moving joint and the body it moves; the joint frame is the frame of that link.

    Attributes:
        name: joint name of the URDF.
        kind: revolute, continuous, prismatic, or floating for a free base.
        parent: index of the joint whose body carries this one, −1 for the base.
        rotation: R from this joint's frame (at q = 0) to the parent's frame.
        translation: origin of this joint in the parent's frame, m.
        axis: unit vector in the joint frame.
        lower, upper: position limits, rad or m; None without limit.
        velocity, effort: limits, rad/s or m/s, N·m or N; None if the URDF gives none.
        link: name of the moved link.
        mass, com, inertia: of the moved link with all bodies fixed to it [kg, m, kg·m²]; inertia
            about the centre of mass, axes of the link frame.
    """

    name: str
    kind: str
    parent: int
    rotation: Rows
    translation: Vector
    axis: Vector
    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None
    link: str
    mass: float
    com: Vector
    inertia: Rows


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


def rows_of(matrix: np.ndarray) -> Rows:
    """Rows of a rotation, snapped."""
    return tuple(snapped(row) for row in matrix)
