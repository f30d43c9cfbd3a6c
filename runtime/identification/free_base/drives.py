"""Noise of the rows of a robot with a free base, and the delay and friction of its torques.

Gauss–Newton on the delay d and expectation–maximisation on the covariance Σ = L Lᵀ of the rows in
turn. With N of `rows`, e = Nᵀ L⁻¹ r are the equations of residuals r, and L⁻¹ r given them is

    E[L⁻¹ r | e] = N e,   Σ ← L mean(N e eᵀ Nᵀ + 1 − N Nᵀ) Lᵀ

since what the unknown wrenches hide of L⁻¹ r keeps its variance of one. Σ is no diagonal: an error
of the attitude or of an encoder enters many rows. The step of d is the coefficient of its column at
the most probable model. Source: Dempster, Laird & Rubin 1977.

Where the low-pass leaves fewer independent equations than base parameters, residuals of a fit
cannot show the noise. What the URDF leaves does, once its mean (an offset, or the total mass) and
the errors of the sensors, within their prior, are taken out: Student's t with ν = 4 degrees of
freedom, fitted by weights w_i = (ν + m) / (ν + Σ_k (r_ik/σ_k)²) of the instants. A robot that
stands shows the errors of its sensors to a fraction of a newton, one that steps has errors of
acceleration of several; with equal weights the few steps would hide what the standing shows. That
holds for a share of such instants below 1 / (ν + m), a fifth for one equation. Source: Lange,
Little & Taylor 1989, ν = 4.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.choice import friction_choice
from runtime.estimators.methods import fit_by
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import FrictionPrior, NoiseFloor, Problem
from runtime.estimators.regression.samples import SILENT, Samples, residuals, thesis_weights
from runtime.identification.free_base import rows as equations
from runtime.identification.result_record import VerticalForcePart
from runtime.library import Array, Library
from runtime.recording.friction.columns import LOAD
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion
from runtime.recording.settings import Friction

FREEDOMS = 4.0  # ν of Student's t
MOST_FITS, STEADY = 200, 1e-6
"""Limit of the number of fits, and largest relative change of σ at the end."""


def measured_vertical(lib: Library, motion: FreeBaseMotion) -> Array | None:
    """ΣF_z, the vertical component of the forces on the base, (N,) [N]; None where unknown."""
    contacts = motion.contacts
    if not contacts.links:
        return None
    wrench = contacts.wrench
    if contacts.axes == "world":
        if np.isnan(wrench[:, :, 2]).any():
            return None
        return np.asarray(wrench[:, :, 2].sum(axis=1))
    if np.isnan(wrench[:, :, :3]).any():
        return None
    force = np.where(np.isnan(wrench), 0.0, wrench).reshape(len(motion), -1)
    on_base = np.einsum("nck,nc->nk", equations.contact_jacobian(lib, motion), force)
    return np.einsum("ni,ni->n", motion.rotation[:, 2], on_base[:, :3])


def needed_vertical(lib: Library, motion: FreeBaseMotion, pi: Array) -> Array:
    """ΣF_z that a motion needs, (N,) [N]."""
    force = lib.inverse_dynamics(motion.q, motion.dq, motion.ddq, pi)[:, :3]
    return np.einsum("ni,ni->n", motion.rotation[:, 2], force)


def vertical_force(
    lib: Library, motion: FreeBaseMotion, pi: Array, phi: Array
) -> VerticalForcePart | None:
    """Errors of ΣF_z, those of the result with the errors of the sensors."""
    measured = measured_vertical(lib, motion)
    if measured is None or not measured.any():
        return None
    by_sensors = (equations.reading_errors(lib, motion) @ phi).sum(axis=1)
    mean = float(measured.mean())
    before = needed_vertical(lib, motion, lib.pi0) - measured
    after = needed_vertical(lib, motion, pi) + by_sensors - measured
    percent = (100 * float(rms(each)) / abs(mean) for each in (before, after))
    return VerticalForcePart(mean, *percent)


def rms(values: Array) -> Array:
    """Root of the mean square over the first axis."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))


