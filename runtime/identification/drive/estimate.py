"""Identification with the delay of the torque and the encoder biases as further unknowns.

Gauss–Newton on the exact model: at every pass the recording is prepared and identified anew with
the present delay d (`Preparation.torque_delay_s`) and q + b, and `linearised` gives the next step.
The first d is the minimum of the profile of the loss (`recorded_delay`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD
from runtime.estimators.methods import chosen_method
from runtime.estimators.regression.dry_friction_choice import with_dry_friction
from runtime.estimators.regression.recorded_delay import LATEST_S, recorded_delay, sign_of_delay
from runtime.estimators.regression.samples import samples_of
from runtime.identification.current_gains.scaling import with_current_gains
from runtime.identification.drive.feedback import FEEDBACK, feedback_torque
from runtime.identification.drive.linearised import LinearisedDrive, linearised, torque_rate
from runtime.identification.drive.result import DriveFit, DriveRequest
from runtime.identification.identified import Identification
from runtime.identification.known_priors import known_friction
from runtime.identification.problem_setup import assemble
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify, identify_assembled
from runtime.library import Array, Library
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.commanded_torque import without_ends
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction import default_terms, geared
from runtime.recording.preprocessing import before_test

SPLIT = Split((0.0, 0.58), (0.58, 0.6), (0.6, 1.0))
"""Split where none is stated: the method has no stopping rule, so that it trains on the first 60 %
but for the least validation part."""
PASSES = 6
"""Largest number of Gauss–Newton passes."""
DONE = 0.1
"""Step over standard deviation below which the passes end."""
MOST_STEP = (0.02, 0.05)
"""Largest step of one pass: of a delay [s], of a bias [rad, m]."""
THINNED = 10.0
"""Rate of the rows over the cut-off at which the first passes are made."""
BIAS_PRIOR = 0.02
"""Standard deviation of the prior of an encoder bias [rad, m]: the residual of a calibration by
hand, a degree."""

MOST_SIGMA = 0.02
"""Standard deviation of a delay above which it is not determined [s]."""


@dataclass(frozen=True, slots=True)
class _Point:
    """Delay and its standard deviation, (1,) or (n,) [s], and biases (n,) [rad, m]."""

    delay: Array
    delay_sigma: Array
    bias: Array


@one_blas_thread
def identify_drive(
    recording: Recording,
    lib: Library,
    settings: Settings,
    request: DriveRequest,
    *,
    progress: Callable[[int, float], None] | None = None,
) -> Identification:
    """Identify a robot together with the delay of its torque and its encoder biases.

    Args:
        recording: log as read.
        lib: library of the robot.
        settings: as for `identify`; the method must be map.
        request: what is estimated beside the parameters.
        progress: as for `identify`.

    Returns:
        The identification at the most probable delay and biases, with `drive`.

    Raises:
        RuntimeFault: the data or settings do not make an identification problem.
    """
    _require(settings, recording)
    recording = independent_joints(recording, lib)
    recording = with_current_gains(
        recording, lib, preparation=settings.preparation, splitting=settings.splitting or SPLIT
    )
    recipe = recording.recipe
    # Delay, biases and intervals belong to the rows of the training: no second fit to all rows.
    settings = replace(settings, refit=False)
    if settings.splitting is None and (recipe is None or recipe.split is None):
        settings = replace(settings, splitting=SPLIT)
    preparation = without_ends(recording, settings.preparation or recording.preparation)
    settings = replace(settings, preparation=preparation)
    terms = settings.friction_columns or default_terms(recording) or Friction(columns=())
    terms = geared(terms, recording, lib)
    if settings.friction_columns is None and not (recipe and recipe.friction):
        seen = before_test(recording, settings.splitting)
        terms, sentence = with_dry_friction(seen, lib, preparation, terms, request.delay)
        settings = replace(settings, friction_columns=terms)
        if sentence:
            result = identify_drive(recording, lib, settings, request, progress=progress)
            return replace(result, notes=(sentence, *result.notes))
    if request.bias and preparation.regressor != "acceleration":
        without = identify_drive(
            recording, lib, settings, replace(request, bias=False), progress=progress
        )
        note = (
            "encoder biases were not estimated, which need accelerations; use --regressor "
            "acceleration"
        )
        return replace(without, notes=(note, *without.notes))
    n = lib.n_joints
    given = np.asarray(preparation.torque_delay_s or 0.0, dtype=float)
    delay = np.atleast_1d(given) * sign_of_delay(recording)
    unknown: str | None = None
    if request.delay:
        seen = before_test(recording, settings.splitting)  # the delay is of the training, too
        first = recorded_delay(seen, lib, preparation, terms)
        if first.profile.is_flat:
            low, high = (1e3 * end for end in first.interval_s)
            unknown = f"the loss is flat from {low:.0f} to {high:.0f} ms, or least at an end"
        else:
            start = np.full(n if request.per_joint else 1, first.delay_s)
            done = _newton(recording, lib, settings, request, preparation, start)
            late, spread = done.delay, done.delay_sigma
            if np.all(spread < MOST_SIGMA) and np.all(np.abs(late) < LATEST_S):
                return _certified(recording, lib, settings, request, preparation, done, progress)
            unknown = f"its standard deviation is {1e3 * np.max(spread):.0f} ms"
    request = replace(request, delay=False)
    done = _newton(recording, lib, settings, request, preparation, delay)
    result = _certified(recording, lib, settings, request, preparation, done, progress)
    if unknown is None:
        return result
    sentence = (
        f"the log does not determine a delay: {unknown}; record a faster motion, or give "
        "torque_delay_s under [preparation]"
    )
    return replace(result, notes=(sentence, *result.notes))


def _newton(
    recording: Recording,
    lib: Library,
    settings: Settings,
    request: DriveRequest,
    preparation: Preparation,
    delay: Array,
) -> _Point:
    """Most probable delay and biases, from a first delay.

    The passes take fewer rows of the low-passed signals until they end, then all rows.
    """
    n = lib.n_joints
    bias = np.zeros(n)
    sigma = np.full(delay.shape, np.inf)
    rough, thinned = replace(settings, certify=False), _thinned(recording, preparation)
    for _ in range(PASSES if request.delay or request.bias else 0):
        result = _at(recording, lib, rough, thinned, _Point(delay, sigma, bias))
        step = _linearised(result, settings, request, bias, rough=True)
        sigma = step.delay_sigma
        size = np.concatenate([step.delay_step / sigma, step.bias_step / step.bias_sigma])
        if np.nanmax(np.abs(size)) < DONE and thinned is preparation:
            break
        if np.nanmax(np.abs(size)) < 1.0:
            thinned = preparation
        point = _stepped(_Point(delay, sigma, bias), step, request)
        delay, bias = point.delay, point.bias
    return _Point(delay, sigma, bias)


def _stepped(point: _Point, step: LinearisedDrive, request: DriveRequest) -> _Point:
    """The point after a step."""
    delay, bias = point.delay, point.bias
    if request.delay:
        delay = delay + np.clip(step.delay_step, -MOST_STEP[0], MOST_STEP[0])
    if request.bias:
        bias = bias + np.clip(step.bias_step, -MOST_STEP[1], MOST_STEP[1])
    return _Point(delay, step.delay_sigma, bias)


def _thinned(recording: Recording, preparation: Preparation) -> Preparation:
    """The preparation at a tenth of its cut-off's period, where the log is twice as fast."""
    cutoff = preparation.cutoff_hz
    if cutoff is None or preparation.rate_hz is not None:
        return preparation
    if recording.rate_hz < 1.9 * THINNED * cutoff:
        return preparation
    return replace(preparation, rate_hz=THINNED * cutoff)


