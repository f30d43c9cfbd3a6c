"""Identification with the delay of the torque and the encoder biases as further unknowns.

Gauss–Newton on the exact model: at every pass the recording is prepared and identified anew with
the present delay d (`Preparation.torque_delay_s`) and q + b, and `linearised` gives the next step.
The first d is the minimum of the profile of the loss (`recorded_delay`). Of a measured torque it is
the last one: dry friction lags behind the sign of dq, and the profile leaves its reversals out,
while the passes would take the lag for a delay.

Delay and encoder biases of a streamed log are those of its first rows, of several logs those of
each alone. The encoders are the same in all logs, so that the biases of K logs, each with the prior
N(0, σ₀²), have the precision Σ 1/σ_k² − (K − 1)/σ₀².
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.common.texts import number_of
from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.choice.dry_friction import with_dry_friction
from runtime.estimators.gauss_newton import Linearised, gauss_newton
from runtime.estimators.problem import FrictionPrior
from runtime.estimators.regression.factor import reduce
from runtime.estimators.regression.recorded_delay import (
    CLOSE_S,
    LATEST_S,
    SEEN_SHARE,
    TURNED,
    delay_of_log,
    reversal_excess,
    sign_of_delay,
    sliding,
    with_delay,
)
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.robust import explicit
from runtime.identification.drive import feedback
from runtime.identification.drive.result import BIAS_PRIOR, STROKE_PRIOR, DriveFit, DriveRequest
from runtime.identification.identified import Identification
from runtime.identification.prepared_log import PreparedLog
from runtime.identification.problem_setup import assemble, known_friction
from runtime.identification.settings import AUTO, PER_JOINT, SILENT, Progress, Settings, terms_of
from runtime.identification.single_log import identify_assembled, identify_recording
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction.columns import DAHL_LOAD
from runtime.recording.friction.coupled_motors import geared
from runtime.recording.preprocessing.parts import before_test, without_ends
from runtime.recording.recipes.recipe import COMMANDED
from runtime.recording.settings import COLUMNS, has_memory, width_of

PASSES = 6  # largest number of Gauss–Newton passes
DONE = 0.1  # step over standard deviation below which the passes end
MOST_STEP = (0.02, 0.05, 0.5)  # largest step of one pass: of d [s], of b [rad, m], of ln z
THINNED = 10.0  # rate of the rows over the cut-off at which the first passes are made
SLIDES = (
    "the delay is that of the rows in which the joints slide: near their reversals friction turns "
    "round in another way than its columns, which looks like a delay"
)
OF_LOAD = "dry friction grows with the load of the joints, as the residual shows (column dahl_load)"
NO_BIAS = (
    "encoder biases were not estimated, which need accelerations; use --settings "
    "regressor=acceleration"
)
LEAST_OF_LOAD = 0.02  # share of the variance of noise that friction of the load has to lower
MOST_SIGMA = 0.02  # standard deviation of a delay above which it is not determined [s]


@dataclass(frozen=True, slots=True)
class DriveProblem:
    """A log whose delay of the torque and encoder biases are unknown."""

    recording: Recording  # log as read
    lib: Library  # library of the robot
    settings: Settings  # of the identification
    request: DriveRequest  # what is estimated beside the parameters
    preparation: Preparation  # of the rows; its delay is replaced
    given: Array  # delay where it is not estimated, (1,) or (n,) [s]
    progress: Progress = SILENT  # shown the iterations
    # of the first of x, by other rows: of the delay by the profile of a measured torque [s]
    sigma: Array | None = None
    slides: bool = False  # whether rows near the reversals of a joint are left out

    def rough(self, preparation: Preparation | None = None) -> "DriveProblem":
        """The same without certificates and progress."""
        settings = replace(self.settings, certify=False)
        usual = preparation or self.preparation
        return replace(self, settings=settings, preparation=usual, progress=SILENT)

    def split(self, x: Array) -> tuple[Array, Array, Array]:
        """Delay (1,) or (n,) [s], biases [rad, m] and ln z/z₀, (n,) where it is unknown."""
        none = np.zeros(self.lib.n_joints)
        delay, bias, strokes = np.split(x, np.cumsum(self.counts[:2]))
        return delay if delay.size else self.given, bias if bias.size else none, strokes

    def used(self, train: Recording) -> Array:
        """1 in rows of the training part that are used, (N, n)."""
        dq = train.required("dq")
        return sliding(dq, train.rate_hz, CLOSE_S) if self.slides else np.ones_like(dq)

    @property
    def counts(self) -> list[int]:
        """Numbers of delays, biases and strokes of x."""
        n, request = self.lib.n_joints, self.request
        delays = n if request.per_joint else 1
        return [delays * request.delay, n * request.bias, n * request.strokes]


def newton_passes(problem: DriveProblem, x: Array) -> tuple[Array, Array]:
    """Most probable x, and its standard deviations at the last pass.

    The passes take fewer rows of the low-passed signals until they end, then all rows.
    """
    sigma, left = np.full(x.shape, np.inf), PASSES
    thinned = _thinned(problem.recording, problem.preparation)
    for present, done in ((problem.rough(thinned), 1.0), (problem.rough(), DONE)):
        if not (x.size and left) or (done > DONE and thinned is problem.preparation):
            continue

        def linearise(x: Array, present: DriveProblem = present) -> Linearised:
            step = linearised_at(problem, identification_at(present, x), x, rough=True)
            return Linearised(step.step, step.sigma)

        solution = gauss_newton(
            linearise,
            x,
            passes=left,
            done=done,
            most_step=np.repeat(MOST_STEP, problem.counts),
            takes_last=present.preparation is not problem.preparation,
        )
        x, sigma, left = solution.x, solution.last.sigma, left - solution.passes
    return x, sigma


def _thinned(recording: Recording, preparation: Preparation) -> Preparation:
    """The preparation at a tenth of its cut-off's period, where the log is twice as fast."""
    cutoff = preparation.cutoff_hz or np.inf
    if preparation.rate_hz is not None or recording.rate_hz < 1.9 * THINNED * cutoff:
        return preparation
    return replace(preparation, rate_hz=THINNED * cutoff)


