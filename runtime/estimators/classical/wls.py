"""IDIM-WLS: least squares with each joint weighted by its own residual, w_j = 1 / var(r_j).

Four passes from equal weights (iteratively reweighted least squares). Source: Gautier 1997,
Janot, Vandanjon & Gautier 2014.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from runtime.estimators.classical.ols import Solution, fit_of_base, solve
from runtime.estimators.method import Method
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression import compress_all
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

PASSES = 4
SILENT = 1e-12
"""Variance, relative to the largest, below which a joint's residual is rounding: a weight that
counts nothing but rounding would make the other joints meaningless."""


def fit_wls(problem: Problem) -> Fit:
    """Base parameters and friction with weights from the residuals.

    Raises:
        IdentificationError: the motion does not excite all base parameters.
    """
    found, weights, silent = _reweighted(
        problem.lib, partial(problem.samples, "train"), problem.friction_names
    )
    sigma = ", ".join(f"{1 / np.sqrt(w):.3g}" for w in weights)
    notes = [f"standard deviations of the residuals, joint by joint: {sigma}"]
    if silent:
        notes.append(
            f"the residual of {silent} is zero to rounding, so its weight was held down; "
            "check that this torque is measured and not computed"
        )
    status = f"{PASSES} passes of weighted least squares; condition number {found.condition:.1f}"
    return fit_of_base(problem, found.beta, found.phi, status, PASSES, tuple(notes))


def reweighted(
    lib: Library, samples: Samples, terms: tuple[str, ...]
) -> tuple[Solution, Array, str]:
    """The solution, the weights that belong to its residuals, and joints without residual.

    `terms` as in `ols.solve`.

    Raises:
        IdentificationError: the motion does not excite all base parameters.
    """
    return _reweighted(lib, lambda: (samples,), terms)


def _reweighted(
    lib: Library, pieces: Callable[[], Iterable[Samples]], terms: tuple[str, ...]
) -> tuple[Solution, Array, str]:
    weights, silent = np.ones(lib.n_joints), ""
    for _ in range(PASSES):
        found = solve(compress_all(lib, pieces(), weights), lib, terms)
        weights, silent = weights_of(variance_of(residual(lib, p, found) for p in pieces()), lib)
    return found, weights, silent


def residual(lib: Library, samples: Samples, found: Solution) -> Array:
    """τ − Y_b β − F φ, (N, n)."""
    rigid = samples.base_rigid(lib, found.beta)
    if found.phi.size:
        rigid = rigid + samples.friction(found.phi)
    return samples.tau - rigid


def variance_of(residuals: Iterable[Array]) -> Array:
    """Variance per joint of all pieces together (Chan, Golub & LeVeque 1983)."""
    count, mean, power = 0, np.zeros(0), np.zeros(0)
    for rest in residuals:
        own, more = rest.mean(axis=0), len(rest)
        if not count:
            count, mean, power = more, own, rest.var(axis=0) * more
            continue
        shift = own - mean
        power = power + rest.var(axis=0) * more + shift**2 * (count * more / (count + more))
        mean, count = mean + shift * (more / (count + more)), count + more
    return power / count


def weights_of(variance: Array, lib: Library) -> tuple[Array, str]:
    """1 / var per joint, and the names of joints whose residual is zero to rounding."""
    least = max(SILENT * float(variance.max()), np.finfo(float).tiny ** 0.5)
    silent = variance < least
    names = ", ".join(np.array(lib.joint_names)[silent])
    return 1.0 / np.maximum(variance, least), names


def with_torque(samples: Samples, tau: Array) -> Samples:
    """The same motion with another torque."""
    return replace(samples, tau=tau)


WLS = Method(
    "wls",
    "least squares with every joint weighted by its residual, four passes",
    fit_wls,
    from_statistics=True,
    every_joint=True,
    objective="weights joints by their residuals",
)
