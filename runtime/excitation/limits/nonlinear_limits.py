"""Limits that are not linear in the motion, as constraints g ≤ 0 with exact slopes.

Every constraint takes a motion (4, N, n), that is q, dq, ddq, dddq at N samples, and returns
g (N, R) of its R rows and ∂g/∂(q, dq, …) of as many orders as it reads. g is use − 1: it vanishes
on the limit and is −1 or less far from it.

| constraint | row | g |
|---|---|---|
| braking | joint and side | (max(0, ±dq + c)² − k (q̂ ∓ q)) / (k · room at rest at home) |
| position of dependent joints | joint and end | (x − end) / (end − x_home), at home −1 |
| velocity of dependent joints | joint and sign | ±dx/dt / limit − 1 |

Dependent joints follow several others, or a closed loop moves them. Couplings: x = A q + b, a
motion of the same basis, whose bound between samples is proven. Loops: x = g(q), dx/dt = G(q) dq,
d²x/dt² = G ddq + Q(q, dq) by the library; Q is a quadratic form in dq, so that
∂(G dq)/∂q_j = [Q(q, dq + e_j) − Q(q, dq − e_j)] / 4 is exact. A dependent joint with one master
limits that one at the build. Torques are those of the independent joints.

Between samples, a distance of two rigid bodies changes no faster than their points move against
each other. Joints that move both bodies leave the distance, and each of the others moves a point at
|dq| times its distance from the axis, at most.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np

from runtime.library import Array, Library

ROUNDING = 1e-12  # of values over their bounds: 64 ε of the motion, and some thousand operations
SMOOTH = 1e-6, 1e-2  # tolerances of proven bounds of smooth functions
DEPENDENT = ("position of dependent joints", "velocity of dependent joints")


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body in a link: index of the joint that moves it, −1 for the base, and its reach."""

    joint: int
    reach: float  # largest distance of its points from the origin of the link, m


BASE = Body(-1, 0.0)  # what stands still


class IntervalBounds:
    """Bounds on K intervals of one length; each kind is computed once for all constraints."""

    def __init__(self, lib: Library, motion: Array, step: float) -> None:
        """Bounds from those of the joints."""
        self.motion, self.step = motion, step
        self._lib, self._rows = lib, np.ascontiguousarray(motion.swapaxes(0, 1))
        self._torques: dict[bytes, Array] = {}

    def bend(self, second: Array) -> Array:
        """Rise of functions (K, R) above the larger ends of intervals, δ²/8 sup |g''|."""
        return self.step**2 / 8 * second

    def torques(self, pi: Array) -> Array:
        """Bounds of |τ| and three derivatives in time, (4, K, n), of parameters (10 L,)."""
        key = pi.tobytes()
        if key not in self._torques:
            self._torques[key] = self._lib.torque_bounds(self._rows, pi).swapaxes(0, 1)
        return self._torques[key]

    @cached_property
    def tip(self) -> Array:
        """Bounds of |p| of the tip and three derivatives in time, (4, K)."""
        return self._lib.tip_bounds(np.ascontiguousarray(self._rows[:, :4])).T

    @cached_property
    def _speeds(self) -> tuple[Array, Array]:
        return self._lib.speed_bounds(np.ascontiguousarray(self._rows[:, :2]))

    def approach(self, first: Body, second: Body = BASE) -> Array:
        """Bound of the rate of the distance of two bodies, (K,) m/s."""
        origin, turn = self._speeds
        one, other = _path(self._lib, first.joint), _path(self._lib, second.joint)
        total = np.zeros(len(turn))
        for body, joints in ((first, one - other), (second, other - one)):
            for j in joints:
                total += origin[:, body.joint, j] + body.reach * turn[:, j]
        return total


def _path(lib: Library, joint: int) -> set[int]:
    """Joints between a link and the base."""
    joints = set()
    while joint >= 0:
        joints.add(joint)
        joint = lib.manifest.all_joints[joint].parent
    return joints


