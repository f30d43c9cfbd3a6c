"""Quantities that a search minimises, one record each.

| criterion | minimised |
|---|---|
| cond | log cond W̄_b, columns of unit length (Eq. 3.29): the document's |
| a | RMS standard deviation of the unknowns relative to their size |
| v | RMS error of the torque, all joints together, predicted on unseen motions |
| d | mean half-axis of the confidence ellipsoid (log det of the raw Gram matrix) |
| mixed | 0.8 log v + 0.2 log a + 0.8 log cond: small errors, and every column excited |

The descents of `mixed` have a smooth log cond (Schatten 16) in place of log cond, which compares
their ends. The last descent, of the best one alone, has a sharper norm with more weight.

Measures are functions of the Gram matrix G = WᵀW: of the eigenvalues of its columns at unit length,
or of the covariance G⁻¹ of least squares.

a, v and d depend on amplitudes, cond does not: one of its optima may hardly move a joint.

A new criterion is a record here and a line in `CRITERIA`. Another package adds one by an entry
point of the group "symgen.criteria".
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import LimitRows, Limits, whitening
from runtime.excitation.limits.nonlinear_limits import dependent_joints
from runtime.excitation.motion.trajectory import COSINE, Trajectory
from runtime.excitation.search.information import (
    Information,
    Measure,
    SpectralFunction,
    log_cond,
    normalised,
    of_unit_length,
)
from runtime.library import Array, Library
from runtime.registry import Registry

UNSEEN = 40  # number of motions
UNSEEN_DURATION, UNSEEN_HARMONICS, UNSEEN_SAMPLES = 10.0, 5, 40
"""Of each motion: duration [s], cosines per joint, samples of its way out."""
SMALLER = 0.97  # factor of a motion that breaks a limit of a dependent joint, as often as needed
UNSEEN_SEED = 20  # the same motions for all designs of a robot


def d_optimal(values: Array) -> tuple[float, Array]:
    """−½ mean log λ: zero when all columns are orthogonal; smooth, and depends on every λ."""
    return float(-np.log(values).mean() / 2), -0.5 / (len(values) * values)


def schatten(power: float) -> SpectralFunction:
    """(log Σ λ^p + log Σ λ^-p) / 2p: smooth, above log cond by at most log(n_b) / p."""

    def criterion(values: Array) -> tuple[float, Array]:
        log = np.log(values)
        total = slope = 0.0
        for sign in (1.0, -1.0):
            exponent = sign * power * log
            terms = np.exp(exponent - exponent.max())
            total += exponent.max() + np.log(terms.sum())
            slope = slope + sign * terms / terms.sum()
        return float(total / (2 * power)), slope / (2 * values)

    return criterion


def covariance(gram: Array) -> Array | None:
    """Inverse G⁻¹, or None where G does not have full rank to rounding."""
    size = np.sqrt(np.diag(gram))
    if not (size > 0).all():
        return None
    upper, info = lapack.dpotrf(gram / np.outer(size, size))
    if info or not np.diag(upper).min() ** 2 > len(gram) * np.finfo(float).eps:
        return None
    inverse, _ = lapack.dpotri(upper)
    return np.asarray((np.triu(inverse) + np.triu(inverse, 1).T) / np.outer(size, size))


def log_variance(seen: Array) -> Measure:
    """½ log tr(Q G⁻¹), the log of an RMS error of torque or parameters; ∞ without full rank."""
    return log_variances((1.0, seen))


def log_variances(*terms: tuple[float, Array]) -> Measure:
    """Weighted sum of such logs, Σ weight · ½ log tr(Q G⁻¹), of one inverse."""

    def measure(gram: Array) -> tuple[float, Array]:
        inverse = covariance(gram)
        if inverse is None:
            return np.inf, np.zeros_like(gram)
        value, slope = 0.0, np.zeros_like(gram)
        for weight, seen in terms:
            total = float(np.sum(seen * inverse))
            value += weight * float(np.log(total) / 2)
            slope = slope + weight * (-(inverse @ seen @ inverse) / total)
        return value, slope

    return measure


def log_volume(gram: Array) -> tuple[float, Array]:
    """−½ mean log of the eigenvalues of G: log of the mean half-axis of the error ellipsoid."""
    inverse = covariance(gram)
    if inverse is None:
        return np.inf, np.zeros_like(gram)
    return float(-np.linalg.slogdet(gram)[1] / (2 * len(gram))), -inverse / len(gram)


def weighted(*terms: tuple[float, Measure]) -> Measure:
    """Weighted sum of measures: Σ weight · measure."""

    def measure(gram: Array) -> tuple[float, Array]:
        value, slope = 0.0, np.zeros_like(gram)
        for weight, term in terms:
            one, one_slope = term(gram)
            value, slope = value + weight * one, slope + weight * one_slope
        return value, slope

    return measure


def mean_gram(rows: Array) -> Array:
    """Mean over samples of Y_kᵀ Y_k, (m, m), for Y (N, n, m)."""
    return np.einsum("tjk,tjl->kl", rows, rows, optimize=True) / len(rows)


def rank(gram: Array) -> int:
    """Number of independent columns, to rounding."""
    values = np.linalg.eigvalsh(of_unit_length(gram)[0])
    return int((values > len(gram) * np.finfo(float).eps * values[-1]).sum())


def too_many(excited: int, wanted: int, size: int) -> str:
    """Sentence about more unknowns than a motion excites."""
    return (
        f"the motion ({size} functions per joint) excites {excited} of {wanted} unknown columns; "
        "raise the setting harmonics, widen the range of positions, or leave out unknowns "
        "(friction, a payload that too few joints turn)"
    )


def unseen_motions(lib: Library, home: Array) -> list[Trajectory]:
    """Random cosines, each scaled until it reaches a limit, those of dependent joints included."""
    shape = (lib, home, UNSEEN_HARMONICS, UNSEEN_DURATION)
    matrix, _ = Limits(*shape).inequalities()
    spread = whitening(matrix, lib.n_joints)
    rng = np.random.default_rng(UNSEEN_SEED)
    dependents = dependent_joints(lib, home)
    # Both ways are the same path: even limits need its first half.
    phi = COSINE.at(lib, UNSEEN_HARMONICS, np.linspace(0.0, UNSEEN_DURATION, 201), UNSEEN_DURATION)
    rows = LimitRows(dependents, home, phi, half=True)
    # A home beyond such a limit has no way inside it.
    has_room = rows.worst(np.zeros((lib.n_joints, phi.shape[1]))) < 0.0
    motions = []
    for x in rng.normal(size=(UNSEEN, len(spread))):
        a = spread @ x
        a = (a / np.max(matrix @ a)).reshape(lib.n_joints, -1)
        while has_room and rows.worst(a) > 0.0:
            a = SMALLER * a
        motions.append(Trajectory(home, a, UNSEEN_DURATION))
    return motions


def unseen_times() -> Array:
    """Samples of the way out of an unseen motion, s; it comes back the same way."""
    return np.linspace(0.0, UNSEEN_DURATION / 2, UNSEEN_SAMPLES)


def unseen_torque(lib: Library, home: Array) -> Array:
    """Mean square of the torque per error of β: Q = mean of Y_bᵀ Y_b over unseen motions."""
    t = unseen_times()
    result = np.zeros((len(lib.base_columns),) * 2)
    for motion in unseen_motions(lib, home):
        rows = lib.base_regressor(*motion.at(lib, t)[:3])
        result += np.einsum("tjk,tjl->kl", rows, rows, optimize=True)
    return result / (UNSEEN * len(t))


def unseen_rows(lib: Library, home: Array) -> Array:
    """Base regressor (N, n, n_b) of all samples of unseen motions."""
    t = unseen_times()
    rows = [lib.base_regressor(*motion.at(lib, t)[:3]) for motion in unseen_motions(lib, home)]
    return np.concatenate(rows)


def unseen_joints(lib: Library, home: Array) -> Array:
    """The same mean as `unseen_torque`, joint by joint, (n, n_b, n_b)."""
    rows = unseen_rows(lib, home)
    return np.stack([mean_gram(rows[:, j : j + 1]) for j in range(lib.n_joints)])


PAYLOAD = np.array([1.0, *3 * [0.1], *6 * [0.01]])  # 1 kg, 0.1 m × 1 kg, (0.1 m)² × 1 kg
FLOOR = 0.01  # smallest size of an unknown, kg, kg·m or kg·m²: some base parameters vanish
SMOOTH = 16.0  # power of the Schatten norms in `mixed`
SHARE = 0.8  # weight of log cond in `mixed`
LAST_SMOOTH, LAST_SHARE = 32.0, 0.85
"""The same in the last descent, of the best start alone, which moves it a little along the
trade-off: cond 1 % smaller for 0.5 % in v."""
RELATIVE = 0.2
"""Part of log a in the mean log error of `mixed`: v alone ignores parameters that hardly change the
torque of other motions."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A criterion for one robot, home and information."""

    stages: tuple[tuple[Measure, int], ...]  # measures of the descent in turn, and iterations
    target: Measure  # measure of the last stage; its exponential has the unit of the criterion
    errors: Measure | None = None  # the target without its smooth log cond, if it has one
    condition_share: float = 0.0  # weight of log cond W̄_b beside `errors` at starts
    # logs of single errors which, with log cond W̄_b, choose among starts that are nearly as good
    # as the best, see `choice`
    balanced: tuple[Measure, ...] = ()
    last: Measure | None = None  # measure of the last descent, of the best start; None: target


