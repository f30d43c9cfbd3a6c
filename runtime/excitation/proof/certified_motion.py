"""A motion with its certificate, which is computed once and passed on to plots, tables and exports.

Also the same path at another speed, and motions scaled back onto the limits that they touch.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from runtime.errors import ExportError, IdentificationError
from runtime.excitation.limits.dependent_joints import DependentPosition
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import JoinedMotion, Trajectory
from runtime.excitation.proof.certificate import DISTANCES, Certificate, Use, certificate_of
from runtime.excitation.proof.joint_bounds import joint_bounds
from runtime.library import Library

AnyMotion = TypeVar("AnyMotion", Trajectory, JoinedMotion, Trajectory | JoinedMotion)


@dataclass(frozen=True, slots=True)
class CertifiedMotion:
    """A trajectory of a robot and the certificate of its limits, which need not hold."""

    lib: Library  # the robot
    trajectory: Trajectory | JoinedMotion  # its motion, one or several in a row
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
        advice = (
            f"add --speed {percent:.0f}, at which they are kept"
            if percent >= 1
            else "design another motion"
        )
        raise ExportError(f"nothing is exported, the motion exceeds limits: {broken}; {advice}")


def certified(
    lib: Library, trajectory: Trajectory | JoinedMotion, safety: Safety | None = None
) -> CertifiedMotion:
    """A motion with its certificate, computed here and nowhere else."""
    return CertifiedMotion(lib, trajectory, safety, _certificate(lib, trajectory, safety))


def _certificate(
    lib: Library, trajectory: Trajectory | JoinedMotion, safety: Safety | None
) -> Certificate:
    """Certificate of a motion; of several in a row the largest use of every limit."""
    if isinstance(trajectory, Trajectory):
        return certificate_of(lib, trajectory, safety)
    parts = [certificate_of(lib, part, safety) for part in trajectory.parts]
    starts = trajectory.starts
    later = [
        [
            [replace(use, time=use.time + start) for use in uses]
            for uses in (part.uses, part.distances)
        ]
        for part, start in zip(parts, starts, strict=True)
    ]
    uses, distances = (
        tuple(_largest(same) for same in zip(*(part[k] for part in later), strict=True))
        for k in range(2)
    )
    return replace(parts[0], uses=uses, distances=distances)


def _largest(same: tuple[Use, ...]) -> Use:
    """Largest use of one limit by several motions, on the intervals of all of them."""
    count = sum(use.intervals for use in same)
    return replace(max(same, key=_order), intervals=count)


def _order(use: Use) -> float:
    """The bound, +inf for what is not a number."""
    return use.bound if np.isfinite(use.bound) else np.inf


def fastest(motion: CertifiedMotion) -> float:
    """Largest speed found by bisection, in whole percents, at which the path keeps its limits."""
    certificate = motion.certificate
    stays = {"position", DependentPosition.kind, "tip box", *DISTANCES}
    if any(use.kind in stays or not np.isfinite(use.bound) for use in certificate.broken):
        return 0.0
    low, high = (100, 101) if certificate.holds else (0, 100)
    while high - low > 1:
        percent = (low + high) // 2
        slow = slowed(motion.trajectory, percent / 100)
        if _certificate(motion.lib, slow, motion.safety).holds:
            low = percent
        else:
            high = percent
    return low / 100


def slowed(trajectory: AnyMotion, speed: float) -> AnyMotion:
    """The same path at a lower speed, in the duration t_f / speed."""
    require_speed(speed)
    if isinstance(trajectory, JoinedMotion):
        return trajectory.slowed(speed)
    return replace(trajectory, duration=trajectory.duration / speed)


def require_speed(speed: float) -> float:
    """The speed itself, where it is a share above 0 and up to 1."""
    if not 0 < speed <= 1:
        raise IdentificationError(
            f"a replay needs a speed above 0 and up to 100 %, got {100 * speed:g} %; a faster "
            "motion must be designed with a shorter --duration"
        )
    return speed


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
