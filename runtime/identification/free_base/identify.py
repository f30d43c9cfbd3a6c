"""Identification of a robot with a free base: consistent bodies, and their intervals.

The rows of `rows` are given to the method, by default map (entropic prior at the URDF, the base
link included), so that what the log does not determine keeps the values of the URDF, and says so.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.estimators.methods import fit_by
from runtime.estimators.optimizers import Status
from runtime.estimators.problem import ERROR_OF, Fit, FrictionPrior, NoiseFloor, Problem
from runtime.estimators.robust import robust_problem
from runtime.estimators.uncertainty import visible_noise
from runtime.identification import metrics
from runtime.identification import result_record as schema
from runtime.identification.drive.symmetry import sides_of, tied_prior
from runtime.identification.free_base import drives
from runtime.identification.free_base import result as results
from runtime.identification.free_base.prepared_walk import PreparedWalk, notes_on, prepared_walk
from runtime.identification.free_base.rows import FreeBaseRows
from runtime.identification.problem_setup import PARTS, Assembly, ShownRows
from runtime.identification.result_file import record_about, stated_steps
from runtime.identification.settings import Settings
from runtime.identification.several_logs import agreement_of
from runtime.identification.single_log import refit_note
from runtime.library import Array, Integers, Library
from runtime.library.free_base import FREEDOM
from runtime.recording import Preparation, Recording
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.recipes.recipe import COMMANDED, MEASURED
from runtime.recording.row_marks import row_marks

_UNEXPLAINED = 0.5  # error over RMS of half of the rows from which a note states it
_FAR = 3.0
"""Distance of a sensor's error from 0 in its standard deviations from which a note states it."""


@one_blas_thread
def identify_free_base(
    logs: Sequence[FreeBaseRecording], lib: Library, settings: Settings, *, trim_s: float = 0.0
) -> results.FreeBaseIdentification:
    """Identify π of a robot with a free base; a delay of commands is estimated unless stated.

    Offsets of contact sensors are those of one log each, all other coefficients are common.
    """
    data = prepared_walk(logs, lib, settings, trim_s, True)
    settings = data.settings
    trained, rows_of_training = _fitted(data, data.parts[0])
    final = trained
    said = list[str]()
    if settings.refit and trained.fit.status != Status.INTERRUPTED.value:
        whole, _ = _fitted(data, data.instants, trained.noise is not None)
        is_complete = whole.fit.status != Status.INTERRUPTED.value
        final = whole if is_complete else trained
        said = [refit_note(len(data.instants), len(data.parts[0]), "errors", is_complete)]
    fit, root, places = final.fit, final.phi_root, data.of_drives
    sessions, of_logs = _agreement(data) if len(logs) > 1 else (None, ())
    rows, terms = data.tested.over_rows(), data.friction
    phi = fit.phi[0][places].reshape(lib.n_joints, -1)
    mirrored, of_sides = (
        ((), ())
        if not settings.symmetric
        else sides_of(
            *(lib.joint_names, tuple(settings.symmetric), terms.columns, phi),
            root[places] if terms.columns else None,
            rows.tau - final.predicted(rows),
            lambda change: rows.columns[:, :, places] @ change.ravel(),
        )
    )
    notes = (*of_logs, *of_sides, *final.notes, *notes_on(data, rows_of_training, trained.noise))
    (names, tested), test = data.tested.shown(), data.motion.rows(data.parts[-1])
    measured, before = tested.tau, tested.rigid(lib, lib.pi0)
    after = trained.predicted(tested)
    errors = [metrics.torque_error(measured, each) for each in (before, after)]
    of_errors = _notes_on_errors(
        *(drives.rms(measured), errors[1].rms, fit.phi[0], data.sensors), bool(logs[0].joint_names)
    )
    deviations = np.linalg.norm(root, axis=1)
    of_sensors = zip(data.sensors, fit.phi[0], deviations, strict=False)
    preparation = Preparation()
    if data.cutoff_hz is not None:
        preparation = Preparation(filter="butterworth", cutoff_hz=data.cutoff_hz)
    is_commanded = logs[0].is_commanded
    is_late = is_commanded or settings.delay is not None
    record = record_about(
        *(lib, fit.pi, fit.lam, errors),
        trained=None
        if final is trained
        else (trained.fit.pi, trained.fit.phi[0][places].reshape(phi.shape)),
        command="",
        files=_files(logs),
        seed=None,
        method=settings.estimator.name,
        status=fit.status,
        recording=schema.RecordingPart.with_gaps(
            name=" + ".join(data.motion.logs),
            duration=data.motion.seconds,
            samples={"train": len(data.parts[0]), "validation": 0, "test": len(test)},
            preparation=stated_steps(preparation),
        ),
        torque_source=COMMANDED if is_commanded else MEASURED,
        delay_s=_delay(data, fit, deviations) if is_late else None,
        consistent=metrics.is_consistent(lib, fit.pi),
        uncertainty=results.uncertainty_of(final),
        friction=schema.friction_part(terms, phi, deviations[places].reshape(phi.shape)),
        symmetric=mirrored or None,
        warnings=(*fit.notes, *notes, *said, *of_errors),
        rows=data.rows,
        error_rows=names,
        error_units=data.units_of(names),
        total_mass=results.total_mass(final),
        vertical_force=drives.vertical_force(
            lib, test, trained.fit.pi, trained.fit.phi[0][: places.start]
        ),
        sensors={
            name: schema.Coefficient(value=float(value), sigma=schema.plain(float(sigma)))
            for name, value, sigma in of_sensors
        }
        or None,
        sessions=sessions,
    )
    marks = row_marks(*(log.joints for log in logs))
    arrays = {"t": test.t, "measured": measured, "before": before, "after": after}
    return results.FreeBaseIdentification(
        *(record, fit.pi, terms, phi, preparation),
        row_marks=marks,
        lib=lib,
        evidence=final,
        predictions=arrays | {"row_marks": marks},
    )