def identification_at(
    problem: DriveProblem, x: Array, removed: tuple[Array, Array] | None = None
) -> Identification:
    """Identification with known delay and biases: removed (M,) [s]."""
    recording, progress = problem.recording, problem.progress
    delay, bias, strokes = problem.split(x)
    moved = recording.replace(q=recording.q + bias) if bias.any() else recording
    preparation = with_delay(recording, problem.preparation, delay)
    usual = replace(problem.settings, preparation=preparation)
    if strokes.size:
        terms = terms_of(recording, usual)
        stroke = width_of(np.exp(strokes) * terms.dahl_stroke)
        usual = replace(usual, friction=replace(terms, dahl_stroke=stroke))
    if removed is None and not problem.slides:
        return identify_recording(moved, problem.lib, usual, progress=progress)
    assembly = assemble(moved, problem.lib, usual, progress=progress, is_joined=True)
    train, fitted = assembly.parts[0], assembly.problem.train
    if removed is not None:
        t, torque = removed
        c = np.stack([np.interp(train.t, t, row) for row in torque.T], axis=1)
        fitted = replace(fitted, tau=fitted.tau - c)
        train = train.replace(tau=train.required("tau") - c).noted(feedback.FEEDBACK)
    if problem.slides:
        fitted = explicit(problem.lib, fitted).weighted(problem.used(train))
    less = replace(assembly.problem, train=fitted)
    return identify_assembled(
        replace(assembly, problem=less, parts=(train, *assembly.parts[1:])), usual
    )


def linearised_at(
    problem: DriveProblem, result: Identification, x: Array, rough: bool = False
) -> feedback.LinearisedDrive:
    """The step to the minimum of the linearised problem."""
    settings = problem.settings
    known = known_friction(result.lib, settings, result.friction.columns, result.friction)
    return feedback.linearised(
        result,
        problem.request,
        x=x,
        spread=np.repeat((np.inf, BIAS_PRIOR, STROKE_PRIOR), problem.counts),
        kappa=settings.kappa,
        phi_prior=None if known is None else known.sigma,
        rough=rough,
        known_sigma=problem.sigma,
        used=problem.used(result.train),
    )


