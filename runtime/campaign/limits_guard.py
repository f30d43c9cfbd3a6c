"""Guard of the limits of joints, also of those that follow several others or that a loop moves."""

from collections.abc import Sequence

import numpy as np

from runtime.campaign.driver import Reference, Sample
from runtime.excitation.limits.dependent_joints import (
    DependentJoints,
    dependent_limits,
    dependent_rows,
)
from runtime.library import Array, Library


class LimitsGuard:
    """Limits of the joints, also of those that follow several others or that a loop moves.

    Args:
        lib: library of the robot.
        margin: share of velocity and torque limits that a sample may exceed, for noise.
    """

    name = "limits"

    def __init__(self, lib: Library, margin: float = 0.05) -> None:
        self._names = lib.joint_names
        limits = lib.limits()
        self._lower, self._upper = limits["lower"], limits["upper"]
        self._most = {
            "velocity": (1 + margin) * limits["velocity"],
            "torque": (1 + margin) * limits["effort"],
        }
        self._dependent = DependentJoints(lib, dependent_rows(lib))
        low, high, speed = dependent_limits(lib, self._dependent.rows)
        self._ends, self._speed = (low, high), (1 + margin) * speed

    def refusal(self, sample: Sample, reference: Reference) -> str | None:
        """Sentence on the first limit that is exceeded."""
        for what, values in (
            ("position", sample.q),
            ("velocity", sample.dq),
            ("torque", sample.tau),
        ):
            if not np.isfinite(values).all():
                j = int(np.argmin(np.isfinite(values)))
                return f"expected a finite {what} of {self._names[j]}, got {values[j]}"
        return (
            _outside(self._names, sample.q, self._lower, self._upper)
            or _beyond("velocity", self._names, sample.dq, self._most["velocity"])
            or _beyond("torque", self._names, sample.tau, self._most["torque"])
            or self._of_dependents(sample)
        )

    def _of_dependents(self, sample: Sample) -> str | None:
        """Sentence on the first dependent joint beyond its limits, or on a loop that is open."""
        if not self._dependent.rows:
            return None
        x, dx, _ = (
            values[0]
            for values in self._dependent.motion(
                np.stack([sample.q, sample.dq, np.zeros_like(sample.q)])[:, None]
            )
        )
        names = self._dependent.names
        if not np.isfinite(x).all():
            j = int(np.argmin(np.isfinite(x)))
            return f"expected positions at which the loop of {names[j]} closes, got {sample.q}"
        return _outside(names, x, *self._ends) or _beyond("velocity", names, dx, self._speed)


def _outside(names: Sequence[str], q: Array, lower: Array, upper: Array) -> str | None:
    """Sentence on the first joint outside its range."""
    outside = (q < lower) | (q > upper)
    if not outside.any():
        return None
    j = int(np.argmax(outside))
    return f"expected {names[j]} in [{lower[j]:.4g}, {upper[j]:.4g}], got {q[j]:.4g}"


def _beyond(what: str, names: Sequence[str], values: Array, most: Array) -> str | None:
    """Sentence on the first joint whose value exceeds its limit."""
    beyond = np.abs(values) > most
    if not beyond.any():
        return None
    j = int(np.argmax(beyond))
    return f"expected a {what} of {names[j]} up to {most[j]:.4g}, got {values[j]:.4g}"
