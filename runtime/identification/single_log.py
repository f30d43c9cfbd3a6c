"""Identification of a robot from a log in memory, a log in its file, or several logs.

The document's method is Adam in λ (Sec. 4), with the presets "simulation" (Table 5.1) and "real"
(Table 5.8). "full" is the same descent on all samples at once, from compressed statistics; it costs
less and stops closer to the optimum.

The method, the friction model and the weights are chosen, and the errors computed, with the fit to
the training part. What is chosen is then fitted to the rows of all parts (`_refitted`). Its
covariance is smaller by the number of rows, and what `predict` expects of a log is what `identify`
reaches.

Columns that are the torque of the log itself are fitted by Gauss–Newton about the model.

    (1 + g) τ = Y π + F φ,   1 + g per joint unknown

With τ as a column, g = −1 explains every log. The fit is thus that of τ = (Y π + F φ)/(1 + g) + e,
whose linearisation at the present estimate, times 1 + ĝ, has the torque h of the model as column,

    h + (1 + ĝ)(τ − h) = Y π + F φ − g h + (1 + ĝ) e,   h = (Y π̂ + F φ̂)/(1 + ĝ)

and ends where h is that of its own fit. There a common factor of all 1 + g, π and φ changes
nothing, as in the equations: the prior alone determines it.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError, RuntimeFault
from runtime.estimators.classical.pc_ols import convex_optimum
from runtime.estimators.methods import fit_by
from runtime.estimators.optimizers import Status
from runtime.estimators.problem import Fit, Problem, best_friction, bounds_of
from runtime.estimators.regression.recorded_delay import delay_of_log, stated_delay
from runtime.estimators.regression.samples import Samples, residuals, samples_of
from runtime.estimators.robust import robust_problem
from runtime.estimators.uncertainty import Uncertainty, filter_inflation, uncertainty_of
from runtime.identification.identified import Identification, torque_of
from runtime.identification.long_logs import assemble_streamed
from runtime.identification.problem_setup import NO_MASSES, Assembly, assemble, settings_for
from runtime.identification.settings import Progress, Settings, bare_settings, progress_of
from runtime.identification.several_logs import NamedLog, assemble_logs
from runtime.library import Array, Library, Mask
from runtime.recording import Friction, Recording
from runtime.recording.settings import COLUMNS
from runtime.recording.streamed import StreamedRecording

PASSES = 30
CLOSE = 1e-5  # change of g at which the passes end, far below what a log determines
LEAST = 0.05  # smallest 1 + g by which h is divided
FitBy = Callable[[Problem], Fit]


def is_torque(names: Iterable[str]) -> Mask:
    """Whether each of some columns is the torque itself, (k,)."""
    return np.array([name in COLUMNS and COLUMNS[name].is_torque for name in names], dtype=bool)


def without_torque_columns(terms: Friction) -> Friction:
    """The terms without columns of the torque, for choices by the error of a fit."""
    kept = tuple(name for name in terms.columns if not is_torque([name]).any())
    return replace(terms, columns=kept)


def with_modelled_torque(assembly: Assembly, fit: FitBy) -> Assembly:
    """The assembly with −h of its own fit in the columns of the torque; unchanged without such."""
    problem, names = assembly.problem, assembly.problem.friction_names
    flags = is_torque(names)
    if not flags.any():
        return assembly
    if problem.pieces is not None or problem.train.equations < problem.lib.n_joints:
        listed = ", ".join(np.array(names)[flags])
        raise IdentificationError(
            f"the friction column {listed} is fitted in passes over rows of every joint in memory, "
            "got a streamed log or rows of power; use --settings stream=false and --settings "
            "regressor=acceleration or momentum"
        )
    lib, gain = problem.lib, np.ones(problem.lib.n_joints)

    def torque(samples: Samples) -> Array:
        """h (N, n) of the last model."""
        known = samples.rigid(lib, model.pi) + samples.friction(phi)
        return np.asarray((known + lib.known_torque(samples.q)) / gain)

    modelled = _replaced(assembly, flags, lambda samples: np.zeros_like(samples.tau), gain)
    for _ in range(PASSES):
        model = fit(modelled.problem)
        before, gain = gain, np.maximum(1 + model.phi[:, flags].sum(axis=1), LEAST)
        phi = np.where(flags, 0.0, model.phi)
        modelled = _replaced(assembly, flags, torque, gain)
        if np.abs(gain - before).max() < CLOSE and (gain != 1).any():
            break
    return modelled


def _replaced(
    assembly: Assembly, flags: Mask, torque: Callable[[Samples], Array], gain: Array
) -> Assembly:
    """The assembly with −h in the columns of the torque, and the rows of its problem scaled."""
    problem = assembly.problem

    def of(samples: Samples) -> Samples:
        h = torque(samples)
        rest = samples.tau + problem.lib.known_torque(samples.q) - h
        columns = np.where(flags, -h[..., None], samples.columns)
        return replace(samples, tau=samples.tau + (gain - 1) * rest, columns=columns)

    train, validation, test = (
        part.replace(columns=of(samples_of(part, problem.lib)).columns) for part in assembly.parts
    )
    problem = replace(problem, train=of(problem.train), validation=of(problem.validation))
    return replace(assembly, problem=problem, parts=(train, validation, test))


FittedSource = Recording | StreamedRecording | Sequence[NamedLog]


def assembly_of(
    log: FittedSource, lib: Library, settings: Settings, progress: Progress, is_joined: bool
) -> Assembly:
    """The problem of any log, or of several."""
    kind: Callable[..., Assembly] = assemble_logs
    if isinstance(log, (Recording, StreamedRecording)):
        kind = assemble if isinstance(log, Recording) else assemble_streamed
    return kind(log, lib, settings, progress=progress, is_joined=is_joined)


@one_blas_thread
def identify_recording(
    log: FittedSource,
    lib: Library,
    settings: Settings | str | None = None,
    *,
    progress: Callable[[int, float], None] | Progress | None = None,
    **keywords: Any,
) -> Identification:
    """Identify π, and φ of stated friction columns, from any log; nothing else is chosen.

    Keywords alone fit the training part only (`refit` False), as a Monte Carlo study needs it.
    """
    chosen = settings_for(lib, bare_settings(settings, keywords))
    joins = not chosen.estimator.uses_validation
    assembly = assembly_of(log, lib, chosen, progress_of(progress), joins)
    result = identify_assembled(assembly, chosen)
    if assembly.finish is None:
        return result

    def fitted(each: Assembly, certify: bool) -> Identification:
        return identify_assembled(each, replace(chosen, certify=certify, refit=False))

    return assembly.finish(result, fitted)


@one_blas_thread
def identify_assembled(
    assembly: Assembly,
    settings: Settings | str | None = None,
    fit_of: FitBy | None = None,
    **keywords: Any,
) -> Identification:
    """Identify from a problem that is assembled already, by a method or by another fit."""
    chosen = settings_for(assembly.problem.lib, bare_settings(settings, keywords))
    method, start = chosen.estimator, time.perf_counter()
    takes_all = chosen.refit and not method.needs_samples(chosen.preset)

    def by_method(problem: Problem) -> Fit:
        return fit_by(problem, method.name, chosen.preset, chosen.prior, assembly.origin)

    fitted = fit_of or by_method
    given, assembly = assembly, with_modelled_torque(assembly, fitted)
    assembly = _weighted(assembly, chosen)
    problem, parts = assembly.problem, assembly.parts
    lib = problem.lib
    fit = fitted(problem)
    seconds = time.perf_counter() - start
    statistics, optimum = fit.statistics or problem.statistics(), fit.optimum
    if optimum is None:
        guess = lib.pi_from_lam(problem.start)
        bounds = bounds_of(problem, True) if method.bounds_friction else None
        optimum = convex_optimum(lib, statistics, guess, bounds).loss if chosen.certify else np.nan
    weights = problem.weights if fit.weights is None else fit.weights
    loss = statistics.value(fit.pi, fit.phi)  # in the weights of the optimum
    if fit.learned is not None:
        rest = problem.train.tau - torque_of(lib, problem.train, fit.pi, fit.phi, fit.learned)
        loss = float(np.mean(rest**2 @ problem.weights) / 2)
    result = Identification(
        method=method.name,
        lib=lib,
        pi=fit.pi,
        lam=fit.lam,
        beta=lib.base_matrix @ fit.pi,
        phi=fit.phi,
        friction=assembly.friction,
        weights=weights,
        status=fit.status,
        loss=loss,
        optimum=optimum,
        zero_loss=float(np.mean(problem.train.tau**2 @ weights) / 2),
        uncertainty=_uncertainty(assembly, fit, chosen) if chosen.certify else None,
        seconds=seconds,
        iterations=fit.iterations,
        trace=fit.trace,
        train=parts[0],
        validation=parts[1],
        test=parts[2],
        one_run=assembly.one_run,
        is_joined=assembly.is_joined,
        seed=problem.seed,
        notes=(*assembly.notes, *fit.notes, *[NO_MASSES] * bool(lib.placeholders)),
        learned=fit.learned,
        urdf_phi=best_friction(statistics, lib.pi0, fit.phi.shape) if fit.phi.size else None,
    )
    is_cut = assembly.is_cut and not np.array_equal(parts[0].t, parts[2].t)  # else all rows train
    is_refitted = takes_all and is_cut and problem.train.equations == lib.n_joints
    if not is_refitted or fit.status == Status.INTERRUPTED.value:
        return result
    whole = _weighted(with_modelled_torque(with_all_rows(given), fitted), chosen)
    return _refitted(result, whole, fitted, chosen, rows_of(problem, fit))


def _weighted(assembly: Assembly, settings: Settings) -> Assembly:
    """The assembly with weights of its training rows, where the settings request them."""
    if not settings.robust:
        return assembly
    lib, t = assembly.problem.lib, assembly.parts[0].t
    problem, weights = robust_problem(assembly.problem, settings.estimator.name)
    notes = assembly.notes
    if len(t) == len(weights.weights):
        notes += (weights.note(t, lib.joint_names),)
    return replace(assembly, problem=problem, notes=notes)


def _refitted(
    result: Identification, whole: Assembly, fitted: FitBy, settings: Settings, trained: int
) -> Identification:
    """The result of `trained` rows with the parameters of a fit to all rows."""
    fit = fitted(whole.problem)
    is_complete = fit.status != Status.INTERRUPTED.value
    note = refit_note(rows_of(whole.problem, fit), trained, "errors, loss and gap", is_complete)
    if not is_complete:
        return replace(result, notes=(*result.notes, note))
    posterior = None
    if result.uncertainty:
        # Errors of the friction model grow with the rows as a contradiction does: the margin of the
        # tests holds for training rows.
        posterior = _uncertainty(whole, fit, settings, tests=False)
        posterior = replace(posterior, tests=result.uncertainty.tests)
    return replace(
        result,
        pi=fit.pi,
        lam=fit.lam,
        beta=result.lib.base_matrix @ fit.pi,
        phi=fit.phi,
        uncertainty=posterior,
        notes=(*result.notes, note),
        trained=Fit(result.pi, result.phi, result.lam, result.status),
    )


def refit_note(rows: int, trained: int, figures: str, is_complete: bool) -> str:
    """Sentence on a fit to all rows, and on figures of the fit to the training rows."""
    if not is_complete:
        return "the fit to all rows was interrupted: parameters are those of the training rows"
    return (
        f"parameters and intervals are fitted to all {rows} rows; {figures} are those of the fit "
        f"to the {trained} training rows alone"
    )


def _uncertainty(
    assembly: Assembly, fit: Fit, settings: Settings, tests: bool = True
) -> Uncertainty:
    """Posterior of the fit."""
    problem, lib = assembly.problem, assembly.problem.lib
    posterior = uncertainty_of(
        lib,
        problem.train,
        fit.pi,
        fit.phi,
        first_guess=lib.pi_from_lam(problem.start),
        kappa=settings.kappa,
        statistics=fit.statistics,
        coloured_noise=fit.coloured_noise,
        compressed=problem.statistics,
        is_most_probable=settings.estimator.is_most_probable,
        centre=settings.centre,
        tests=tests,
        gain_sigma=settings.gain_sigma,
        delay=partial(_delay_beside, assembly, settings),
    )
    if problem.train.equations < lib.n_joints:  # rows of power have no noise of single joints
        samples = samples_of(assembly.parts[0], lib)
        posterior = posterior.with_noise(residuals(lib, samples, fit.pi, fit.phi), lib)
    rows = assembly.parts[0]
    steps = rows.prepared or settings.preparation or rows.preparation
    return replace(posterior, filtered=filter_inflation(steps, rows.rate_hz))


def with_all_rows(assembly: Assembly) -> Assembly:
    """The same problem with the rows of all parts for training."""
    problem = assembly.problem
    test = samples_of(assembly.parts[2], problem.lib)
    rest = (test,) if assembly.is_joined else (problem.validation, test)
    whole = replace(problem, train=Samples.joined((problem.train, *rest)), terms=assembly.friction)
    pieces = problem.pieces
    if pieces is not None:  # a streamed log: `rows` are those of its windows
        names = ("train", "test") if assembly.is_joined else ("train", "validation", "test")
        whole = replace(whole, pieces=lambda _: chain.from_iterable(map(pieces, names)))
    return replace(assembly, problem=whole)


def rows_of(problem: Problem, fit: Fit) -> int:
    """Number of samples of a fit, those of a streamed log outside of its windows included."""
    if problem.pieces is None:
        return len(problem.train)
    return round((fit.statistics or problem.statistics()).n_samples)


def _delay_beside(assembly: Assembly, settings: Settings) -> tuple[float, float] | None:
    """Delay beside that of the preparation, and its σ [s], as --delay auto estimates it."""
    origin, lib = assembly.origin, assembly.problem.lib
    if origin is None or not assembly.is_cut:
        return None
    log = origin.recording
    steps = settings.preparation or log.preparation
    try:
        profile = delay_of_log(log, lib, steps, origin.friction, settings.split)
    except RuntimeFault:  # too few rows, or rows that were prepared before
        return None
    return None if profile.is_flat else (profile.best - stated_delay(steps), profile.sigma)
