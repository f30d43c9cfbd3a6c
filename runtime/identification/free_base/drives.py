"""Delay and noise of commanded torques of a robot with a free base.

Gauss–Newton on the delay d and expectation–maximisation on the covariance Σ = L Lᵀ of the rows in
turn. With N of `rows`, e = Nᵀ L⁻¹ r are the equations of residuals r, and L⁻¹ r given them is

    E[L⁻¹ r | e] = N e,   Σ ← L mean(N e eᵀ Nᵀ + 1 − N Nᵀ) Lᵀ

since what the unknown wrenches hide of L⁻¹ r keeps its variance of one. Σ is no diagonal: an error
of the attitude or of an encoder enters many rows. The step of d is the
coefficient of its column at the most probable model. Source: Dempster, Laird & Rubin 1977.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.estimators.methods import fit_by
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import FrictionPrior, NoiseFloor, Problem
from runtime.estimators.regression.samples import Samples, residuals, thesis_weights
from runtime.identification.free_base.noise import rms
from runtime.identification.free_base.rows import CHOSEN, Drives, FreeBaseRows, rows_of
from runtime.library import Array, Library
from runtime.library.free_base import FREEDOM
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion, motion_of
from runtime.recording.settings import Friction

COLUMNS = ("viscous", "coulomb", "rotor")
"""Friction columns by default: a computed torque has no offset of a sensor."""
PASSES, ENOUGH = 12, 500
"""Limit of the number of passes, and instants that they take."""
DONE_S, DONE = 1e-4, 0.03
"""Step of the delay [s] and relative change of σ at the end."""
MOST_STEP_S, EARLIEST_S, LATEST_S = 0.02, -0.03, 0.1
"""Largest step of a pass, and range of the delay [s]."""
FIRST = 0.05
"""σ at the start: share of the torque of a joint, of the weight, and of the weight times 0.1 m."""
_OPPOSITE = 3.0
"""Residual of the URDF over that with the opposite torques from which signs count as wrong."""


def drives_of(
    recording: FreeBaseRecording,
    lib: Library,
    choice: str,
    terms: Friction,
    delay_s: float | None,
    cutoff_hz: float | None,
    trained: Callable[[FreeBaseMotion], NDArray[np.int64]],
    prior: PriorFile | None,
) -> Drives:
    """Delay, unless it is stated, and noise of the rows that train."""
    drives = Drives(terms, None, delay_s or 0.0, delay_s is None)
    few: FreeBaseMotion | None = None
    for _ in range(PASSES):
        if few is None:
            motion = motion_of(recording, lib.joint_names, cutoff_hz, drives.delay_s, terms)
            train = trained(motion)
            few = motion.rows(train[:: max(1, len(train) // ENOUGH)])
        before = drives.covariance
        if before is None:
            before = _first_noise(lib, few)
            drives = replace(drives, covariance=before)
            _require_sign(lib, rows_of(lib, few, choice, drives), recording.name)
        rows = rows_of(lib, few, choice, drives)
        samples = rows.samples
        names = drives.names(lib.joint_names)
        problem = problem_of(lib, samples, samples, names, unit_noise(samples), None)
        fit = fit_by(problem, "map", None, prior)
        error = residuals(lib, rows.samples, fit.pi, fit.phi)
        after = _noise(rows, error, before, choice)
        ratio = np.diagonal(after) / np.diagonal(before)
        is_steady = np.abs(np.sqrt(ratio) - 1.0).max() < DONE
        drives = replace(drives, covariance=after)
        step = float(fit.phi[0, -1]) if drives.is_delay_unknown else 0.0
        if abs(step) > DONE_S:
            late = drives.delay_s + float(np.clip(step, -MOST_STEP_S, MOST_STEP_S))
            drives = replace(drives, delay_s=float(np.clip(late, EARLIEST_S, LATEST_S)))
            few = None
        elif is_steady:
            break
    return drives


def problem_of(
    lib: Library,
    train: Samples,
    tested: Samples,
    columns: tuple[str, ...],
    floor: NoiseFloor | None,
    known: FrictionPrior | None,
) -> Problem:
    """The problem of rows over their noise, where it is known."""
    weights = thesis_weights(train.tau) if floor is None else floor.sigma**-2
    return Problem(
        lib=lib,
        train=train,
        validation=tested,
        weights=weights,
        start=lib.lam0,
        column_names=columns,
        noise_floor=floor,
        friction_prior=known,
    )


def unit_noise(samples: Samples) -> NoiseFloor:
    """Noise of rows that were divided by it."""
    return NoiseFloor(np.ones(samples.equations), 1.0)


def _first_noise(lib: Library, motion: FreeBaseMotion) -> Array:
    """Covariance before any fit, (6 + n, 6 + n)."""
    needed = lib.inverse_dynamics(motion.q, motion.dq, motion.ddq, lib.pi0)
    weight = float(rms(np.linalg.norm(needed[:, :3], axis=1)))
    sigma = np.empty(lib.n_rows)
    sigma[:3], sigma[3:FREEDOM] = FIRST * weight, FIRST * 0.1 * weight
    size = rms(_torque(motion))
    sigma[FREEDOM:] = FIRST * np.maximum(size, 1e-3 * max(float(size.max()), 1e-300))
    return np.diag(sigma**2)


def _torque(motion: FreeBaseMotion) -> Array:
    if motion.tau is None:
        raise IdentificationError("expected commanded torques, got none; give tau_command or q_des")
    return motion.tau


def _noise(rows: FreeBaseRows, error: Array, covariance: Array, choice: str) -> Array:
    """Covariance of the rows after a pass, (6 + n, 6 + n)."""
    seen = np.einsum("nkm,nm->nk", rows.basis, error)
    shown = np.einsum("nkm,nlm->kl", rows.basis, rows.basis)
    part = (seen.T @ seen - shown) / len(seen) + np.eye(seen.shape[1])
    used = CHOSEN[choice]
    covariance = covariance.copy()
    covariance[used, used] = rows.root @ part @ rows.root.T
    return covariance


def _require_sign(lib: Library, rows: FreeBaseRows, name: str) -> None:
    """Refuse commands of the opposite sign."""
    predicted, given = rows.samples.rigid(lib, lib.pi0), rows.samples.tau
    if np.linalg.norm(predicted - given) > _OPPOSITE * np.linalg.norm(predicted + given):
        raise IdentificationError(
            f"{name}: the commanded torques are opposite to those that move the URDF, expected "
            "those that the drives apply to the joints; change their sign"
        )