def _notes_on_errors(
    rms: Array, after: Array, phi: Array, sensors: Mapping[str, float], are_named: bool
) -> tuple[str, ...]:
    """Notes on rows that the result does not explain, and on sensors far from what was stated."""
    notes = []
    loaded = rms > 0
    if not loaded.any():
        notes.append(
            "torques and wrenches of the test part are zero throughout, as in free flight; if "
            "sensors were off, choose another --split"
        )
    share = float(np.median(after[loaded] / rms[loaded])) if loaded.any() else 0.0
    if share > _UNEXPLAINED:
        unnamed = "" if are_named else " (the log has no array joints, which names them)"
        notes.append(
            f"half of the rows keep an error of {100 * share:.0f} % of their RMS or more: torques "
            "and wrenches do not fit this robot and motion; check names and order of joints"
            f"{unnamed} and contacts, contact_position, contact_kind, contact_axes and units"
        )
    for (name, spread), value in zip(sensors.items(), phi, strict=False):
        if abs(value) > _FAR * spread:
            notes.append(
                f"sensors: the error of {name} is {abs(value) / spread:.1f} times its stated "
                "standard deviation; check the contact forces, or state a larger one"
            )
    return tuple(notes)


def _files(logs: Sequence[FreeBaseRecording]) -> dict[str, str]:
    """Digest of every file."""
    return {file: digest for log in logs for file, digest in log.source.items()}


def assembly_of_walks(
    logs: Sequence[FreeBaseRecording], lib: Library, settings: Settings
) -> tuple[Assembly, list[str]]:
    """The problem of walks that some methods share; sentences on what was chosen."""
    data = prepared_walk(logs, lib, settings, 0.0, False)
    motions = [data.motion.rows(part) for part in data.parts]
    rows = [data.rows_of(motion) for motion in motions]
    problem, _ = _problem(data, rows[0], motions[0].seconds, rows[1], are_few=False)
    names, _ = data.tested.shown()
    samples = {part: each.shown()[1] for part, each in zip(PARTS, rows, strict=True)}
    shown = ShownRows(samples, (names, data.units_of(names)))
    name = " + ".join(data.motion.logs)
    train, held_out, test = (
        Recording(motion.t, motion.q[:, FREEDOM:], name=name, source=_files(logs))
        for motion in motions
    )
    names = data.motion.logs if len(logs) > 1 else ()
    parts = (train, held_out, test)
    return Assembly(problem, parts, data.friction, logs=names, shown=shown), [*data.notes]