@one_blas_thread
def identify_drive(
    recording: Recording,
    lib: Library,
    settings: Settings,
    request: DriveRequest,
    *,
    progress: Progress = SILENT,
) -> Identification:
    """Identify a robot together with the delay of its torque and its encoder biases."""
    if (method := settings.estimator.name) != "map":
        raise IdentificationError(
            f"a delay or an encoder bias is estimated with the method map, got {method}; leave out "
            "--method, or give the delay in the recipe (torque_delay_s under [preparation])"
        )
    if settings.test is not None or recording.columns is not None:
        raise IdentificationError(
            "a delay or an encoder bias is estimated from one log as read, got prepared or "
            "separate recordings; give the log itself"
        )
    recording = independent_joints(recording, lib)
    # Delay, biases and intervals belong to the rows of the training: no second fit to all rows.
    settings = replace(settings, refit=False)
    preparation = without_ends(recording, settings.preparation or recording.preparation)
    settings = replace(settings, preparation=preparation)
    notes: tuple[str, ...] = ()
    if request.bias and preparation.regressor != "acceleration":
        request, notes = replace(request, bias=False), (NO_BIAS,)
    given = np.asarray(preparation.torque_delay_s or 0.0, dtype=float)
    delay = np.atleast_1d(given) * sign_of_delay(recording)
    problem = DriveProblem(recording, lib, settings, request, preparation, delay, progress)
    x, unknown = np.zeros(0), ""
    if request.delay:
        terms = geared(terms_of(recording, settings), recording, lib)
        problem, x, unknown = _with_delay(problem, terms)
    if unknown:
        notes += (
            f"the log does not determine a delay: {unknown}; record a faster motion, or give "
            "torque_delay_s under [preparation]",
        )
    notes += (OF_LOAD,) * (problem.settings is not settings) + (SLIDES,) * problem.slides
    if unknown or not request.delay:
        problem = replace(problem, request=replace(request, delay=False))
        x, _ = newton_passes(problem, np.zeros(sum(problem.counts)))
    result = _certified(problem, x)
    return replace(result, notes=(*notes, *result.notes))


def _with_delay(problem: DriveProblem, terms: Friction) -> tuple[DriveProblem, Array, str]:
    """The most probable delay and biases, and the reason where the log has no delay."""
    request = problem.request
    by_profile = problem.recording.torque_source != COMMANDED and not request.per_joint
    first = delay_of_log(
        *(problem.recording, problem.lib, problem.preparation, terms, problem.settings.split),
        has_rotors=by_profile,
    )
    x = np.zeros(sum(problem.counts))
    if first.is_flat:
        low, high = (1e3 * end for end in first.interval_s)
        return problem, x, f"the loss is flat from {low:.0f} to {high:.0f} ms, or least at an end"
    count = len(problem.split(x)[0])
    x[:count] = first.delay_s
    if by_profile:
        biased = replace(problem, request=replace(request, delay=False), given=x[:count])
        x[count:], _ = newton_passes(biased, x[count:])
        return replace(problem, sigma=np.array([first.sigma])), x, ""
    if isinstance(terms.dahl_stroke, tuple) and problem.preparation.regressor == "acceleration":
        problem = replace(problem, request=replace(request, strokes=True))
        x = np.append(x, np.zeros(problem.lib.n_joints))
        problem = _with_load(problem, x)
    x, sigma = newton_passes(problem, x)
    if not terms.gear and _turns_otherwise(identification_at(problem.rough(), x)):
        problem = replace(problem, slides=True)
        x, sigma = newton_passes(problem, x)
    if np.all(sigma[:count] < MOST_SIGMA) and np.all(np.abs(x[:count]) < LATEST_S):
        return problem, x, ""
    return problem, x, f"its standard deviation is {1e3 * np.max(sigma[:count]):.0f} ms"


