"""A trajectory against the robot's limits for every instant, not only at samples.

On an interval of length δ a function lies below its chord by Taylor: g ≤ max(g_k, g_k+1) + δ²/8
sup|g''|, and within it |g''| ≤ max(|g''_k|, |g''_k+1|) + δ/2 Σ|a| sup|φ'''| (of g). All derivatives
are closed forms of the basis, so the bound is proven up to rounding, which is added. The fifth one
of a spline jumps at knots, from one constant to the next, both of which are among the samples.
Limits that are not linear in the motion: `law_bounds`, which says what is proven there.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.excitation import Safety, Trajectory, basis_of
from runtime.excitation.safety import laws, unchecked
from runtime.law_bounds import law_bounds
from runtime.library import Array, Library

INTERVALS = 4000
"""Of the grid over half the duration, at least; over all of it twice as many."""
INTERVALS_PER_HARMONIC = 3000
"""Keeps the chords' error δ²/8 (2πM/t_f)² below 2e-7 of the amplitude."""
ROUNDING = 64 * np.finfo(float).eps
"""Relative to Σ|a| sup|φ|: the arguments 2πms carry a few ε, and M products are added."""
KINDS = ("position", "velocity", "acceleration", "jerk")


UNITS = ("rad or m", "rad/s or m/s", "rad/s² or m/s²", "rad/s³ or m/s³")


@dataclass(frozen=True, slots=True)
class Use:
    """The largest use of one limit.

    Attributes:
        kind: position and braking (as a share of the way from home to the limit), velocity,
            acceleration, jerk, torque, torque rate, tip box, tip speed, self-collision, table.
        bound: of use over all t; 1 is the limit itself. For distances 1 + (limit − value)/0.1 m.
        where: joint, axis, pair or proxy where it is largest.
        time: when, s; to one step of the grid.
        value: the quantity at its worst, in `unit`, as the bound has it.
        limit: of the quantity.
        is_proven: a theorem, not a second derivative measured at 1 kHz (see `law_bounds`).
    """

    kind: str
    bound: float
    where: str
    time: float
    value: float
    limit: float
    unit: str
    is_proven: bool = True

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
    """What is known of a trajectory at every instant.

    Attributes:
        uses: the largest one per kind of limit that is looked at.
        unlimited: kinds and joints for which the robot states no limit: nothing is known there.
        unchecked: what else nobody looked at.
        distances: one per pair of links and, over a table, per proxy.
    """

    uses: tuple[Use, ...]
    unlimited: tuple[str, ...]
    unchecked: tuple[str, ...] = ()
    distances: tuple[Use, ...] = ()

    @property
    def holds(self) -> bool:
        """Every limit that is looked at is kept at every instant."""
        return all(use.holds for use in self.uses)

    @property
    def broken(self) -> tuple[Use, ...]:
        """The limits that are not known to be kept."""
        return tuple(use for use in self.uses if not use.holds)

    def sentences(self) -> tuple[str, ...]:
        """One line per limit, for headers and logs."""
        return (
            *(_sentence(use) for use in self.uses),
            *(f"no limit stated: {text}" for text in self.unlimited),
            *(f"NOT checked: {text}" for text in self.unchecked),
        )


DISTANCES = ("self-collision", "table")


def _sentence(use: Use) -> str:
    at = f"{use.where} at {use.time:.3f} s" + ("" if use.is_proven else " (measured at 1 kHz)")
    if use.kind in DISTANCES:
        return (
            f"{use.kind}: at least {1e3 * use.value:.2f} mm where {1e3 * use.limit:.2f} mm are "
            f"needed, {at}"
        )
    return f"{use.kind}: at most {100 * use.bound:.4f} % of the limit, {at}"


def certificate(lib: Library, trajectory: Trajectory, safety: Safety | None = None) -> Certificate:
    """Bounds over all t of position, velocity, acceleration, jerk, and of the limits of `safety`.

    Raises:
        IdentificationError: the trajectory is not one of this robot, or `safety` asks for limits
            that the robot does not state.
    """
    bounds, times = joint_bounds(lib, trajectory)
    rooms = _rooms(lib, trajectory.home)
    uses, unlimited = [], []
    for order, kind in enumerate(KINDS):
        free = _unlimited(lib, kind)
        if free.any():
            unlimited.append(f"{kind} of {', '.join(np.array(lib.joint_names)[free])}")
        if not free.all():
            worst = int(np.argmax(bounds[order]))  # the first NaN, where there is one
            bound, time = float(bounds[order, worst]), float(times[order, worst])
            limit = float(min(room[order, worst] for room in rooms))
            what = lib.joint_names[worst], time, bound * limit, limit, UNITS[order]
            uses.append(Use(kind, bound, *what))
    rows = [
        Use(
            *(bound.law.kind, 1 + bound.bound, bound.law.labels[bound.row], bound.time),
            *bound.law.measured(bound.row, bound.bound),
            bound.is_proven,
        )
        for bound in law_bounds(laws(lib, trajectory.home, safety), trajectory)
    ]
    for kind in dict.fromkeys(row.kind for row in rows):
        uses.append(max((row for row in rows if row.kind == kind), key=lambda row: row.bound))
    distances = tuple(row for row in rows if row.kind in DISTANCES)
    return Certificate(tuple(uses), tuple(unlimited), unchecked(lib, safety), distances)


def fastest(lib: Library, trajectory: Trajectory, safety: Safety | None = None) -> float:
    """A share of the speed in whole percents, as large as is easily found, at which the path holds.

    0 where none is found: distances and the tip's box do not depend on speed.
    """
    proof = certificate(lib, trajectory, safety)
    stays = {"position", "tip box", *DISTANCES}
    if any(use.kind in stays or not np.isfinite(use.bound) for use in proof.broken):
        return 0.0
    low, high = (100, 101) if proof.holds else (0, 100)
    while high - low > 1:
        percent = (low + high) // 2
        if certificate(lib, slowed(trajectory, percent / 100), safety).holds:
            low = percent
        else:
            high = percent
    return low / 100


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
    step = end / count
    curves = _samples(basis.name, basis.zero_jerk, size, end, count) @ a.T
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


@lru_cache(maxsize=4)
def _samples(name: str, zero_jerk: bool, size: int, end: float, count: int) -> Array:
    """d^k φ_m/ds^k at count + 1 points from 0 to `end`: the same for all stages of a motion."""
    s = np.linspace(0.0, end, count + 1)
    return basis_of(name, zero_jerk).derivatives(len(KINDS) + 2, size, s)


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
