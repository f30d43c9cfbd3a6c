"""Identification with the delay of the torque and the encoder biases as further unknowns.

Gauss–Newton on the exact model: at every pass the recording is prepared and identified anew with
the present delay d (`Preparation.torque_delay_s`) and q + b, and `linearised` gives the next step.
The first d is the minimum of the profile of the loss (`recorded_delay`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD
from runtime.estimators.methods import chosen_method
from runtime.estimators.regression.dry_friction_choice import with_dry_friction
from runtime.estimators.regression.recorded_delay import LATEST_S, recorded_delay, sign_of_delay
from runtime.estimators.regression.samples import samples_of
from runtime.identification.current_gains.scaling import with_current_gains
from runtime.identification.drive.feedback import (
    FEEDBACK,
    LinearisedDrive,
    feedback_torque,
    linearised,
    torque_rate,
)
from runtime.identification.drive.result import DriveFit, DriveRequest
from runtime.identification.identified import Identification
from runtime.identification.problem_setup import assemble, known_friction
from runtime.identification.settings import Settings, terms_of
from runtime.identification.single_log import identify_assembled, identify_recording
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.commanded_torque import without_ends
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction import geared
from runtime.recording.preprocessing import before_test

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
SPLIT = Split((0.0, 0.58), (0.58, 0.6), (0.6, 1.0))
"""Split where none is stated: the method has no stopping rule, so that it trains on the first 60 %
but for the least validation part."""
MOST_SIGMA = 0.02
"""Standard deviation of a delay above which it is not determined [s]."""


@dataclass(frozen=True, slots=True)
class DriveProblem:
    """A log whose delay of the torque and encoder biases are unknown.

    Attributes:
        recording: log as read.
        lib: library of the robot.
        settings: of the identification.
        request: what is estimated beside the parameters.
        preparation: of the rows; its delay is replaced.
        progress: as for `identify`.
    """

    recording: Recording
    lib: Library
    settings: Settings
    request: DriveRequest
    preparation: Preparation
    progress: Callable[[int, float], None] | None = None

    def rough(self) -> "DriveProblem":
        """The same without certificates and progress."""
        return replace(self, settings=replace(self.settings, certify=False), progress=None)


@dataclass(frozen=True, slots=True)
class DrivePoint:
    """Delay and its standard deviation, (1,) or (n,) [s], and biases (n,) [rad, m]."""

    delay: Array
    delay_sigma: Array
    bias: Array


def newton_passes(problem: DriveProblem, delay: Array) -> DrivePoint:
    """Most probable delay and biases.

    The passes take fewer rows of the low-passed signals until they end, then all rows.

    delay (1,) [s].
    """
    request = problem.request
    bias = np.zeros(problem.lib.n_joints)
    point = DrivePoint(delay, np.full(delay.shape, np.inf), bias)
    rough = problem.rough()
    present = replace(rough, preparation=_thinned(problem.recording, problem.preparation))
    for _ in range(PASSES if request.delay or request.bias else 0):
        step = linearised_at(problem, identification_at(present, point), point.bias, rough=True)
        point = replace(point, delay_sigma=step.delay_sigma)
        size = np.concatenate(
            [step.delay_step / step.delay_sigma, step.bias_step / step.bias_sigma]
        )
        if np.nanmax(np.abs(size)) < DONE and present.preparation is problem.preparation:
            break
        if np.nanmax(np.abs(size)) < 1.0:
            present = rough
        point = stepped(point, step, request)
    return point


def stepped(point: DrivePoint, step: LinearisedDrive, request: DriveRequest) -> DrivePoint:
    """The point after a step of bounded size."""
    delay, bias = point.delay, point.bias
    if request.delay:
        delay = delay + np.clip(step.delay_step, -MOST_STEP[0], MOST_STEP[0])
    if request.bias:
        bias = bias + np.clip(step.bias_step, -MOST_STEP[1], MOST_STEP[1])
    return DrivePoint(delay, step.delay_sigma, bias)


def _thinned(recording: Recording, preparation: Preparation) -> Preparation:
    """The preparation at a tenth of its cut-off's period, where the log is twice as fast."""
    cutoff = preparation.cutoff_hz
    if cutoff is None or preparation.rate_hz is not None:
        return preparation
    if recording.rate_hz < 1.9 * THINNED * cutoff:
        return preparation
    return replace(preparation, rate_hz=THINNED * cutoff)


def identification_at(
    problem: DriveProblem, point: DrivePoint, removed: tuple[Array, Array] | None = None
) -> Identification:
    """Identification with known delay and biases.

    removed (M,) [s].
    """
    recording, progress = problem.recording, problem.progress
    moved = recording.replace(q=recording.q + point.bias) if point.bias.any() else recording
    preparation = _delayed(recording, problem.preparation, point.delay)
    usual = replace(problem.settings, preparation=preparation)
    if removed is None:
        return identify_recording(moved, problem.lib, usual, progress=progress)
    assembly = assemble(moved, problem.lib, usual, progress=progress, is_joined=True)
    train, (t, torque) = assembly.parts[0], removed
    c = np.stack([np.interp(train.t, t, row) for row in torque.T], axis=1)
    fitted = assembly.problem.train
    less = replace(assembly.problem, train=replace(fitted, tau=fitted.tau - c))
    train = train.replace(tau=train.required("tau") - c).noted(FEEDBACK)
    return identify_assembled(
        replace(assembly, problem=less, parts=(train, *assembly.parts[1:])), usual
    )