def _with_load(problem: DriveProblem, x: Array) -> DriveProblem:
    """The problem with dry friction that grows with the load, where the residual shows it."""
    terms = terms_of(problem.recording, problem.settings)
    # A prior of coefficients, as of drives that are tied, belongs to the columns that are there.
    if DAHL_LOAD.name in terms.columns or isinstance(
        problem.settings.friction_prior, FrictionPrior
    ):
        return problem
    terms = replace(terms, columns=(*terms.columns, DAHL_LOAD.name))
    loaded = replace(problem, settings=replace(problem.settings, friction=terms))
    rows = _thinned(problem.recording, problem.preparation)
    fits = (identification_at(each.rough(rows), x) for each in (problem, loaded))
    plain, less = (np.log(each.weights).mean() for each in fits)
    return loaded if plain - less < np.log(1 - LEAST_OF_LOAD) else problem


def _turns_otherwise(result: Identification) -> bool:
    """Whether dry friction turns round in another way than its columns."""
    names, samples = result.friction.columns, samples_of(result.train, result.lib)
    if not any(name in COLUMNS and COLUMNS[name].model_term == "friction" for name in names):
        return False
    rest = samples.tau - result.predict_samples(samples)
    seen = sliding(samples.dq, result.train.rate_hz, least=SEEN_SHARE)
    return reversal_excess(rest, seen) > TURNED


def _certified(problem: DriveProblem, x: Array) -> Identification:
    """The identification next to x, without the bias by feedback, with its certificates.

    Where the loop is not quite that of the model, x alone is corrected, and the step is its error.
    """
    request, whole = problem.request, replace(problem, slides=False)
    result, removed, error = identification_at(problem, x), None, np.zeros(len(x))
    used, delay = problem.used(result.train), problem.split(x)[0]
    correction = feedback.feedback_torque(result, delay, request, used)
    if correction is not None:
        c, of_links = correction
        removed = (result.train.t, c)
        rough = identification_at(problem.rough(), x, removed)
        most = np.repeat(MOST_STEP, problem.counts)
        step = np.clip(linearised_at(problem, rough, x).step, -most, most)
        x = x + step
        if problem.slides or not of_links:
            removed, error = None, step
    if correction is not None or problem.slides:
        result = identification_at(whole, x, removed)
    if problem.slides or error.any():
        rough = identification_at(problem.rough(), x, removed)
        sigma = linearised_at(problem, rough, x).sigma
        whole = replace(whole, sigma=np.hypot(sigma, error))
    end = linearised_at(whole, result, x)
    (_, bias, _), (_, bias_sigma, _) = problem.split(x), problem.split(end.sigma)
    delays = problem.counts[0]
    empty = np.full(problem.lib.n_joints, np.nan)
    drive = DriveFit(
        delay=x[:delays],
        delay_sigma=end.sigma[:delays],
        bias=bias if request.bias else empty,
        bias_sigma=bias_sigma if request.bias else empty,
    )
    uncertainty = result.uncertainty
    if uncertainty is not None and uncertainty.information is not None and end.pi_moved.size:
        _, system = reduce(uncertainty.information.statistics, problem.lib.n_joints)
        phi = end.phi_moved - system.slope @ end.pi_moved
        uncertainty = uncertainty.beside(problem.lib, end.pi_moved, phi)
    return replace(result, drive=drive, uncertainty=uncertainty)


LATEST = 1.0  # largest delay that is stated [s]


def drive_request(data: PreparedLog, settings: Settings) -> DriveRequest | None:
    """What is estimated of the drives; None for nothing."""
    estimated = settings.delay in {AUTO, PER_JOINT}
    commanded = data.recording.torque_source == COMMANDED
    wanted = commanded and estimated if settings.encoder_bias is None else settings.encoder_bias
    if not (estimated or wanted or (commanded and settings.estimator.name == "map")):
        return None
    return DriveRequest(estimated, settings.delay == PER_JOINT, wanted)


