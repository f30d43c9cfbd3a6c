"""Bounds of a trajectory against the limits of the robot for every instant, not only at samples.

The same path at another speed, and motions scaled back onto the limits that they touch, are further
motions with a certificate.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import ExportError
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.distance_limits import use_of
from runtime.excitation.limits.nonlinear_limits import DEPENDENT
from runtime.excitation.limits.safety import EMPTY_HAND, Safety, unchecked, unstated
from runtime.excitation.motion.trajectory import Motion, Trajectory
from runtime.excitation.proof.bounds import (
    KINDS,
    constraint_bounds,
    interval_count,
    joint_bounds,
    rooms,
)
from runtime.library import Library

UNITS = ("rad or m", "rad/s or m/s", "rad/s² or m/s²", "rad/s³ or m/s³")


@dataclass(frozen=True, slots=True)
class Use:
    """Largest use of one limit."""

    # position and braking (as a share of the way from home to the limit), velocity, acceleration,
    # jerk, position and velocity of dependent joints, torque, torque rate, tip box, tip speed,
    # self-collision, table, obstacle
    kind: str
    bound: float  # largest use over all t; 1 is the limit; distances: 1 + (limit − value)/0.1 m
    where: str  # joint, axis, pair or proxy of the largest use
    time: float  # its time, s; to one step of the grid
    value: float  # quantity there, in `unit`, as the bound states it
    limit: float  # limit of the quantity
    unit: str  # of value and limit
    is_proven: bool = True  # a theorem, not a measured second derivative (`constraint_bounds`)
    intervals: int = 0  # number of intervals of the proof

    @property
    def margin(self) -> float:
        """Rest of the limit, 1 − bound."""
        return 1.0 - self.bound

    @property
    def how(self) -> str:
        """Proven on how many intervals, or measured."""
        return f"proven, {self.intervals} intervals" if self.is_proven else "measured at 1 kHz"

    @property
    def holds(self) -> bool:
        """The limit is kept at every instant; false where the motion is not a number."""
        return self.bound <= 1.0


@dataclass(frozen=True, slots=True)
class Certificate:
    """Use of every limit at every instant."""

    uses: tuple[Use, ...]  # the largest use per kind of limit that is checked
    unlimited: tuple[str, ...]  # kinds and joints for which the robot states no limit
    unchecked: tuple[str, ...] = ()  # other limits that are not checked
    distances: tuple[Use, ...] = ()  # per pair, and per proxy over a table or at an obstacle
    load: str = EMPTY_HAND  # mass and box of the carried body that the limits count

    @property
    def holds(self) -> bool:
        """Every limit that is checked is kept at every instant."""
        return all(use.holds for use in self.uses)

    @property
    def broken(self) -> tuple[Use, ...]:
        """Limits that are not shown to be kept."""
        return tuple(use for use in self.uses if not use.holds)

    def sentences(self) -> tuple[str, ...]:
        """The load and one line per limit, for headers and logs."""
        return (
            f"load: {self.load}",
            *(_sentence(use) for use in self.uses),
            *(f"no limit stated: {text}" for text in self.unlimited),
            *(f"NOT checked: {text}" for text in self.unchecked),
        )


DISTANCES = ("self-collision", "table", "obstacle")
PLACES = {"position", DEPENDENT[0], "tip box", *DISTANCES}  # limits that lower speed does not help


def _sentence(use: Use) -> str:
    at = f"{use.where} at {use.time:.3f} s ({use.how})"
    if use.kind in DISTANCES:
        return (
            f"{use.kind}: at least {1e3 * use.value:.2f} mm where {1e3 * use.limit:.2f} mm are "
            f"needed, {at}"
        )
    return f"{use.kind}: at most {100 * use.bound:.4f} % of the limit, {at}"


def certificate_of(
    lib: Library, trajectory: Trajectory, safety: Safety | None = None
) -> Certificate:
    """Bounds over all t of position, velocity, acceleration, jerk and the limits of `safety`."""
    bounds, times = joint_bounds(lib, trajectory)
    limits, (up, down) = lib.limits(), rooms(lib, trajectory.home)
    uses, unlimited = [], []
    for order, kind in enumerate(KINDS):
        free = np.isinf(limits["lower"]) & np.isinf(limits["upper"])
        if order:
            free = ~np.isfinite(limits[kind])
        if free.any():
            unlimited.append(f"{kind} of {', '.join(np.array(lib.joint_names)[free])}")
        if not free.all():
            worst = int(np.argmax(bounds[order]))  # the first NaN, where there is one
            bound, time = float(bounds[order, worst]), float(times[order, worst])
            way = trajectory.at(lib, np.array([time]))[0][0, worst] - trajectory.home[worst]
            room = (up if way > 0 else down)[order, worst]
            if not np.isfinite(room):  # the side to which the joint has moved has no limit
                room = min(up[order, worst], down[order, worst])
            limit = float(room)
            what = lib.joint_names[worst], time, bound * limit, limit, UNITS[order]
            uses.append(Use(kind, bound, *what, intervals=interval_count(trajectory)))
    if safety is not None:
        unlimited += unstated(lib)
    rows = [
        Use(
            *(
                bound.constraint.kind,
                use_of(bound.constraint, bound.bound),
                bound.constraint.labels[bound.row],
                bound.time,
            ),
            *bound.constraint.measured(bound.row, bound.bound),
            bound.is_proven,
            bound.intervals,
        )
        for bound in constraint_bounds(lib, constraints(lib, trajectory.home, safety), trajectory)
    ]
    for kind in dict.fromkeys(row.kind for row in rows):
        uses.append(max((row for row in rows if row.kind == kind), key=lambda row: row.bound))
    distances = tuple(row for row in rows if row.kind in DISTANCES)
    carried = None if safety is None else safety.carried
    load = EMPTY_HAND if carried is None else carried.sentence
    if safety is not None and safety.models:
        load += f", every model within {safety.models}"
    return Certificate(tuple(uses), tuple(unlimited), unchecked(lib, safety), distances, load)


@dataclass(frozen=True, slots=True)
class CertifiedMotion:
    """A trajectory of a robot and the certificate of its limits, which need not hold."""

    lib: Library  # the robot
    trajectory: Motion  # its motion, one or several in a row
    safety: Safety | None  # limits beyond those of the joints; None where only those were checked
    certificate: Certificate  # of this trajectory under these limits

    def header(self) -> tuple[str, ...]:
        """Lines for the head of a file: robot, duration and the use of every limit."""
        first = (
            f"Excitation of '{self.lib.name}', {self.trajectory.duration:.17g} s. "
            "Limits at every instant, between samples too:"
        )
        return (first, *self.certificate.sentences())

    def require_limits(self) -> None:
        """Check that the certificate holds, as a motion for a robot must."""
        if self.certificate.holds:
            return
        broken = ", ".join(
            f"{use.kind} of {use.where} at {100 * use.bound:.4g} % ({use.time:.3f} s)"
            for use in self.certificate.broken
        )
        percent = 100 * fastest(self)
        advice = "design another motion"
        if percent >= 1:
            advice = f"add --speed {percent:.0f}, at which they are kept"
        raise ExportError(f"nothing is exported, the motion exceeds limits: {broken}; {advice}")


def certified(lib: Library, trajectory: Motion, safety: Safety | None = None) -> CertifiedMotion:
    """A motion with its certificate, computed here and nowhere else."""
    return CertifiedMotion(lib, trajectory, safety, _certificate(lib, trajectory, safety))


def _certificate(lib: Library, trajectory: Motion, safety: Safety | None) -> Certificate:
    """Certificate of a motion; of several in a row the largest use of every limit."""
    parts = [certificate_of(lib, part, safety) for part in trajectory.parts]
    later = [
        [
            [replace(use, time=use.time + start) for use in uses]
            for uses in (part.uses, part.distances)
        ]
        for part, start in zip(parts, trajectory.starts, strict=True)
    ]
    uses, distances = (
        tuple(_largest(same) for same in zip(*(part[k] for part in later), strict=True))
        for k in range(2)
    )
    return replace(parts[0], uses=uses, distances=distances)


def _largest(same: tuple[Use, ...]) -> Use:
    """Largest use of one limit by several motions, on the intervals of all of them."""
    bounds = [use.bound if np.isfinite(use.bound) else np.inf for use in same]
    return replace(same[int(np.argmax(bounds))], intervals=sum(use.intervals for use in same))


def fastest(motion: CertifiedMotion) -> float:
    """Largest speed found by bisection, in whole percents, at which the path keeps its limits."""
    certificate = motion.certificate
    if any(use.kind in PLACES or not np.isfinite(use.bound) for use in certificate.broken):
        return 0.0
    low, high = (100, 101) if certificate.holds else (0, 100)
    while high - low > 1:
        percent = (low + high) // 2
        if _certificate(motion.lib, motion.trajectory.slowed(percent / 100), motion.safety).holds:
            low = percent
        else:
            high = percent
    return low / 100


def pulled_inside(
    lib: Library, trajectory: Trajectory, most: float = 1e-3, share: float = 1.0
) -> Trajectory:
    """Scale joints that slightly exceed their own limits back onto them.

    A design that touches its limits at samples exceeds them between samples by the error of the
    chords. What exceeds by more is left as it is; the certificate states it.
    """
    bounds, _ = joint_bounds(lib, trajectory)
    use = bounds.max(axis=0) / share
    touched = (use > 1) & (use <= 1 + most)
    # The bound scales with a; 1e-9 is far above the rounding of its second evaluation.
    rho = np.where(touched, use * (1 + 1e-9), 1.0)
    return replace(trajectory, coefficients=trajectory.coefficients / rho[:, None])