@dataclass(frozen=True, slots=True)
class Criterion:
    """A quantity that a search can minimise."""

    name: str  # word by which a user selects it
    sentence: str  # what is minimised, for help texts
    unit: str  # unit of exp(target), for tables
    # makes its measures from a robot, a home (n,) and information, which is None where the
    # criterion does not need it and the caller has none
    goal: Callable[[Library, Array, Information | None], Goal]
    needs_information: bool = True  # the torque noise and the rate must be known
    # the target is log cond, whose optimum lies in a kink: semidefinite programmes end the search
    # in it, and variations of the best starts follow
    is_kinked: bool = False


def criterion_of(name: str, has_information: bool = True) -> Criterion:
    """The record of a criterion."""
    criterion = CRITERIA[name]
    if criterion.needs_information and not has_information:
        raise IdentificationError(
            f"the criterion '{name}' needs to know the torque noise; give it as "
            "information=information(lib, noise)"
        )
    return criterion


def smooth_goal(target: Measure) -> Goal:
    """Goal of a smooth measure: normalised D-optimality, which decides for a basin, then itself."""
    return Goal(((normalised(d_optimal), 100), (target, 250)), target)


def _relative_weights(lib: Library, information: Information) -> Array:
    """Q, (k, k), with which tr(Q G⁻¹) is the mean square of σ_k / size_k."""
    size = sizes(lib, information)
    return np.diag(1 / size**2) / len(size)


