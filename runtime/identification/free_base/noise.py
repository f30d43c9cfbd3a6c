"""Noise of the equations and sum of the vertical forces of a free base.

Where the low-pass leaves fewer independent equations than base parameters, residuals of a fit
cannot show the noise. What the URDF leaves does, once its mean (an offset, or the total mass) and
the errors of the sensors, within their prior, are taken out: Student's t with ν = 4 degrees of
freedom, fitted by weights w_i = (ν + m) / (ν + Σ_k (r_ik/σ_k)²) of the instants. A robot that
stands shows the errors of its sensors to a fraction of a newton, one that steps has errors of
acceleration of several; with equal weights the few steps would hide what the standing shows. That
holds for a share of such instants below 1 / (ν + m), a fifth for one equation. Source: Lange,
Little & Taylor 1989, ν = 4.
"""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.problem import FrictionPrior, NoiseFloor
from runtime.estimators.regression.samples import SILENT
from runtime.identification.free_base.rows import FreeBaseRows, contact_jacobian, reading_errors
from runtime.library import Array, Library
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion

FREEDOMS = 4.0
"""ν of Student's t."""
PASSES, STEADY = 200, 1e-6
"""Limit of the number of fits, and largest relative change of σ at the end."""


@dataclass(frozen=True, slots=True, eq=False)
class VerticalForce:
    """Sum of the vertical contact forces on the test part."""

    weight: float  # mean of the measured sum [N]
    before: float  # RMS error of the URDF's prediction [N]
    # RMS error of the identified model's prediction, errors of the sensors included [N]
    after: float
    spread: float  # standard deviation of the measured sum, the error of the best constant [N]
    measured: Array  # measured, predicted: the sums, measured and by the URDF, (N,) [N]
    predicted: Array


def vertical_force(
    lib: Library, motion: FreeBaseMotion, pi: Array, phi: Array
) -> VerticalForce | None:
    """Errors of ΣF_z, the vertical component of the forces on the base."""
    contacts = motion.contacts
    if not contacts.links:
        return None
    wrench = contacts.wrench
    if contacts.axes == "world":
        if np.isnan(wrench[:, :, 2]).any():
            return None
        measured = wrench[:, :, 2].sum(axis=1)
    else:
        if np.isnan(wrench[:, :, :3]).any():
            return None
        count = len(motion)
        force = np.where(np.isnan(wrench), 0.0, wrench)
        on_base = np.einsum("nck,nc->nk", contact_jacobian(lib, motion), force.reshape(count, -1))
        measured = np.einsum("ni,ni->n", motion.rotation[:, 2], on_base[:, :3])
    if not measured.any():
        return None

    def predicted(parameters: Array) -> Array:
        force = lib.inverse_dynamics(motion.q, motion.dq, motion.ddq, parameters)[:, :3]
        return np.einsum("ni,ni->n", motion.rotation[:, 2], force)

    by_urdf = predicted(lib.pi0)
    return VerticalForce(
        float(measured.mean()),
        float(rms(by_urdf - measured)),
        float(rms(predicted(pi) + (reading_errors(lib, motion) @ phi[0]).sum(axis=1) - measured)),
        float(measured.std()),
        measured,
        by_urdf,
    )


def rms(values: Array) -> Array:
    """Root of the mean square over the first axis."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))


@dataclass(frozen=True, slots=True, eq=False)
class RowNoise:
    """Noise of the equations of N instants."""

    floor: NoiseFloor  # standard deviation per equation, and N / N_eff
    weights: Array  # (N,) of the instants, of the variance σ²


def noise_of(
    lib: Library,
    trained: FreeBaseRows,
    sensors: FrictionPrior | None,
    cutoff_hz: float | None,
    seconds: float,
) -> RowNoise | None:
    """Noise by the residual of the URDF, where fewer rows are independent than there are unknowns.

    A low-pass of f leaves 2 f T independent values of T seconds (Nyquist).
    """
    samples = trained.samples
    count = float(len(samples))
    if cutoff_hz is not None:
        count = min(count, max(1.0, 2 * cutoff_hz * seconds))
    if count * samples.equations >= len(lib.base_columns):
        return None
    rest = samples.rigid(lib, lib.pi0) - samples.tau
    least = SILENT * rms(samples.tau).max()
    known = np.zeros(0) if sensors is None else sensors.sigma[0]
    sigma, weights = _student(rest, samples.columns, known, count)
    return RowNoise(NoiseFloor(np.maximum(sigma, least), len(samples) / count), weights)


def _student(rest: Array, columns: Array, known: Array, independent: float) -> tuple[Array, Array]:
    """Scale of a residual behind its mean and columns, and weights of the instants."""
    count, equations = rest.shape
    means = np.broadcast_to(np.eye(equations), (count, equations, equations))
    # Columns in units of the prior of their coefficients, whose rows count like independent ones.
    rows = np.concatenate([means, columns * known], axis=2)
    prior = np.sqrt(count / independent) * np.eye(rows.shape[2])[equations:]
    weights, sigma = np.ones(count), np.maximum(rms(rest - rest.mean(axis=0)), 1e-300)
    for _ in range(PASSES):
        scale = np.sqrt(weights)[:, None] / sigma
        design = (rows * scale[:, :, None]).reshape(count * equations, -1)
        target = np.concatenate([(rest * scale).ravel(), np.zeros(len(prior))])
        solution = np.linalg.lstsq(np.concatenate([design, prior]), target, rcond=None)[0]
        left = rest - rows @ solution
        before = sigma
        sigma = np.maximum(np.sqrt(np.mean(weights[:, None] * left**2, axis=0)), 1e-300)
        weights = (FREEDOMS + equations) / (FREEDOMS + np.sum((left / sigma) ** 2, axis=1))
        weights = weights / weights.mean()
        if np.abs(sigma / before - 1.0).max() < STEADY:
            break
    # Every independent value that the means and columns explain is missing in the residual. They
    # explain tr (DᵀD + PᵀP)⁻¹ DᵀD, D and P the rows of data and prior.
    data, information = design.T @ design, prior.T @ prior
    explained = float(np.trace(np.linalg.lstsq(data + information, data, rcond=None)[0]))
    left_over = independent * equations - explained
    return sigma * np.sqrt(independent * equations / max(left_over, 1.0)), weights
