"""A trajectory against the robot's limits for every instant, not only at samples.

On an interval of length δ a function lies below its chord by Taylor: g ≤ max(g_k, g_k+1) + δ²/8
sup|g''|, and within it |g''| ≤ max(|g''_k|, |g''_k+1|) + δ/2 Σ|a| sup|φ'''| (of g). All derivatives
are closed forms of the basis, so the bound is proven up to rounding, which is added. The fifth one
of a spline jumps at knots, from one constant to the next, both of which are among the samples.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.library import Array, Library

INTERVALS = 4000
"""Of the grid over half the duration, at least; over all of it twice as many."""
INTERVALS_PER_HARMONIC = 3000
"""Keeps the chords' error δ²/8 (2πM/t_f)² below 2e-7 of the amplitude."""
ROUNDING = 64 * np.finfo(float).eps
"""Relative to Σ|a| sup|φ|: the arguments 2πms carry a few ε, and M products are added."""
KINDS = ("position", "velocity", "acceleration", "jerk")


@dataclass(frozen=True, slots=True)
class Use:
    """The largest use of one kind of limit.

    Attributes:
        kind: position (as a share of the way from home to its limit), velocity, acceleration, jerk.
        bound: proven upper bound of |value| / limit over all t; 1 is the limit itself.
        joint: where it is largest.
        time: when, s; to one step of the grid.
        order: of the derivative in time: replayed at r times the speed the use is r^order.
    """

    kind: str
    bound: float
    joint: str
    time: float
    order: int

    @property
    def margin(self) -> float:
        """1 − bound: what is left of the limit."""
        return 1.0 - self.bound

    @property
    def holds(self) -> bool:
        """The limit is kept at every instant; false where the motion is not a number."""
        return self.bound <= 1.0


