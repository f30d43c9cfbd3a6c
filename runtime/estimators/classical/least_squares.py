"""IDIM-OLS and IDIM-WLS: min ‖W_b β + F φ − T‖ on base parameters, by QR (Eq. 3.7).

The result need not be physically consistent. π is the vector nearest to the first guess with
K π = β. OLS is unweighted; WLS weights each joint by its residual, w_j = 1 / var(r_j), in four
passes from equal weights (iteratively reweighted least squares).
Source: Gautier 1997; Janot, Vandanjon & Gautier 2014; document Sec. 3.1.3.
"""

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.methods import Method
from runtime.estimators.problem import Fit, Problem, bounds_of, notes_of, within_bounds
from runtime.estimators.regression.factor import Statistics, compress_all
from runtime.estimators.regression.posterior import posterior_of
from runtime.estimators.regression.samples import Samples, names_of_equations
from runtime.library import Array, Library, Mask
from runtime.library.parameters import links, mass
from runtime.recording.settings import COLUMNS, FrictionColumn

PASSES = 4  # passes of reweighting, the first with equal weights
SILENT = 1e-12
"""Variance, relative to the largest, below which the residual of a joint is rounding: a weight
from rounding would outweigh all other joints."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Least-squares solution."""

    beta: Array  # β, (n_b,)
    phi: Array  # φ, (n, k)
    condition: float  # condition number of the normalised columns


def fit_ols(problem: Problem) -> Fit:
    """Identify base parameters and friction together by ordinary least squares."""
    statistics = problem.statistics(np.ones(problem.train.equations))
    solution, notes = bounded(problem, statistics)
    text = f"solved by QR; condition number of the normalised columns {solution.condition:.1f}"
    return fit_of_base(problem, solution.beta, solution.phi, text, notes=notes)


def bounded(problem: Problem, statistics: Statistics) -> tuple[Solution, tuple[str, ...]]:
    """Least squares with friction coefficients of a size that the torque allows."""
    lib, names = problem.lib, problem.friction_names
    is_column = statistics.factor[:, statistics.n_base :].any(axis=0)

    def solved(part: Statistics) -> tuple[Array, Array, Solution]:
        held = is_column & ~part.factor[:, part.n_base :].any(axis=0)
        known = held if problem.left_out is None else held | problem.left_out
        solution = solve(part, lib, names, np.asarray(known), problem.train.shape[0])
        return solution.phi.ravel(), solution.beta, solution

    bounds = bounds_of(problem, is_passive=False)
    phi, solution, held = within_bounds(statistics, bounds, solved)
    notes = notes_of(held, bounds, lib.joint_names, names)
    notes += _zero_columns(problem, np.asarray(is_column))
    return replace(solution, phi=phi.reshape(problem.train.shape)), notes


def _zero_columns(problem: Problem, is_column: Mask) -> tuple[str, ...]:
    """Sentence on columns without an effect; those of rotors, motors and springs may be zero."""
    names = problem.friction_names
    zero = ~is_column if problem.left_out is None else ~is_column & ~problem.left_out
    places = itertools.product(problem.lib.joint_names, names)
    listed = [
        f"{name} of {joint}"
        for (joint, name), is_zero in zip(places, zero, strict=False)
        if is_zero and name in COLUMNS and not _is_optional(COLUMNS[name])
    ]
    if not listed:
        return ()
    return (f"friction columns that are zero in the whole log got 0: {', '.join(listed)}",)


def solve(
    statistics: Statistics,
    lib: Library,
    terms: tuple[str, ...] = (),
    known: Mask | None = None,
    rows: int | None = None,
) -> Solution:
    """Solve compressed samples by least squares with normalised columns: φ of n or other rows."""
    shown = np.ones(statistics.factor.shape[1], dtype=bool)
    # A column of zeros, such as the load of a joint that carries none, is no unknown and gets 0. A
    # function of the speed alone is zero only where the joint stands still, which is refused.
    of_speed = [name in COLUMNS and COLUMNS[name].in_closed_loop for name in terms]
    unknown = statistics.factor[:, statistics.n_base :].any(axis=0)
    if any(of_speed):
        unknown |= np.tile(of_speed, lib.n_joints)
    shown[statistics.n_base :] = unknown & ~counted_in_links(statistics, lib, terms)
    if known is not None:
        shown[statistics.n_base :] &= ~known
    fit = posterior_of(statistics.factor[:, shown], statistics.target)
    rank = len(fit.sizes)
    if rank < shown.sum():
        raise IdentificationError(
            f"the motion excites {rank} of {shown.sum()} columns (base parameters and friction), "
            "so least squares has no unique solution; record a richer trajectory, or use a method "
            "that keeps unexcited parameters at the first guess: map, adam, pc-ols"
        )
    solution = np.zeros(len(shown))
    solution[shown] = fit.mean
    beta, phi = np.split(solution, [statistics.n_base])
    shaped = phi.reshape(rows or lib.n_joints, -1)
    return Solution(beta, shaped, float(fit.sizes[0] / fit.sizes[-1]))