def _delayed(recording: Recording, preparation: Preparation, delay: Array) -> Preparation:
    """The preparation with δ = sign · d."""
    late = tuple(float(x) for x in sign_of_delay(recording) * delay)
    if not any(late):
        return replace(preparation, torque_delay_s=None)
    return replace(preparation, torque_delay_s=late[0] if len(late) == 1 else late)


def linearised_at(
    problem: DriveProblem, result: Identification, bias: Array, rough: bool = False
) -> LinearisedDrive:
    """The step to the minimum of the linearised problem.

    bias (n,) [rad, m].
    """
    request, settings = problem.request, problem.settings
    samples = samples_of(result.train, result.lib)
    rate = np.zeros((*samples.tau.shape, 0))
    if request.delay:
        rate = torque_rate(result, samples, request.per_joint)
    prior = settings.prior
    known = known_friction(settings, result.friction.columns, result.friction)
    return linearised(
        result,
        samples,
        kappa=prior.kappa if prior and prior.kappa else CAD,
        delay_columns=rate,
        biases=bias if request.bias else np.zeros(0),
        bias_prior=BIAS_PRIOR,
        phi_prior=None if known is None else known.sigma,
        rough=rough,
    )


@one_blas_thread
def identify_drive(
    recording: Recording,
    lib: Library,
    settings: Settings,
    request: DriveRequest,
    *,
    progress: Callable[[int, float], None] | None = None,
) -> Identification:
    """Identify a robot together with the delay of its torque and its encoder biases."""
    _require(settings, recording)
    recording = independent_joints(recording, lib)
    recording = with_current_gains(
        recording, lib, preparation=settings.preparation, split=settings.split or SPLIT
    )
    recipe = recording.recipe
    # Delay, biases and intervals belong to the rows of the training: no second fit to all rows.
    settings = replace(settings, refit=False)
    if settings.split is None and (recipe is None or recipe.split is None):
        settings = replace(settings, split=SPLIT)
    preparation = without_ends(recording, settings.preparation or recording.preparation)
    settings = replace(settings, preparation=preparation)
    terms = geared(terms_of(recording, settings), recording, lib)
    if settings.friction is None and not (recipe and recipe.friction):
        seen = before_test(recording, settings.split)
        terms, sentence = with_dry_friction(seen, lib, preparation, terms, request.delay)
        settings = replace(settings, friction=terms)
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
    given = np.asarray(preparation.torque_delay_s or 0.0, dtype=float)
    delay = np.atleast_1d(given) * sign_of_delay(recording)
    problem = DriveProblem(recording, lib, settings, request, preparation, progress)
    unknown: str | None = None
    if request.delay:
        point, unknown = _with_delay(problem, terms)
        if point is not None:
            return _certified(problem, point)
    problem = replace(problem, request=replace(request, delay=False))
    result = _certified(problem, newton_passes(problem, delay))
    if unknown is None:
        return result
    sentence = (
        f"the log does not determine a delay: {unknown}; record a faster motion, or give "
        "torque_delay_s under [preparation]"
    )
    return replace(result, notes=(sentence, *result.notes))


def _with_delay(problem: DriveProblem, terms: Friction) -> tuple[DrivePoint | None, str]:
    """The most probable delay and biases; None and the reason where the log has no delay."""
    # The profile is of the rows before the test part, as the passes are.
    seen = before_test(problem.recording, problem.settings.split)
    first = recorded_delay(seen, problem.lib, problem.preparation, terms)
    if first.profile.is_flat:
        low, high = (1e3 * end for end in first.interval_s)
        return None, f"the loss is flat from {low:.0f} to {high:.0f} ms, or least at an end"
    count = problem.lib.n_joints if problem.request.per_joint else 1
    point = newton_passes(problem, np.full(count, first.delay_s))
    if np.all(point.delay_sigma < MOST_SIGMA) and np.all(np.abs(point.delay) < LATEST_S):
        return point, ""
    return None, f"its standard deviation is {1e3 * np.max(point.delay_sigma):.0f} ms"


def _certified(problem: DriveProblem, point: DrivePoint) -> Identification:
    """The identification next to a point, without the bias by feedback, with its certificates."""
    request = problem.request
    result = identification_at(problem, point)
    c = feedback_torque(result, point.delay, request)
    if c is not None:
        removed = (result.train.t, c)
        rough = identification_at(problem.rough(), point, removed)
        point = stepped(point, linearised_at(problem, rough, point.bias), request)
        result = identification_at(problem, point, removed)
    step = linearised_at(problem, result, point.bias)
    empty = np.full(problem.lib.n_joints, np.nan)
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