def _certified(
    recording: Recording,
    lib: Library,
    settings: Settings,
    request: DriveRequest,
    preparation: Preparation,
    point: _Point,
    progress: Callable[[int, float], None] | None,
) -> Identification:
    """The identification next to a point, without the bias by feedback, with its certificates."""
    result = _at(recording, lib, settings, preparation, point, progress=progress)
    c = feedback_torque(result, point.delay, request)
    if c is not None:
        removed = (result.train.t, c)
        rough = _at(recording, lib, replace(settings, certify=False), preparation, point, removed)
        point = _stepped(point, _linearised(rough, settings, request, point.bias), request)
        result = _at(recording, lib, settings, preparation, point, removed, progress)
    step = _linearised(result, settings, request, point.bias)
    empty = np.full(lib.n_joints, np.nan)
    drive = DriveFit(
        delay=point.delay if request.delay else np.zeros(0),
        delay_sigma=step.delay_sigma,
        bias=point.bias if request.bias else empty,
        bias_sigma=step.bias_sigma if request.bias else empty,
        bias_prior=BIAS_PRIOR,
        phi_sigma=step.phi_sigma,
        phi_covariance=step.phi_covariance,
    )
    return replace(result, drive=drive)


def _require(settings: Settings, recording: Recording) -> None:
    method = chosen_method(settings.method, settings.preset, settings.prior)
    if method != "map":
        raise IdentificationError(
            f"a delay or an encoder bias is estimated with the method map, got {method}; leave out "
            "--method, or give the delay in the recipe (torque_delay_s under [preparation])"
        )
    if settings.test is not None or recording.columns is not None:
        raise IdentificationError(
            "a delay or an encoder bias is estimated from one log as read, got prepared or "
            "separate recordings; give the log itself"
        )


