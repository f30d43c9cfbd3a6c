"""Limits of joints that follow several others, or that a closed loop moves.

| constraint | row | g |
|---|---|---|
| position of dependent joints | joint and end | (x − end) / (end − x_home), at home −1 |
| velocity of dependent joints | joint and sign | ±dx/dt / limit − 1 |

Couplings: x = A q + b, a motion of the same basis, whose bound between samples is proven. Loops:
x = g(q), dx/dt = G(q) dq, d²x/dt² = G ddq + Q(q, dq) by the library; Q is a quadratic form in dq,
so that ∂(G dq)/∂q_j = [Q(q, dq + e_j) − Q(q, dq − e_j)] / 4 is exact. A dependent joint with one
master limits that one at the build. Torques are those of the independent joints.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from runtime.excitation.limits import nonlinear_limits
from runtime.library import Array, Library

KINDS = ("position of dependent joints", "velocity of dependent joints")


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

    def rise(self, bounds: nonlinear_limits.IntervalBounds, order: int) -> Array:
        """Largest rise (K, R) of x or of a derivative between samples; of couplings."""
        rows, n = list(self.rows), self.lib.n_joints
        matrix = np.abs(self.lib.all_velocities(np.eye(n))[:, rows].T)  # A
        size = bounds.motion[order] @ matrix.T
        if order == 0:
            size = size + np.abs(self.lib.all_positions(np.zeros(n))[rows])  # b
        return bounds.bend(bounds.motion[order + 2] @ matrix.T) + nonlinear_limits.ROUNDING * size


@dataclass(frozen=True, slots=True)
class DependentLimit:
    """Finite ends of position or velocity of R dependent joints, upper ones first."""

    even: ClassVar[bool] = True
    precision: ClassVar[tuple[float, float]] = nonlinear_limits.SMOOTH
    joints: DependentJoints  # the joints
    order: int  # 0 of positions, 1 of velocities
    upper: Array  # upper, lower: ends, (R,)
    lower: Array
    above: Array  # above, below: units of g towards both ends, (R,)
    below: Array

    @property
    def kind(self) -> str:
        """Quantity that is limited."""
        return KINDS[self.order]

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

    def along(self, sampled: nonlinear_limits.SampledMotion) -> tuple[Array, Array]:
        """Values, and rates with the next derivative."""
        states = self.joints.motion(sampled.motion)
        return self._beyond(states[self.order]), self._both(states[self.order + 1])

    def rise(self, bounds: nonlinear_limits.IntervalBounds) -> Array:
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
