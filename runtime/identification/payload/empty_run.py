"""Residual of an empty run at the instants of the loaded one: torque that is not the payload's.

`posture_error` is the error of their difference that repeats with the position of a joint,

    u_g = (A − A_g)⁻¹ s_g,   s_g = Σ_{i in g} Y_iᵀ W e_i,   V = t² (K − 1)/K Σ_g (u_g − ū)²

Against an empty run errors of the arm cancel only if they were the same. What differs between the
runs (a spring, a cable, torque that no model has) returns wherever the posture returns, so that
periods of a motion do not average it, and residuals that are correlated in time do not show it.
u_g is the change of π without the rows g, a K-th of them that are neighbours in the position of a
joint. t is the 95 % quantile of Student's t with K − 1 degrees of freedom over that of the normal
distribution.
Source: delete-a-group jackknife, Efron & Stein 1981; groups of postures: ours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import NORMAL_95
from runtime.library import Array
from runtime.recording import Recording

LENGTH = 0.1
"""Relative difference of the durations above which the runs are not the same trajectory."""
APART = 0.05
"""Largest distance of the positions over the travel of a joint; controllers stay within 1 %."""
LEAST_TRAVEL = 0.02
"""Smallest travel that the distance is related to, rad or m."""
GROUPS = 5
"""K, groups of rows per joint."""
FEW = 2.7764451051977934 / NORMAL_95
"""t: intervals are those of a normal distribution, and K groups know their variance badly."""
SIGNIFICANT = 20.0
"""Variance by groups over that of the noise from which it counts. Of 7 joints and 10 entries the
largest ratio in 24 runs of an FR3 with white and coloured noise is 10.6: the groups are few, and
those at the ends of a range weigh most."""


def empty_residual(
    loaded: Recording, empty: Recording, residual: Array, names: Sequence[str]
) -> Array:
    """Interpolate the residual of the empty run at the instants of the loaded one.

    Returns (N, n) [N·m, N].
    """
    if abs(empty.duration - loaded.duration) > LENGTH * loaded.duration:
        raise IdentificationError(
            f"the empty run lasts {empty.duration:.3g} s, the loaded one {loaded.duration:.3g} s; "
            "record the same trajectory twice, or leave the empty run out"
        )
    t, t0 = loaded.t - loaded.t[0], empty.t - empty.t[0]

    def at(values: Array) -> Array:
        return np.stack([np.interp(t, t0, column) for column in values.T], axis=1)

    travel = np.maximum(np.ptp(loaded.q, axis=0), LEAST_TRAVEL)
    apart = np.max(np.abs(at(empty.q) - loaded.q), axis=0) / travel
    worst = int(np.argmax(apart))
    if apart[worst] > APART:
        raise IdentificationError(
            f"the empty run follows another trajectory: {names[worst]} differs by "
            f"{100 * apart[worst]:.0f} % of its travel at the same time; record the same "
            "trajectory from the same start, or leave the empty run out"
        )
    return at(residual)


@dataclass(frozen=True, slots=True, eq=False)
class PostureDeviation:
    """Errors that repeat with the position of a joint.

    Attributes:
        joint: its name.
        factors: of the standard deviations of π, (10,), at least 1.
    """

    joint: str
    factors: Array

    @property
    def sentence(self) -> str:
        """Note of the result."""
        return (
            f"the difference of the runs has errors that repeat with the position of "
            f"'{self.joint}', beside the payload: the intervals contain them (mass: "
            f"{self.factors[0]:.1f} times the noise); check --link, and record both runs with the "
            "same cables, springs and temperature"
        )

    def widened(self, covariance: Array) -> Array:
        """Covariance of π (10, 10) with the standard deviations times the factors."""
        return self.factors[:, None] * covariance * self.factors


def posture_error(
    run: Recording, names: Sequence[str], rows: Array, errors: Array, shape: Array,
    covariance: Array,
) -> PostureDeviation | None:  # fmt: skip
    """Errors that repeat with the position of the joint where they are largest."""
    whole, variance, q = np.linalg.inv(shape), np.diagonal(covariance), run.q
    worst, largest = None, SIGNIFICANT
    for joint in np.flatnonzero(np.ptp(q, axis=0) > LEAST_TRAVEL):
        edges = np.quantile(q[:, joint], np.arange(1, GROUPS) / GROUPS)
        group = np.searchsorted(edges, q[:, joint])
        changes = []
        for k in range(GROUPS):
            part = rows[group == k].reshape(-1, rows.shape[2])
            score = part.T @ errors[group == k].ravel()
            changes.append(np.linalg.solve(whole - part.T @ part, score))
        ratio = (GROUPS - 1) * np.var(changes, axis=0) / variance
        if ratio.max() > largest:
            largest = float(ratio.max())
            worst = PostureDeviation(names[int(joint)], np.maximum(FEW * np.sqrt(ratio), 1.0))
    return worst
