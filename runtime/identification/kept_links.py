"""Friction of a log with the links of an earlier result.

    min_φ  ‖W½ (τ − Y π − F φ)‖² / S + Σ ((φ − φ₀)/σ_φ)²,   lower ≤ φ ≤ upper

W are 1/s² of the residuals, S is the density of their coloured noise at the frequencies of the
columns, φ₀ the earlier coefficients and σ_φ what they may have changed by: their size, and no less
than `LEAST_SHARE` of the joint's torque. A column that the log does not excite keeps its
coefficient, and a few seconds suffice for the others.
"""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError, NotRealisableError
from runtime.estimators.problem import (
    Bounds,
    Fit,
    FrictionPrior,
    Problem,
    best_friction,
    bounds_of,
    notes_of,
    within_bounds,
)
from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.posterior import posterior_of
from runtime.estimators.regression.samples import residuals, samples_of
from runtime.identification.identified import Identification
from runtime.identification.metrics import TorqueError, torque_error
from runtime.identification.problem_setup import assemble
from runtime.identification.saved_result import SavedResult
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_assembled
from runtime.library import Array, Library
from runtime.recording import Recording

LEAST_SHARE = 0.1  # least torque of an expected change, over the RMS torque of its joint
PASSES = 3  # fits, each with the weights and the noise of the residuals of the one before
ROWS = 8192
QUIET = 1e-6  # least residual of a joint over its RMS torque: rounding, where a model is exact
TINY = 1e-12  # least standard deviation and noise: a log without torque has none
FREE = "pc-ols"  # method with the rules of a fit without inertial prior: it is repeated on all rows
STATUS = "friction of this log, links of an earlier result"


@dataclass(frozen=True, slots=True, eq=False)
class FrictionOfLog:
    """A result with the links of an earlier one and the friction of a log."""

    result: Identification  # links, friction, and errors on the test part of the log
    sigma: Array  # standard deviations of the friction coefficients, 0 of a kept one, (n, k)
    earlier: TorqueError  # error of the earlier result on the same test part


@one_blas_thread
def identify_friction(
    recording: Recording, lib: Library, saved: SavedResult, settings: Settings | None = None
) -> FrictionOfLog:
    """Identify the friction of a log with the links of an earlier result."""
    if saved.record.joints != lib.joint_names or saved.pi.shape != lib.pi0.shape:
        raise IdentificationError(
            f"expected an earlier result of the joints {', '.join(lib.joint_names)}, got one of "
            f"{', '.join(saved.record.joints)}; give the library that it was identified with"
        )
    if not saved.friction.columns:
        raise IdentificationError(
            "expected an earlier result with friction columns, got one without friction; identify "
            "the robot with --friction"
        )
    chosen = replace(settings or Settings(), friction=saved.friction)
    assembly = assemble(recording, lib, chosen, is_joined=True)
    if assembly.problem.train.equations < lib.n_joints:
        raise IdentificationError(
            "expected rows of every joint, got rows of power, which mix the friction of all "
            "joints; prepare the log with the regressor acceleration or momentum"
        )
    sigmas: list[Array] = []

    def fitted(each: Problem) -> Fit:
        fit, sigma = _fitted(each, saved)
        sigmas.append(sigma)
        return fit

    test = samples_of(assembly.parts[2], lib)
    error = torque_error(test.tau, test.rigid(lib, saved.pi) + test.friction(saved.phi))
    result = identify_assembled(assembly, replace(chosen, method=FREE, certify=False), fitted)
    return FrictionOfLog(replace(result, method=saved.record.method), sigmas[-1], error)


def _fitted(problem: Problem, saved: SavedResult) -> tuple[Fit, Array]:
    """Friction of some rows with the noise of its own residuals, and σ of its coefficients."""
    lib, rows, shape = problem.lib, problem.train, saved.phi.shape
    sizes, rms = rows.column_sizes(), np.sqrt(np.mean(np.square(rows.tau), axis=0))
    least = np.divide(LEAST_SHARE * rms[:, None], sizes, out=np.zeros(shape), where=sizes > 0)
    # A column without values, as of a joint at rest, keeps its coefficient by its bounds.
    change = np.where(sizes > 0, np.maximum(np.abs(saved.phi), least) + TINY, np.inf)
    prior, bounds = FrictionPrior(saved.phi, change), bounds_of(problem, is_passive=True)
    unused, kept = (sizes == 0).ravel(), saved.phi.ravel()
    bounds = Bounds(*(np.where(unused, kept, end) for end in (bounds.lower, bounds.upper)))
    phi, beta = saved.phi, lib.base_matrix @ saved.pi

    def solved(part: Statistics) -> tuple[Array, Array, None]:
        return best_friction(part, saved.pi, shape).ravel(), beta, None

    for _ in range(PASSES):
        rest = residuals(lib, rows, saved.pi, phi)
        noise = np.maximum(np.sqrt(np.mean(np.square(rest), axis=0)), QUIET * rms + TINY)
        weights, scaled = 1.0 / noise**2, rows.friction_rows()[:ROWS] / noise[:, None]
        density = coloured_noise_of_rows(scaled, rest[:ROWS] / noise).density
        data = problem.statistics(weights)
        whole = data.merged(prior.statistics(data, max(density, np.finfo(float).tiny)))
        free, _, held = within_bounds(whole, bounds, solved)
        phi = free.reshape(shape)
    columns = whole.factor[:, whole.n_base :]
    sigma = np.sqrt(density) * np.linalg.norm(posterior_of(columns).root, axis=1).reshape(shape)
    notes = notes_of(held, bounds, lib.joint_names, problem.friction_names)
    lam = None
    with suppress(NotRealisableError):
        lam = lib.lam_from_pi(saved.pi)
    return Fit(saved.pi, phi, lam, STATUS, notes=notes, weights=weights, statistics=data), sigma
