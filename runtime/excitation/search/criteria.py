"""What a search is after: the criteria that it descends in turn, and the one that decides.

| criterion | minimised |
|---|---|
| cond | log cond W̄_b, columns of unit length (Eq. 3.29): the document's |
| a | RMS standard deviation of the unknowns relative to their size |
| v | RMS error of the torque, all joints together, predicted on motions never seen |
| d | mean half-axis of the confidence ellipsoid (log det of the raw Gram matrix) |
| mixed | log v² + a smooth log cond (Schatten 16): good predictions, no column in the dark |

a, v and d see amplitudes, cond does not: one of its optima may hardly move a joint.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.joint_limits import Limits, whitening
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.information import Information
from runtime.excitation.search.measures import (
    Measure,
    d_optimal,
    log_cond,
    log_variance,
    log_volume,
    mixed,
    normalised,
    schatten,
)
from runtime.library import Array, Library
from runtime.library.parameters import pi_from_parts

UNSEEN = 40
"""Motions on which torque is to be predicted."""
UNSEEN_DURATION, UNSEEN_HARMONICS, UNSEEN_SAMPLES = 10.0, 5, 40
"""Of each: s, cosines per joint, samples of its way out."""
UNSEEN_SEED = 20
"""The same motions for all designs of a robot."""
PAYLOAD = pi_from_parts(mass=1.0, first_moment=0.1, inertia=0.01)
"""Size of a payload's unknowns: 1 kg, 0.1 m × 1 kg, (0.1 m)² × 1 kg."""
FLOOR = 0.01
"""What is smaller counts as of this size, kg, kg·m or kg·m²: some base parameters vanish."""
SMOOTH = 16.0
"""Power of the Schatten norms in `mixed`."""
SHARE = 0.8
"""Of them there."""


@dataclass(frozen=True, slots=True)
class Goal:
    """What a search is after.

    Attributes:
        stages: measures of the descent in turn, and iterations of each.
        target: the measure that compares starts; its exponential has a unit.
        is_kinked: the target is log cond, whose optimum lies in a kink: `polish` ends in it.
        unit: of exp(target), for people.
    """

    stages: tuple[tuple[Measure, int], ...]
    target: Measure
    is_kinked: bool
    unit: str


def goal(name: str, lib: Library, home: Array, information: Information | None) -> Goal:
    """The goal of a criterion.

    Raises:
        IdentificationError: there is none of this name, or it needs information.
    """
    if name not in CRITERIA:
        raise IdentificationError(
            f"there is no criterion '{name}'; choose from {', '.join(CRITERIA)}"
        )
    if information is None:
        if name != "cond":
            raise IdentificationError(f"the criterion '{name}' needs to know the torque noise")
        return _cond()
    return CRITERIA[name](lib, home, information)


def _cond(*_: object) -> Goal:
    stages = (normalised(d_optimal), 100), (normalised(schatten(8.0)), 60)
    return Goal((*stages, (normalised(schatten(32.0)), 60)), normalised(log_cond), True, "cond")


def _relative(lib: Library, home: Array, information: Information) -> Goal:
    del home
    return _smooth(relative_error(lib, information), "relative error")


def _prediction(lib: Library, home: Array, information: Information) -> Goal:
    return _smooth(torque_error(lib, home, information), "N·m")


def _volume(*_: object) -> Goal:
    return _smooth(log_volume, "half-axis")


def _mixed(lib: Library, home: Array, information: Information) -> Goal:
    torque = torque_error(lib, home, information)
    # ½ (log tr Q G⁻¹ + log cond): as much for the variance as for the condition number.
    return _smooth(mixed(torque, normalised(schatten(SMOOTH)), SHARE), "N·m √cond")


def _smooth(target: Measure, unit: str) -> Goal:
    # Normalised D-optimality decides for a basin, whatever follows.
    return Goal(((normalised(d_optimal), 100), (target, 150)), target, False, unit)


def relative_error(lib: Library, information: Information) -> Measure:
    """Log of the RMS over the unknowns of σ_k / size_k."""
    size = sizes(lib, information)
    return log_variance(np.diag(1 / size**2) / len(size))


def torque_error(lib: Library, home: Array, information: Information) -> Measure:
    """Log of the RMS over unseen motions of the torque's error |Y_b δβ| of all joints, N·m or N."""
    seen = unseen_torque(lib, home)
    if information.columns is not None:
        seen = information.columns.T @ seen @ information.columns
    return log_variance(seen)


def sizes(lib: Library, information: Information) -> Array:
    """What the unknowns' errors are relative to, (k,)."""
    if information.columns is not None:
        return PAYLOAD
    return np.maximum(np.abs(lib.base_matrix @ lib.pi0), FLOOR)


def unseen_motions(lib: Library, home: Array) -> list[Trajectory]:
    """Random cosines that reach a limit: fixed for a robot and its home."""
    shape = (lib, home, UNSEEN_HARMONICS, UNSEEN_DURATION)
    matrix, _ = Limits(*shape).inequalities()
    spread = whitening(matrix, lib.n_joints)
    rng = np.random.default_rng(UNSEEN_SEED)
    motions = []
    for x in rng.normal(size=(UNSEEN, len(spread))):
        a = spread @ x
        a /= np.max(matrix @ a)
        motions.append(Trajectory(home, a.reshape(lib.n_joints, -1), UNSEEN_DURATION))
    return motions


def unseen_times() -> Array:
    """Samples of an unseen motion's way out, s; it comes back the same way."""
    return np.linspace(0.0, UNSEEN_DURATION / 2, UNSEEN_SAMPLES)


def unseen_torque(lib: Library, home: Array) -> Array:
    """Q = mean of Y_bᵀ Y_b over the samples of unseen motions, (n_b, n_b)."""
    t = unseen_times()
    result = np.zeros((len(lib.base_columns),) * 2)
    for motion in unseen_motions(lib, home):
        rows = lib.base_regressor(*motion.at(lib, t)[:3])
        result += np.einsum("tjk,tjl->kl", rows, rows, optimize=True)
    return result / (UNSEEN * len(t))


CRITERIA: dict[str, Callable[[Library, Array, Information], Goal]] = {
    "v": _prediction,
    "a": _relative,
    "d": _volume,
    "cond": _cond,
    "mixed": _mixed,
}