class SampledMotion:
    """A motion with five derivatives, q first, at N samples, (5, N, n)."""

    def __init__(self, lib: Library, motion: Array) -> None:
        self.lib, self.motion = lib, motion
        self._torques: dict[bytes, tuple[Array, Array, Array]] = {}

    def torques(self, pi: Array) -> tuple[Array, Array, Array]:
        """Torques τ and their rates dτ/dt and d²τ/dt², (N, n), under parameters π (10 n,)."""
        key = pi.tobytes()
        if key not in self._torques:
            q, dq, ddq, dddq, ddddq = self.motion
            self._torques[key] = self.lib.torque_with_rates(q, dq, ddq, dddq, ddddq, pi)
        return self._torques[key]

    @cached_property
    def tip(self) -> tuple[Array, Array, Array]:
        """Place, velocity and acceleration of the tip, (N, 3) m, m/s and m/s²."""
        q, dq, ddq = self.motion[:3]
        p, v, dp_dq, dv_dq = self.lib.tip_motion(q, dq)
        return p, v, times(dv_dq, dq) + times(dp_dq, ddq)


def times(jacobian: Array, speed: Array) -> Array:
    """Product J ẋ, (N, R), of J (N, R, n) and ẋ (N, n) at every sample."""
    return np.asarray(np.matmul(jacobian, speed[:, :, None])[:, :, 0])