@dataclass(frozen=True, slots=True)
class Certificate:
    """What is proven of a trajectory.

    Attributes:
        uses: one per kind of limit that some joint has.
        unlimited: kinds and joints for which the robot states no limit: nothing is proven there.
    """

    uses: tuple[Use, ...]
    unlimited: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Every stated limit is kept at every instant."""
        return all(use.holds for use in self.uses)

    @property
    def broken(self) -> tuple[Use, ...]:
        """The limits that are not proven to be kept."""
        return tuple(use for use in self.uses if not use.holds)

    def fastest(self) -> float:
        """Largest r ≤ 1 such that the same path at r times the speed holds; 0 where none does."""
        if any(use.order == 0 for use in self.broken) or not all(
            np.isfinite(use.bound) for use in self.uses
        ):
            return 0.0
        return min([1.0, *(use.bound ** (-1 / use.order) for use in self.broken)])

    def sentences(self) -> tuple[str, ...]:
        """One line per limit, for headers and logs."""
        lines = [
            f"{use.kind}: at most {100 * use.bound:.4f} % of the limit, {use.joint} at "
            f"{use.time:.3f} s"
            for use in self.uses
        ]
        return (*lines, *(f"no limit stated: {text}" for text in self.unlimited))


def certificate(lib: Library, trajectory: Trajectory) -> Certificate:
    """Proven bounds of position, velocity, acceleration and jerk over their limits.

    Raises:
        IdentificationError: the trajectory is not one of this robot.
    """
    bounds, times = joint_bounds(lib, trajectory)
    uses, unlimited = [], []
    for order, kind in enumerate(KINDS):
        free = _unlimited(lib, kind)
        if free.any():
            unlimited.append(f"{kind} of {', '.join(np.array(lib.joint_names)[free])}")
        if not free.all():
            worst = int(np.argmax(bounds[order]))  # the first NaN, where there is one
            joint = lib.joint_names[worst]
            bound, time = float(bounds[order, worst]), float(times[order, worst])
            uses.append(Use(kind, bound, joint, time, order))
    return Certificate(tuple(uses), tuple(unlimited))


def joint_bounds(lib: Library, trajectory: Trajectory) -> tuple[Array, Array]:
    """Proven |value| / limit per kind and joint, (4, n), and the time of each maximum, s.

    Of a motion that is its own mirror image about t_f / 2 half is looked at.

    Raises:
        IdentificationError: the trajectory is not one of this robot.
    """
    a, duration = trajectory.coefficients, trajectory.duration
    n = lib.n_joints
    shaped = trajectory.home.shape == (n,) and a.ndim == 2 and len(a) == n and a.size > 0
    if not shaped or not duration > 0:
        raise IdentificationError(
            f"a trajectory of '{lib.name}' needs a home of shape ({n},), coefficients of shape "
            f"({n}, M) and a positive duration, got {trajectory.home.shape}, {a.shape} and "
            f"{duration:g} s"
        )
    basis, size = trajectory.basis, a.shape[1]
    count = max(INTERVALS, INTERVALS_PER_HARMONIC * size)
    end = 0.5 if basis.is_symmetric else 1.0
    count *= 1 if basis.is_symmetric else 2
    s = np.linspace(0.0, end, count + 1)
    step = end / count
    curves = basis.derivatives(len(KINDS) + 2, size, s) @ a.T
    rooms = _rooms(lib, trajectory.home)
    bounds, times = np.empty((2, len(KINDS), n))
    up, down = (np.where(room > 0, room, np.nan) for room in rooms)
    for order in range(len(KINDS)):
        value, bend = curves[order], np.abs(curves[order + 2])
        third = np.abs(a) @ basis.bound(order + 3, size)
        rise = step**2 / 8 * (np.maximum(bend[1:], bend[:-1]) + step / 2 * third)
        rise += ROUNDING * (np.abs(a) @ basis.bound(order, size))
        unit = duration**-order
        high = (np.maximum(value[1:], value[:-1]) + rise) * unit / up[order]
        low = (np.maximum(-value[1:], -value[:-1]) + rise) * unit / down[order]
        both = np.maximum(high, low)
        where = np.argmax(both, axis=0)
        bounds[order] = np.take_along_axis(both, where[None], axis=0)[0]
        times[order] = (where + 0.5) * step * duration
    bounds[np.minimum(*rooms) <= 0] = np.inf  # a NaN stays one
    return bounds, times


def _unlimited(lib: Library, kind: str) -> NDArray[np.bool_]:
    limits = lib.limits()
    if kind == "position":
        return np.isinf(limits["lower"]) & np.isinf(limits["upper"])
    return ~np.isfinite(limits[kind])


def _rooms(lib: Library, home: Array) -> tuple[Array, Array]:
    """Limits upwards and downwards per kind and joint, (4, n); the position's from home."""
    limits = lib.limits()
    same = [limits[kind] for kind in KINDS[1:]]
    return np.array([limits["upper"] - home, *same]), np.array([home - limits["lower"], *same])


def slowed(trajectory: Trajectory, speed: float) -> Trajectory:
    """The same path at `speed` times the speed, 0 < speed ≤ 1: t_f / speed.

    Raises:
        IdentificationError: another speed.
    """
    return replace(trajectory, duration=trajectory.duration / require_speed(speed))


def require_speed(speed: float) -> float:
    """The speed itself, if it slows down.

    Raises:
        IdentificationError: it does not.
    """
    if not 0 < speed <= 1:
        raise IdentificationError(
            f"a replay needs a speed above 0 and up to 100 %, got {100 * speed:g} %; a faster "
            "motion must be designed with a shorter --duration"
        )
    return speed


def pulled_inside(lib: Library, trajectory: Trajectory, most: float = 1e-3) -> Trajectory:
    """Joints whose proven use is above 1 by at most `most`, scaled back onto their limits.

    A design that touches its limits at samples exceeds them between samples by the chords' error;
    whatever exceeds more is left as it is, for `certificate` to tell.
    """
    bounds, _ = joint_bounds(lib, trajectory)
    use = bounds.max(axis=0)
    touched = (use > 1) & (use <= 1 + most)
    # The bound scales with a; 1e-9 is far above the rounding of its second evaluation.
    rho = np.where(touched, use * (1 + 1e-9), 1.0)
    return replace(trajectory, coefficients=trajectory.coefficients / rho[:, None])