def noise_of(
    lib: Library,
    trained: equations.FreeBaseRows,
    sensors: FrictionPrior | None,
    cutoff_hz: float | None,
    seconds: float,
    are_few: bool,
) -> tuple[NoiseFloor | None, Array]:
    """Noise by the residual of the URDF, where fewer rows are independent than there are unknowns.

    It is that of the equations, with weights (N,) of the instants, else none and weights of one.
    A low-pass of f leaves 2 f T independent values of T seconds (Nyquist). Rows of which the
    training rows are such `are_few`, too.
    """
    samples = trained.samples
    count = float(len(samples))
    if cutoff_hz is not None:
        count = min(count, max(1.0, 2 * cutoff_hz * seconds))
    if not are_few and count * samples.equations >= len(lib.base_columns):
        return None, np.ones(len(samples))
    rest = samples.rigid(lib, lib.pi0) - samples.tau
    least = SILENT * rms(samples.tau).max()
    known = np.zeros(0) if sensors is None else sensors.sigma[0]
    sigma, weights = _student(rest, samples.columns, known, count)
    return NoiseFloor(np.maximum(sigma, least), len(samples) / count), weights


def _student(rest: Array, columns: Array, known: Array, independent: float) -> tuple[Array, Array]:
    """Scale of a residual behind its mean and columns, and weights of the instants."""
    count, equations = rest.shape
    means = np.broadcast_to(np.eye(equations), (count, equations, equations))
    # Columns in units of the prior of their coefficients, whose rows count like independent ones.
    rows = np.concatenate([means, columns * known], axis=2)
    prior = np.sqrt(count / independent) * np.eye(rows.shape[2])[equations:]
    weights, sigma = np.ones(count), np.maximum(rms(rest - rest.mean(axis=0)), 1e-300)
    for _ in range(MOST_FITS):
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


COLUMNS = ("viscous", "coulomb", "rotor")
"""Friction columns by default: a computed torque has no offset of a sensor."""
PASSES, ENOUGH = 12, 500  # limit of the number of passes, and instants that they take
ENOUGH_TO_CHOOSE = 2000  # instants that the choice of a friction model takes
CANDIDATES = tuple(
    name for name, columns in friction_choice.FRICTION_MODELS.items() if LOAD.name not in columns
)
"""Friction models to choose from: the load of a joint is not known beside unknown wrenches."""
DONE_S, DONE = 1e-4, 0.03  # step of the delay [s] and relative change of σ at the end
MOST_STEP_S, EARLIEST_S, LATEST_S = 0.02, -0.03, 0.1
"""Largest step of a pass, and range of the delay [s]."""
FIRST = 0.05
"""σ at the start: share of the torque of a joint, of the weight, and of the weight times 0.1 m."""


TrainAt = Callable[[float, Friction], FreeBaseMotion]
"""Motion of the instants that train, at a delay of the torques [s] with friction columns."""