def _fitted(
    data: PreparedWalk, instants: Integers, are_few: bool = False
) -> tuple[results.Evidence, FreeBaseRows]:
    """Fit of some instants, and their rows; tied drives have a prior by a fit without it."""
    motion, notes = data.motion.rows(instants), list[str]()
    rows, settings = data.rows_of(motion), data.settings
    method = settings.estimator
    problem, weights = _problem(data, rows, motion.seconds, data.tested, are_few)
    if settings.robust:
        problem, robust = robust_problem(problem, method.name)
        weights = weights * robust.weights
        notes.append(robust.note(motion.t, rows.equations))
    fit = fit_by(problem, method.name, settings.preset, settings.prior)
    if settings.tie and data.friction.columns:
        names, of_friction = data.lib.joint_names, data.friction.columns
        phi, pairs = fit.phi[0, data.of_drives].reshape(len(names), -1), tuple(settings.symmetric)
        tied, note = tied_prior(names, pairs, of_friction, phi, data.known_friction)
        problem = _with_known(problem, tied, data.of_drives)
        fit = fit_by(problem, method.name, settings.preset, settings.prior)
        notes.insert(0, note)
    offsets, samples = rows.offsets * np.sqrt(weights)[:, None, None], problem.train
    if method.is_most_probable:
        (weights, coloured), statistics = fit.noise(), fit.statistics or problem.statistics()
    else:
        weights, statistics, coloured = visible_noise(
            data.lib, samples, fit.pi, fit.phi, problem.statistics
        )
    level, known = max(coloured.density, float(np.finfo(float).tiny)), problem.friction_prior
    columns = samples.rows_of_unknowns(data.lib)
    evidence = results.Evidence(
        data.lib,
        fit,
        statistics,
        None if known is None else known.statistics(statistics, level),
        level,
        settings,
        # Offsets of sensors move π and φ.
        np.einsum("nmp,m,nmo->po", columns, weights, offsets, optimize=True),
        coloured.inflation,
        motion.seconds,
        data.of_drives,
        problem.noise_floor if data.drives is None else None,
        tuple(notes),
    )
    return evidence, rows


def _problem(
    data: PreparedWalk, rows: FreeBaseRows, seconds: float, held_out: FreeBaseRows, are_few: bool
) -> tuple[Problem, Array]:
    """The problem of equations, and weights of its instants."""
    samples, weights = rows.samples, np.ones(len(rows.samples))
    sensors, sensed = data.sensors, None
    if sensors:
        sigma = list(sensors.values())
        sensed = FrictionPrior.of_some(samples.shape, np.s_[0, : len(sigma)], 0.0, sigma)
    columns = tuple(f"{ERROR_OF}{name}" for name in sensors)
    if data.drives is None:
        floor, weights = drives.noise_of(data.lib, rows, sensed, data.cutoff_hz, seconds, are_few)
        samples = samples if floor is None else samples.weighted(weights)
    else:
        columns = (*columns, *data.drives.names(data.lib.joint_names))
        floor = NoiseFloor(np.ones(samples.equations), 1.0)
    problem = drives.problem_of(data.lib, samples, held_out.samples, columns, floor, sensed)
    if data.known_friction is not None:
        problem = _with_known(problem, data.known_friction, data.of_drives)
    return problem, weights


def _agreement(data: PreparedWalk) -> tuple[schema.SessionsPart, tuple[str, ...]]:
    """Comparison of several logs by all of their instants."""
    instants = [np.intersect1d(data.instants, of_log) for _, of_log in data.motion.each()]
    rows = [data.rows_of(data.motion.rows(some)).over_rows() for some in instants]

    def predicted(walk: results.Evidence | None, k: int) -> Array:
        return rows[k].rigid(data.lib, data.lib.pi0) if walk is None else walk.predicted(rows[k])

    return agreement_of(
        data.lib,
        [(log.name, log.joints) for log in data.logs],
        lambda numbers: _fitted(data, np.concatenate([instants[k] for k in numbers]))[0],
        lambda walk: (walk.fit.pi, walk.posterior.pi_root),
        predicted,
        [each.tau for each in rows],
        payload_kg=(0.0,) * len(rows),
        train_samples=tuple(map(len, instants)),
        offsets=None,
    )


def _with_known(problem: Problem, known: FrictionPrior, of_drives: slice) -> Problem:
    """The problem with a prior of friction (n, k) beside that of the sensors."""
    shape, sensed = problem.train.shape, problem.friction_prior
    stated = known.mean.ravel(), known.sigma.ravel()
    prior = FrictionPrior.of_some(shape, np.s_[0, of_drives], *stated)
    return replace(problem, friction_prior=prior if sensed is None else prior.over(sensed))


def _delay(data: PreparedWalk, fit: Fit, deviations: Array) -> schema.Delay | None:
    """Delay of the torques, whose coefficient is the last; a stated one is exact."""
    if data.drives is None:
        return None
    if not data.drives.is_delay_unknown:
        return schema.Delay(value=data.drives.delay_s, sigma=0.0)
    late = data.drives.delay_s + float(fit.phi[0, -1])
    return schema.Delay(value=late, sigma=schema.plain(float(deviations[-1])))