def counted_in_links(statistics: Statistics, lib: Library, terms: tuple[str, ...]) -> Mask:
    """Columns of rotors, coupled motors and springs that base parameters explain as well.

    On the first joint of an arm above all, a link acts as the rotor does, and a method without a
    prior cannot separate them. Source: Gautier's regrouping.
    """
    optional = [name in COLUMNS and _is_optional(COLUMNS[name]) for name in terms]
    if not any(optional):
        return np.zeros(statistics.factor.shape[1] - statistics.n_base, dtype=bool)
    return statistics.explained() & np.tile(optional, lib.n_joints)


def _is_optional(column: FrictionColumn) -> bool:
    return column.is_inertial or column.of_motors or column.is_shared


def pi_of_beta(problem: Problem, beta: Array) -> Array:
    """Return the π nearest to the first guess with K π = β: beta (n_b,) → (10 n,)."""
    guess, k = problem.lib.pi_from_lam(problem.start), problem.lib.base_matrix
    return np.asarray(guess + np.linalg.lstsq(k, beta - k @ guess, rcond=None)[0])


def fit_of_base(problem: Problem, beta: Array, phi: Array, status: str, **facts: Any) -> Fit:
    """Return the result of a method that estimates base parameters, with further facts."""
    return fit_of_pi(problem, pi_of_beta(problem, beta), phi, status, **facts)


def fit_of_pi(problem: Problem, pi: Array, phi: Array, status: str, **facts: Any) -> Fit:
    """Return the result of a method that estimates π, with further facts."""
    lib = problem.lib
    is_consistent = bool((lib.relative_eigenvalues(pi) > 0).all() and (mass(links(pi)) > 0).all())
    return Fit(pi, phi, lib.lam_from_pi(pi) if is_consistent else None, status, **facts)


def fit_wls(problem: Problem) -> Fit:
    """Identify base parameters and friction with weights from the residuals."""
    lib, pieces, names = problem.lib, partial(problem.samples, "train"), problem.friction_names
    _, weights, _ = reweighted(lib, pieces, names, problem.left_out, PASSES - 1, problem.train)
    solution, bound = bounded(problem, problem.statistics(weights))
    rests = (residual(lib, piece, solution) for piece in pieces())
    weights, silent = weights_of(variance_of(rests), lib)
    sigma = ", ".join(f"{1 / np.sqrt(w):.3g}" for w in weights)
    each = "joint" if len(weights) == lib.n_joints else "equation"
    notes = [f"standard deviations of the residuals, {each} by {each}: {sigma}"]
    if silent:
        notes.append(
            f"the residual of {silent} is zero to rounding, so its weight was limited; "
            "check that this torque is measured and not computed"
        )
    status = f"{PASSES} passes of weighted least squares; condition number {solution.condition:.1f}"
    facts = {"iterations": PASSES, "notes": (*notes, *bound)}
    return fit_of_base(problem, solution.beta, solution.phi, status, **facts)


def reweighted(
    lib: Library,
    pieces: Callable[[], Iterable[Samples]],
    terms: tuple[str, ...],
    known: Mask | None,
    passes: int = PASSES,
    like: Samples | None = None,
) -> tuple[Solution, Array, str]:
    """Solve by iteratively reweighted least squares: known (n k,) → (n,); rows as those of like."""
    weights, silent = np.ones(lib.n_joints if like is None else like.equations), ""
    rows = None if like is None else like.shape[0]
    for _ in range(passes):
        solution = solve(compress_all(lib, pieces(), weights), lib, terms, known, rows)
        rests = (residual(lib, piece, solution) for piece in pieces())
        weights, silent = weights_of(variance_of(rests), lib)
    return solution, weights, silent


def residual(lib: Library, samples: Samples, solution: Solution) -> Array:
    """Residual τ − Y_b β − F φ, (N, n) [N·m, N]."""
    x = np.concatenate([solution.beta, solution.phi.ravel()])
    return samples.tau - samples.base_torque(lib, x)


def variance_of(residuals: Iterable[Array]) -> Array:
    """Variance per joint of all pieces together (Chan, Golub & LeVeque 1983)."""
    count, mean, power = 0, np.zeros(0), np.zeros(0)
    for rest in residuals:
        piece_mean, more = rest.mean(axis=0), len(rest)
        if not count:
            count, mean, power = more, piece_mean, rest.var(axis=0) * more
            continue
        shift = piece_mean - mean
        power = power + rest.var(axis=0) * more + shift**2 * (count * more / (count + more))
        mean, count = mean + shift * (more / (count + more)), count + more
    return power / count


def weights_of(variance: Array, lib: Library) -> tuple[Array, str]:
    """Weights 1 / var per joint: variance (n,) → (n,)."""
    least = max(SILENT * float(variance.max()), np.finfo(float).tiny ** 0.5)
    silent = variance < least
    rows = names_of_equations(lib.joint_names, len(variance))
    return 1.0 / np.maximum(variance, least), ", ".join(np.array(rows)[silent])


OLS = Method(
    "ols",
    "ordinary least squares on base parameters, not always consistent (Eq. 3.7)",
    fit_ols,
    from_statistics=True,
    objective="minimises the unweighted error",
)
WLS = Method(
    "wls",
    "least squares with every joint weighted by its residual, four passes",
    fit_wls,
    from_statistics=True,
    every_joint=True,
    objective="weights joints by their residuals",
)
