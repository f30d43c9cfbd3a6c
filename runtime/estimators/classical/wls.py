"""IDIM-WLS: least squares with each joint weighted by its residual, w_j = 1 / var(r_j).

Four passes from equal weights (iteratively reweighted least squares). Source: Gautier 1997,
Janot, Vandanjon & Gautier 2014.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.classical.ols import Solution, bounded, fit_of_base, solve
from runtime.estimators.method import Method
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression import compress_all
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

PASSES = 4
"""Passes of reweighting, the first with equal weights."""
SILENT = 1e-12
"""Variance, relative to the largest, below which the residual of a joint is rounding: a weight
from rounding would outweigh all other joints."""


def fit_wls(problem: Problem) -> Fit:
    """Identify base parameters and friction with weights from the residuals."""
    _, weights, silent = _reweighted(
        problem.lib,
        partial(problem.samples, "train"),
        problem.friction_names,
        problem.left_out,
        PASSES - 1,
    )
    solution, bound = bounded(problem, problem.statistics(weights))
    rests = (residual(problem.lib, piece, solution) for piece in problem.samples("train"))
    weights, silent = weights_of(variance_of(rests), problem.lib)
    sigma = ", ".join(f"{1 / np.sqrt(w):.3g}" for w in weights)
    notes = [f"standard deviations of the residuals, joint by joint: {sigma}"]
    if silent:
        notes.append(
            f"the residual of {silent} is zero to rounding, so its weight was limited; "
            "check that this torque is measured and not computed"
        )
    status = f"{PASSES} passes of weighted least squares; condition number {solution.condition:.1f}"
    notes += bound
    return fit_of_base(problem, solution.beta, solution.phi, status, PASSES, tuple(notes))


def reweighted(
    lib: Library,
    samples: Samples,
    terms: tuple[str, ...],
    known: NDArray[np.bool_] | None = None,
) -> tuple[Solution, Array, str]:
    """Solve by iteratively reweighted least squares.

    known (n k,) → (n,).
    """
    return _reweighted(lib, lambda: (samples,), terms, known)


def _reweighted(
    lib: Library,
    pieces: Callable[[], Iterable[Samples]],
    terms: tuple[str, ...],
    known: NDArray[np.bool_] | None,
    passes: int = PASSES,
) -> tuple[Solution, Array, str]:
    weights, silent = np.ones(lib.n_joints), ""
    for _ in range(passes):
        solution = solve(compress_all(lib, pieces(), weights), lib, terms, known)
        rests = (residual(lib, piece, solution) for piece in pieces())
        weights, silent = weights_of(variance_of(rests), lib)
    return solution, weights, silent


def residual(lib: Library, samples: Samples, solution: Solution) -> Array:
    """Residual τ − Y_b β − F φ.

    Returns (N, n) [N·m, N].
    """
    rigid = samples.base_rigid(lib, solution.beta)
    if solution.phi.size:
        rigid = rigid + samples.friction(solution.phi)
    return samples.tau - rigid


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
    """Weights 1 / var per joint.

    variance (n,) → (n,).
    """
    least = max(SILENT * float(variance.max()), np.finfo(float).tiny ** 0.5)
    silent = variance < least
    names = ", ".join(np.array(lib.joint_names)[silent])
    return 1.0 / np.maximum(variance, least), names


def with_torque(samples: Samples, tau: Array) -> Samples:
    """Return the same motion with another torque.

    tau (N, n) [N·m, N].
    """
    return replace(samples, tau=tau)


WLS = Method(
    "wls",
    "least squares with every joint weighted by its residual, four passes",
    fit_wls,
    from_statistics=True,
    every_joint=True,
    objective="weights joints by their residuals",
)