def _torque_weights(lib: Library, home: Array, information: Information) -> Array:
    """Q, (k, k), with which tr(Q G⁻¹) is the mean square of |Y_b δβ| over unseen motions."""
    return information.of_unknowns(unseen_torque(lib, home))


def sizes(lib: Library, information: Information) -> Array:
    """Typical sizes of the unknowns, to which their errors are compared."""
    every = np.maximum(np.abs(lib.base_matrix @ lib.pi0), FLOOR)
    if information.left_out:
        return np.delete(every, information.left_out)
    return every if information.columns is None else PAYLOAD


def _known(information: Information | None) -> Information:
    if information is None:
        raise IdentificationError("this criterion needs the torque noise")
    return information


def _cond(*_: object) -> Goal:
    stages = (normalised(d_optimal), 100), (normalised(schatten(8.0)), 60)
    return Goal((*stages, (normalised(schatten(32.0)), 60)), normalised(log_cond))


def _relative(lib: Library, _home: Array, information: Information | None) -> Goal:
    return smooth_goal(log_variance(_relative_weights(lib, _known(information))))


def _prediction(lib: Library, home: Array, information: Information | None) -> Goal:
    return smooth_goal(log_variance(_torque_weights(lib, home, _known(information))))


def _volume(*_: object) -> Goal:
    return smooth_goal(log_volume)


def _mixed(lib: Library, home: Array, information: Information | None) -> Goal:
    known = _known(information)
    torque, relative = _torque_weights(lib, home, known), _relative_weights(lib, known)
    errors = log_variances((1 - RELATIVE, torque), (RELATIVE, relative))
    goal = smooth_goal(weighted((1.0, errors), (SHARE, normalised(schatten(SMOOTH)))))
    parts = log_variance(torque), log_variance(relative)
    last = weighted((1.0, errors), (LAST_SHARE, normalised(schatten(LAST_SMOOTH))))
    return replace(goal, errors=errors, condition_share=SHARE, balanced=parts, last=last)


V = Criterion("v", "expected torque error on other motions", "N·m", _prediction)
A = Criterion("a", "expected relative error of the parameters", "relative error", _relative)
D = Criterion("d", "size of the parameters' confidence ellipsoid", "half-axis", _volume)
COND = Criterion(
    "cond",
    "condition number of the base regressor with columns of unit length",
    "cond",
    _cond,
    needs_information=False,
    is_kinked=True,
)
MIXED = Criterion("mixed", "v, a and cond together", "(N·m cond)^0.8", _mixed)

CRITERIA = Registry(  # all criteria by name
    "symgen.criteria",
    Criterion,
    "criterion",
    {name.lower(): f"{__name__}:{name}" for name in ("V", "A", "D", "COND", "MIXED")},
    IdentificationError,
)