def drives_of(
    lib: Library,
    choice: str,
    terms: Friction,
    delay_s: float | None,
    train_at: TrainAt,
    prior: PriorFile | None,
) -> equations.Drives:
    """Delay, unless it is stated, and noise of the rows that train."""
    drives = equations.Drives(terms, None, 0.0 if delay_s is None else delay_s, delay_s is None)
    few: FreeBaseMotion | None = None
    for _ in range(PASSES):
        if few is None:
            motion = train_at(drives.delay_s, terms)
            few = _thinned(motion, ENOUGH)
        before = drives.covariance
        if before is None:
            for name, some in motion.each():
                if not np.any(np.asarray(motion.tau)[some]):
                    raise IdentificationError(
                        f"{name}: every torque of the joints is zero, expected those that move the "
                        "robot; give them, or leave out friction and delay"
                    )
            needed = lib.inverse_dynamics(few.q, few.dq, few.ddq, lib.pi0)
            weight = float(rms(np.linalg.norm(needed[:, :3], axis=1)))
            size = rms(np.asarray(few.tau))
            size = np.maximum(size, 1e-3 * max(float(size.max()), 1e-300))
            before = np.diag(
                np.square(FIRST * np.array([*[weight] * 3, *[0.1 * weight] * 3, *size]))
            )
            drives = replace(drives, covariance=before)
            samples = equations.rows_of(lib, few, choice, drives).samples
            for name, some in few.each():
                if equations.is_opposite(samples.rigid(lib, lib.pi0)[some], samples.tau[some]):
                    raise IdentificationError(
                        f"{name}: the torques are opposite to those that move the URDF, expected "
                        "those that the drives apply to the joints; change their sign"
                    )
        rows = equations.rows_of(lib, few, choice, drives)
        samples, names = rows.samples, drives.names(lib.joint_names)
        unit = NoiseFloor(np.ones(samples.equations), 1.0)
        fit = fit_by(problem_of(lib, samples, samples, names, unit, None), "map", None, prior)
        error, used = residuals(lib, samples, fit.pi, fit.phi), equations.CHOSEN[choice]
        part = covariance_after(np.eye(len(rows.root)), rows.basis, error)
        after = before.copy()
        after[used, used] = rows.root @ part @ rows.root.T
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


def _thinned(motion: FreeBaseMotion, most: int) -> FreeBaseMotion:
    return motion.rows(slice(None, None, max(1, len(motion) // most)))


def friction_by_choice(
    lib: Library, choice: str, first: equations.Drives, train_at: TrainAt
) -> friction_choice.FrictionChoice:
    """Friction model by cross-validation of the rows that train, over the noise of first drives.

    The columns of `first` beyond `COLUMNS` are those of every candidate.
    """

    def blocks(terms: Friction) -> list[Samples]:
        motion = _thinned(train_at(first.delay_s, terms), ENOUGH_TO_CHOOSE)
        drives = replace(first, terms=terms, is_delay_unknown=False)
        return friction_choice.in_blocks(equations.rows_of(lib, motion, choice, drives).samples)

    extra = tuple(name for name in first.terms.columns if name not in COLUMNS[:2])
    return friction_choice.choose_among(lib, blocks, names=CANDIDATES, extra=extra)


def problem_of(
    lib: Library,
    train: Samples,
    tested: Samples,
    columns: tuple[str, ...],
    floor: NoiseFloor | None,
    known: FrictionPrior | None,
) -> Problem:
    """The problem of rows over their noise, where it is known."""
    return Problem(
        lib=lib,
        train=train,
        validation=tested,
        weights=thesis_weights(train.tau) if floor is None else floor.sigma**-2,
        start=lib.lam0,
        column_names=columns,
        noise_floor=floor,
        friction_prior=known,
    )


def covariance_after(
    covariance: Array, basis: Array, error: Array, floor: float | Array = 0.0
) -> Array:
    """Covariance of rows r (k, k) after a pass, by equations e = Nᵀ r (N, m), N (N, k, m).

    E[r | e] = G e with G = Σ N (Nᵀ Σ N + S)⁻¹, S of noise of the equations alone.
    """
    moved = covariance @ basis
    # Instants of fewer equations have columns of zeros, whose gain is zero.
    floor = floor + np.eye(basis.shape[2]) * np.logical_not(basis.any(axis=1))[:, None, :]
    gain = np.linalg.solve(basis.swapaxes(1, 2) @ moved + floor, moved.swapaxes(1, 2))
    seen = np.einsum("nmk,nm->nk", gain, error)
    known = np.einsum("nkm,nml->kl", moved, gain)
    return np.asarray(covariance + (seen.T @ seen - known) / len(seen))