def _at(
    recording: Recording,
    lib: Library,
    settings: Settings,
    preparation: Preparation,
    point: _Point,
    removed: tuple[Array, Array] | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Identification:
    """Identification at a point, less a torque at the instants of the training rows."""
    moved = recording.replace(q=recording.q + point.bias) if point.bias.any() else recording
    usual = replace(settings, preparation=_delayed(recording, preparation, point.delay))
    if removed is None:
        return identify(moved, lib, usual, progress=progress)
    assembly = assemble(moved, lib, usual, progress=progress, is_joined=True)
    train, (t, torque) = assembly.parts[0], removed
    c = np.stack([np.interp(train.t, t, row) for row in torque.T], axis=1)
    fitted = assembly.problem.train
    problem = replace(assembly.problem, train=replace(fitted, tau=fitted.tau - c))
    train = train.replace(tau=train.required("tau") - c).noted(FEEDBACK)
    return identify_assembled(
        replace(assembly, problem=problem, parts=(train, *assembly.parts[1:])), usual
    )


def _delayed(recording: Recording, preparation: Preparation, delay: Array) -> Preparation:
    """The preparation with δ = sign · d."""
    late = tuple(float(x) for x in sign_of_delay(recording) * delay)
    if not any(late):
        return replace(preparation, torque_delay_s=None)
    return replace(preparation, torque_delay_s=late[0] if len(late) == 1 else late)


def _linearised(
    result: Identification,
    settings: Settings,
    request: DriveRequest,
    bias: Array,
    rough: bool = False,
) -> LinearisedDrive:
    lib = result.lib
    samples = samples_of(result.train, lib)
    rate = np.zeros((*samples.tau.shape, 0))
    if request.delay:
        rate = torque_rate(result, samples, request.per_joint)
    prior = settings.prior
    known = known_friction(settings, result.friction.columns, result.friction)
    return linearised(
        lib,
        samples,
        result.pi,
        result.phi,
        result.weights,
        kappa=prior.kappa if prior and prior.kappa else CAD,
        delay_columns=rate,
        biases=bias if request.bias else np.zeros(0),
        bias_prior=BIAS_PRIOR,
        phi_prior=None if known is None else known.sigma,
        rough=rough,
    )
