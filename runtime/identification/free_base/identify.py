"""Identification of a robot with a free base: consistent bodies, and their intervals.

The rows of `rows` are given to the method, by default map (entropic prior at the URDF, the base
link included), so that what the log does not determine keeps the values of the URDF, and says so.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD
from runtime.estimators.friction_bounds import OF
from runtime.estimators.methods import METHODS, Method, chosen_method, fit_by
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import Fit, FrictionPrior, Problem
from runtime.estimators.robust import robust_problem
from runtime.estimators.uncertainty import visible_noise
from runtime.identification import metrics
from runtime.identification.drive.symmetry import sides_of, tied_prior, with_mirrored_links
from runtime.identification.free_base.drives import (
    RowNoise,
    noise_of,
    problem_of,
    rms,
    unit_noise,
    vertical_force,
)
from runtime.identification.free_base.plausibility import notes_on_errors
from runtime.identification.free_base.prepared_walk import (
    PreparedWalk,
    notes_on,
    prepared_walk,
    require_settings,
)
from runtime.identification.free_base.result import (
    Evidence,
    FreeBaseIdentification,
    total_mass,
    uncertainty_of,
)
from runtime.identification.free_base.rows import Drives, sensor_errors
from runtime.identification.problem_setup import known_friction
from runtime.identification.result_file import provenance_of, record_about, stated_steps
from runtime.identification.result_record import (
    Coefficient,
    Delay,
    FrictionPart,
    MirroredPair,
    RecordingPart,
    error_parts,
    plain,
)
from runtime.identification.settings import Settings, cutoff_of
from runtime.library import Array, Library
from runtime.library.manifest import file_units
from runtime.recording import Friction, Preparation
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.recipes.recipe import COMMANDED, MEASURED
from runtime.recording.row_marks import row_marks
from runtime.recording.settings import WIDTHS


@one_blas_thread
def identify_free_base(
    recording: FreeBaseRecording, lib: Library, settings: Settings, *, trim_s: float = 0.0
) -> FreeBaseIdentification:
    """Identify π of a robot with a free base; a delay of commands is estimated unless stated."""
    if not lib.manifest.floating:
        raise IdentificationError(
            f"the base of '{lib.name}' is fixed, so a log with the motion of a base does not fit; "
            "build the robot with --floating, or give a log of joints alone"
        )
    pairs = tuple(settings.symmetric)
    prior = with_mirrored_links(settings.prior, lib, pairs, settings.tie)
    method = METHODS[chosen_method(settings.method, settings.preset, prior)]
    settings = replace(settings, prior=prior)
    require_settings(settings, method, recording)
    data = prepared_walk(recording, lib, settings, trim_s)
    task = _task(lib, data, settings, method.name)
    problem, drives, places = task.problem, data.drives, task.of_drives
    notes = [*task.notes, *notes_on(lib, recording, data, task.noise)]

    def fitted(problem: Problem) -> Fit:
        return fit_by(problem, method.name, settings.preset, prior)

    fit = fitted(problem)
    if settings.tie and drives is not None and drives.terms.columns:
        phi = fit.phi[0, places].reshape(lib.n_joints, -1)
        tied, note = tied_prior(lib.joint_names, pairs, drives.terms.columns, phi, task.known)
        problem = _with_known(problem, tied, places)
        fit, notes = fitted(problem), [note, *notes]
    seconds = float(data.train.t[-1] - data.train.t[0])
    evidence = _evidence(problem, fit, method, prior, task.offsets, seconds)
    root = evidence.phi_root
    mirrored: tuple[MirroredPair, ...] = ()
    if pairs:
        mirrored, of_sides = _sides(lib, data, fit, root, pairs, places)
        notes = [*of_sides, *notes]
    names, shown = data.tested.shown(drives is not None)
    tested = data.tested.samples
    by_result = tested.rigid(lib, fit.pi) + tested.columns @ fit.phi[0]
    measured, before, after = map(shown, (tested.tau, tested.rigid(lib, lib.pi0), by_result))
    errors = [metrics.torque_error(measured, each) for each in (before, after)]
    percent, sizes = error_parts(*errors)
    deviations = np.linalg.norm(root, axis=1)
    sensors = dict(zip(task.sensors, fit.phi[0, : places.start].tolist(), strict=True))
    of_rows = dict(zip(lib.row_names, [*["N"] * 3, *["N*m"] * 3, *file_units(lib.manifest)],
                       strict=True))  # fmt: skip
    cutoff_hz = cutoff_of(settings.cutoff)
    preparation = Preparation()
    if cutoff_hz is not None:
        preparation = Preparation(filter="butterworth", cutoff_hz=cutoff_hz)
    terms = Friction(()) if drives is None else drives.terms
    phi, spread = (x.reshape(lib.n_joints, -1) for x in (fit.phi[0, places], deviations[places]))
    is_late = recording.is_commanded or settings.delay is not None
    record = record_about(
        *(lib, fit.pi, fit.lam),
        method=method.name,
        base="free",
        status=fit.status,
        recording=RecordingPart.with_gaps(
            name=recording.name,
            duration=float(data.motion.t[-1] - data.motion.t[0]),
            samples={"train": len(data.train), "validation": 0, "test": len(data.test)},
            preparation=stated_steps(preparation),
        ),
        torque_source=COMMANDED if recording.is_commanded else MEASURED,
        delay_s=_delay(drives, fit, deviations) if is_late else None,
        torque_error_percent=percent,
        torque_rms=sizes,
        consistent=bool(lib.relative_eigenvalues(fit.pi).min() > 0),
        uncertainty=uncertainty_of(evidence),
        friction=None
        if not terms.columns
        else FrictionPart(
            columns=terms.columns,
            values=plain(phi),
            **{key: getattr(terms, key) for key in WIDTHS},
            sigma=plain(spread),
        ),
        symmetric=mirrored or None,
        warnings=(
            *fit.notes,
            *notes,
            *notes_on_errors(
                *(rms(measured), errors[1].rms, sensors, list(task.sensors.values())),
                bool(recording.joint_names),
            ),
        ),
        provenance=provenance_of(lib, "", dict(recording.source), None),
        rows=data.rows,
        error_rows=names,
        error_units=tuple(of_rows.get(name, "") for name in names),
        total_mass=total_mass(evidence),
        vertical_force=vertical_force(lib, data.test, fit.pi, fit.phi[:, : places.start]),
        sensors={
            name: Coefficient(value=value, sigma=plain(sigma))
            for (name, value), sigma in zip(
                sensors.items(), deviations[: places.start], strict=True
            )
        }
        or None,
    )
    return FreeBaseIdentification(
        *(record, fit.pi, terms, phi, preparation),
        row_marks=row_marks(recording.joints),
        lib=lib,
        evidence=evidence,
        predictions={"t": data.test.t, "measured": measured, "before": before, "after": after},
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """The problem of a log, and what belongs to it."""

    problem: Problem
    sensors: dict[str, float]  # σ of the errors of sensors, whose coefficients are first
    of_drives: slice  # places of the friction coefficients, joint by joint, behind them
    offsets: Array  # (N, m, o), see `FreeBaseRows`, weighted like the rows
    noise: RowNoise | None
    known: FrictionPrior | None  # of friction, (n, k)
    notes: tuple[str, ...]


def _task(lib: Library, data: PreparedWalk, settings: Settings, method: str) -> _Task:
    """The problem of the rows that train, whose errors of sensors have a prior."""
    drives, trained = data.drives, data.trained
    fitted, sensors = trained.samples, dict(sensor_errors(data.motion.contacts))
    size, notes, noise = len(sensors), tuple[str, ...](), None
    sensed = None
    if sensors:
        sigma = list(sensors.values())
        sensed = FrictionPrior.of_some(fitted.shape, np.s_[0, :size], 0.0, sigma)
    columns = tuple(f"error{OF}{name}" for name in sensors)
    weights, count, known = np.ones(len(fitted)), 0, None
    if drives is None:
        seconds = float(data.train.t[-1] - data.train.t[0])
        noise = noise_of(lib, trained, sensed, cutoff_of(settings.cutoff), seconds)
        floor = None if noise is None else noise.floor
        if noise is not None:
            weights = noise.weights
            fitted = fitted.weighted(weights)
    else:
        terms = drives.terms
        count = lib.n_joints * len(terms.columns)
        if count:
            known = known_friction(lib, settings, terms.columns, terms)
        columns, floor = (*columns, *drives.names(lib.joint_names)), unit_noise(fitted)
    places = slice(size, size + count)
    problem = problem_of(lib, fitted, data.tested.samples, columns, floor, sensed)
    if known is not None:
        problem = _with_known(problem, known, places)
    if settings.robust:
        problem, robust = robust_problem(problem, method)
        weights = weights * robust.weights
        notes = (robust.note(data.train.t, trained.equations),)
    offsets = trained.offsets * np.sqrt(weights)[:, None, None]
    return _Task(problem, sensors, places, offsets, noise, known, notes)


def _with_known(problem: Problem, known: FrictionPrior, of_drives: slice) -> Problem:
    """The problem with a prior of friction (n, k) beside that of the sensors."""
    shape, sensed = problem.train.shape, problem.friction_prior
    mean, sigma = known.mean.ravel(), known.sigma.ravel()
    prior = FrictionPrior.of_some(shape, np.s_[0, of_drives], mean, sigma)
    return replace(problem, friction_prior=prior if sensed is None else prior.over(sensed))


def _delay(drives: Drives | None, fit: Fit, deviations: Array) -> Delay | None:
    """Delay of the torques, whose coefficient is the last; a stated one is exact."""
    if drives is None:
        return None
    if not drives.is_delay_unknown:
        return Delay(value=drives.delay_s, sigma=0.0)
    late = drives.delay_s + float(fit.phi[0, -1])
    return Delay(value=late, sigma=plain(float(deviations[-1])))


def _sides(
    lib: Library,
    data: PreparedWalk,
    fit: Fit,
    root: Array,
    pairs: tuple[str, ...],
    of_drives: slice,
) -> tuple[tuple[MirroredPair, ...], tuple[str, ...]]:
    """Comparison of the drives of mirrored joints, and notes on it."""
    columns = () if data.drives is None else data.drives.terms.columns
    samples, rest = data.tested.samples, data.tested.samples.columns @ fit.phi[0]
    rest = samples.tau - samples.rigid(lib, fit.pi) - rest
    first = data.tested.over_rows(rest).shape[1] - lib.n_joints

    def error(change: Array, pair: tuple[int, int]) -> float:
        changed = rest - samples.columns[:, :, of_drives] @ change.ravel()
        return float(np.linalg.norm(data.tested.over_rows(changed)[:, [first + j for j in pair]]))

    phi = fit.phi[0, of_drives].reshape(lib.n_joints, -1)
    return sides_of(
        lib.joint_names, pairs, columns, phi, root[of_drives] if columns else None, error
    )


def _evidence(
    problem: Problem,
    fit: Fit,
    method: Method,
    prior: PriorFile | None,
    offsets: Array,
    seconds: float,
) -> Evidence:
    """Data and priors about a fit; offsets (N, m, o) of sensors move π and φ."""
    lib, samples = problem.lib, problem.train
    if method.is_most_probable:
        (weights, noise), statistics = fit.noise(), fit.statistics or problem.statistics()
    else:
        weights, statistics, noise = visible_noise(
            lib, samples, fit.pi, fit.phi, problem.statistics
        )
    level, known = max(noise.density, float(np.finfo(float).tiny)), problem.friction_prior
    columns = np.concatenate([samples.base_rows(lib), samples.friction_rows()], axis=2)
    return Evidence(
        lib,
        fit.pi,
        statistics,
        None if known is None else known.statistics(statistics, level),
        level,
        prior.kappa if prior and prior.kappa else CAD,
        None if prior is None else prior.centre,
        np.einsum("nmp,m,nmo->po", columns, weights, offsets, optimize=True),
        method.is_most_probable,
        noise.inflation,
        seconds,
    )