def delayed(data: PreparedLog, settings: Settings) -> Preparation | None:
    """Preparation with a stated delay."""
    delay = settings.delay
    if data.is_at_rest and (delay is not None or settings.encoder_bias):
        raise IdentificationError(
            "--delay and --settings encoder_bias=true need motion, but the log contains poses at "
            "rest; leave them out, or give --cutoff to identify from the motion between the poses"
        )
    if delay is None or delay in {AUTO, PER_JOINT}:
        return data.preparation
    seconds = number_of(str(delay))
    if seconds is None or not abs(seconds) <= LATEST:
        raise IdentificationError(
            f"--delay needs a number of seconds within 1 s, {AUTO} or {PER_JOINT}, got '{delay}'"
        )
    return with_delay(data.recording, data.steps, np.array([seconds]))


def with_drives(data: Sequence[PreparedLog], lib: Library, settings: Settings) -> list[PreparedLog]:
    """The logs as one log of a commanded torque is prepared."""
    ready = [
        replace(log, preparation=without_ends(log.recording, log.steps))
        if log.is_commanded
        else log
        for log in data
    ]
    first = ready[0]
    recipe, terms = first.recording.recipe, first.friction
    stated = settings.friction is not None or settings.coulomb_speed is not None
    is_named = stated or (recipe is not None and recipe.friction is not None)
    if is_named or terms is None or first.preparation is None or not first.is_commanded:
        return ready
    seen = [(before_test(log.recording, log.split), log.steps) for log in ready if log.is_commanded]
    is_late = settings.delay in {AUTO, PER_JOINT}
    terms, sentence = with_dry_friction(seen, lib, terms, is_late)
    if is_late and has_memory(terms.columns):  # every joint has a stroke of its own
        terms = replace(terms, dahl_stroke=tuple(np.full(lib.n_joints, terms.dahl_stroke).tolist()))
    notes = (*first.notes, sentence) if sentence else first.notes
    return [replace(first, friction=terms, notes=notes), *ready[1:]]


def without_drives(
    names: list[str],
    data: list[PreparedLog],
    lib: Library,
    settings: Settings,
    progress: Progress,
    is_together: bool,
) -> tuple[list[PreparedLog], list[DriveFit], list[str]]:
    """The logs without delays of torques and biases of encoders; estimates of both; notes.

    Unless they are estimated together with the links, they are from every log alone, with the
    friction model of the first.
    """
    data = [replace(log, preparation=delayed(log, settings)) for log in data]
    delay, has_bias = settings.delay, bool(settings.encoder_bias)
    request = DriveRequest(delay in {AUTO, PER_JOINT}, delay == PER_JOINT, has_bias)
    if is_together or not (request.delay or request.bias):
        return data, [], []
    estimated, frictions, notes = list[DriveFit](), list[Friction](), list[str]()
    where = "" if len(data) > 1 else f", from the first {len(data[0].recording)} rows"
    for name, each in zip(names, data, strict=True):
        bare = each.settings(settings, each.preparation)
        alone = replace(bare, friction=data[0].friction, refit=False, certify=False)
        progress.step(f"estimating the delay of {name}")
        result = identify_drive(each.recording, lib, alone, request)
        estimated.append(result.drive or DriveFit.unknown(lib.n_joints))
        frictions.append(result.friction)
        if request.delay:
            notes.append(f"{name}: {estimated[-1].sentence}{where}")
    if request.bias and not np.isfinite([each.bias for each in estimated]).all():
        notes.append(NO_BIAS)
    bias, corrected = DriveFit.of_all(estimated).bias, list[PreparedLog]()
    has_bias = bool(np.isfinite(bias).all())
    for each, fit in zip(data, estimated, strict=True):
        steps, recording = each.preparation, each.recording
        if fit.delay.size:
            steps = with_delay(recording, each.steps, fit.delay)
        log = replace(each, preparation=steps)
        if has_bias and each.streamed is not None:
            log = replace(log, streamed=replace(each.streamed, bias=bias))
        elif has_bias:
            log = replace(log, recording=recording.replace(q=recording.q + bias))
        if log.friction is not None and isinstance(log.friction.dahl_stroke, tuple):
            log = replace(log, friction=frictions[0])
        corrected.append(log)
    return corrected, estimated, notes