class Constraint(Protocol):
    """One kind of limit."""

    @property
    def kind(self) -> str:
        """Name of the limit in certificates."""

    @property
    def orders(self) -> int:
        """How many of q, dq, ddq, dddq are read."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Joint, axis or pair of each of the R rows."""

    @property
    def even(self) -> bool:
        """The values stay the same when the motion runs backwards: −dq and −dddq."""

    def values(self, motion: Array) -> Array:
        """Values g, (N, R), of a motion (4, N, n)."""

    def slopes(self, motion: Array) -> Array:
        """Slopes ∂g/∂(q, …), (N, R, orders, n)."""

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Quantity of a row at a value of the constraint.

        Args:
            row: index of the row.
            g: value of the constraint there.

        Returns:
            The quantity, its limit and their unit.
        """


class TimedConstraint(Constraint, Protocol):
    """A constraint whose rate in time is computed without its slopes, and bounded on intervals."""

    precision: ClassVar[tuple[float, float]]
    """Least and largest tolerance of a proven bound of g."""

    def along(self, sampled: SampledMotion) -> tuple[Array, Array]:
        """Values g and rates dg/dt, (N, R) each."""

    def rise(self, bounds: IntervalBounds) -> Array:
        """Largest rise of g within K intervals above the larger end of each, proven, (K, R)."""


@dataclass(frozen=True, slots=True)
class Side:
    """Braking towards the end of side s = ±1: max(0, s dq + c)² ≤ k (s q̂ − s q), (n,) each."""

    sign: float
    k: Array
    c: Array
    end: Array


@dataclass(frozen=True, slots=True)
class Braking:
    """Velocity limits that fall towards the ends of the range; rest at home uses 0 % of them."""

    kind: ClassVar[str] = "braking"
    orders: ClassVar[int] = 2
    even: ClassVar[bool] = False  # braking depends on the direction of dq
    sides: tuple[Side, ...]
    home: Array
    joints: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Joints, upper ends first."""
        return tuple(name for _ in self.sides for name in self.joints)

    def room(self, side: Side) -> Array:
        """Room s (q̂ − home) − c²/k, (n,) rad; NaN where the robot may not even rest at home."""
        room = side.sign * (side.end - self.home) - np.maximum(side.c, 0) ** 2 / side.k
        return np.where(room > 0, room, np.nan)

    def values(self, motion: Array) -> Array:
        """Values (max(0, s dq + c)²/k − s (q̂ − q)) / room."""
        q, dq = motion[:2]
        parts = [
            np.maximum(0, s.sign * dq + s.c) ** 2 / s.k - s.sign * (s.end - q) for s in self.sides
        ]
        shares = [part / self.room(s) for part, s in zip(parts, self.sides, strict=True)]
        return np.concatenate(shares, axis=1)

    def slopes(self, motion: Array) -> Array:
        """Slopes s / room and 2 s max(0, s dq + c) / (k room), each of its own joint."""
        dq, n = motion[1], motion.shape[2]
        slopes = np.zeros((len(dq), len(self.sides), n, 2, n))
        each = np.arange(n)
        for i, s in enumerate(self.sides):
            scale = s.sign / self.room(s)
            slopes[:, i, each, 0, each] = scale
            slopes[:, i, each, 1, each] = scale * 2 / s.k * np.maximum(0, s.sign * dq + s.c)
        return slopes.reshape(len(dq), -1, 2, n)

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Share of the room at home that is used."""
        return 1 + g, 1.0, "of the room at home"


@dataclass(frozen=True, slots=True)
class DependentJoints:
    """Dependent joints with limits, and their motion."""

    lib: Library  # the robot
    rows: tuple[int, ...]  # indices among all joints, (R,)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.lib.all_joint_names[k] for k in self.rows)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of their positions."""
        return tuple(self.lib.manifest.all_joints[k].unit for k in self.rows)

    def motion(self, motion: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations, (N, R) each, of a motion (3 or more, N, n)."""
        rows = list(self.rows)
        x, dx, ddx = self.lib.motion_or_nan(*motion[:3])
        return x[:, rows], dx[:, rows], ddx[:, rows]

    def slopes(self, q: Array, dq: Array) -> Array:
        """Slopes (N, R, 2, n) of dx/dt by q and dq, (N, n) each; those by dq are ∂x/∂q."""
        slopes = np.zeros((len(q), len(self.rows), 2, q.shape[1]))
        for j, unit in enumerate(np.eye(q.shape[1])):
            ahead, behind = (
                self.motion(np.stack([q, dq + s * unit, np.zeros_like(q)])) for s in (1, -1)
            )
            # Linear in dq, and quadratic in dq: both differences are exact.
            slopes[:, :, 1, j] = (ahead[1] - behind[1]) / 2
            slopes[:, :, 0, j] = (ahead[2] - behind[2]) / 4
        return slopes

    def rise(self, bounds: IntervalBounds, order: int) -> Array:
        """Largest rise (K, R) of x or of a derivative between samples; of couplings."""
        rows, n = list(self.rows), self.lib.n_joints
        matrix = np.abs(self.lib.all_velocities(np.eye(n))[:, rows].T)  # A
        size = bounds.motion[order] @ matrix.T
        if order == 0:
            size = size + np.abs(self.lib.all_positions(np.zeros(n))[rows])  # b
        return bounds.bend(bounds.motion[order + 2] @ matrix.T) + ROUNDING * size


@dataclass(frozen=True, slots=True)
class DependentLimit:
    """Finite ends of position or velocity of R dependent joints, upper ones first."""

    even: ClassVar[bool] = True
    precision: ClassVar[tuple[float, float]] = SMOOTH
    joints: DependentJoints  # the joints
    order: int  # 0 of positions, 1 of velocities
    upper: Array  # upper, lower: ends, (R,)
    lower: Array
    above: Array  # above, below: units of g towards both ends, (R,)
    below: Array

    @property
    def kind(self) -> str:
        """Quantity that is limited."""
        return DEPENDENT[self.order]

    @property
    def orders(self) -> int:
        """Positions, or positions and velocities."""
        return self.order + 1

    @property
    def labels(self) -> tuple[str, ...]:
        """Joints, those with an upper end first."""
        names = np.array(self.joints.names)
        return (*names[np.isfinite(self.upper)].tolist(), *names[np.isfinite(self.lower)].tolist())

    def values(self, motion: Array) -> Array:
        """Values (x − upper) / unit and (lower − x) / unit; x is the position or the velocity."""
        return self._beyond(self.joints.motion(motion)[self.order])

    def slopes(self, motion: Array) -> Array:
        """Slopes ±∂x/∂q, or ±∂(dx/dt)/∂(q, dq), over the unit."""
        slopes = self.joints.slopes(motion[0], self.order * motion[1])[:, :, 1 - self.order :]
        return self._both(slopes.transpose(0, 2, 3, 1)).transpose(0, 3, 1, 2)

    def along(self, sampled: SampledMotion) -> tuple[Array, Array]:
        """Values, and rates with the next derivative."""
        states = self.joints.motion(sampled.motion)
        return self._beyond(states[self.order]), self._both(states[self.order + 1])

    def rise(self, bounds: IntervalBounds) -> Array:
        """Rise by the second derivative of the quantity."""
        return np.abs(self._both(self.joints.rise(bounds, self.order)))

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Quantity of a joint at a value of the constraint, its limit and their unit."""
        up, down = np.flatnonzero(np.isfinite(self.upper)), np.flatnonzero(np.isfinite(self.lower))
        j = int(up[row]) if row < len(up) else int(down[row - len(up)])
        unit = self.joints.units[j] + ("", "/s")[self.order]
        if row < len(up):
            return float(self.upper[j] + g * self.above[j]), float(self.upper[j]), unit
        return float(self.lower[j] - g * self.below[j]), float(self.lower[j]), unit

    def _beyond(self, values: Array) -> Array:
        """Values g, (N, rows), of the quantity, (N, R)."""
        with np.errstate(invalid="ignore"):  # infinite ends have no row
            ends = self._both(np.stack([self.upper, self.lower]))
        count = int(np.isfinite(self.upper).sum())
        return self._both(values) - np.concatenate([ends[0, :count], ends[1, count:]])

    def _both(self, values: Array) -> Array:
        """Quantities (…, R) with the sign and in the unit of every row, (…, rows)."""
        up, down = np.isfinite(self.upper), np.isfinite(self.lower)
        sides = [values[..., up] / self.above[up], -values[..., down] / self.below[down]]
        return np.concatenate(sides, axis=-1)


def dependent_joints(lib: Library, home: Array) -> tuple[DependentLimit, ...]:
    """Constraints of the dependent joints whose limits do not limit one master alone."""
    joints = DependentJoints(lib, dependent_rows(lib))
    if not joints.rows:
        return ()
    lower, upper, speed = dependent_limits(lib, joints.rows)
    x = lib.all_positions(home)[list(joints.rows)]
    chosen: list[DependentLimit] = []
    if np.isfinite([lower, upper]).any():
        # A joint that is beyond its end at home has no way to it: its unit is 1 rad or m.
        above, below = (np.where(room > 0, room, 1.0) for room in (upper - x, x - lower))
        chosen.append(DependentLimit(joints, 0, upper, lower, above, below))
    if np.isfinite(speed).any():
        chosen.append(DependentLimit(joints, 1, speed, -speed, speed, speed))
    return tuple(chosen)


def dependent_rows(lib: Library) -> tuple[int, ...]:
    """Indices of the dependent joints that several joints, or a closed loop, move."""
    coupling, manifest = lib.manifest.coupling, lib.manifest
    if manifest.loops:
        free = set(lib.joint_names)
        return tuple(k for k, joint in enumerate(manifest.all_joints) if joint.name not in free)
    if coupling is None:
        return ()
    several = (np.abs(coupling.matrix) > 0).sum(axis=1) > 1
    return tuple(int(k) for k in np.flatnonzero(several))


def dependent_limits(lib: Library, rows: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Limits (R,) of chosen joints [rad, m], ±inf where none are stated."""
    facts = [lib.manifest.all_joints[k] for k in rows]
    missing = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf}
    lower, upper, speed = (
        np.array([none if (x := getattr(one, key)) is None else x for one in facts], dtype=float)
        for key, none in missing.items()
    )
    return lower, upper, speed
