"""Identification with the delay of the torque and the encoder biases as further unknowns.

Gauss–Newton on the exact model: at every pass the recording is prepared and identified anew with
the present delay d (`Preparation.torque_delay_s`) and q + b, and `linearised` gives the next step.
The first d is the minimum of the profile of the loss (`recorded_delay`).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.methods import chosen_method
from runtime.estimators.regression.dry_friction_choice import with_dry_friction
from runtime.estimators.regression.recorded_delay import LATEST_S, recorded_delay, sign_of_delay
from runtime.identification.current_gains.scaling import with_current_gains
from runtime.identification.drive.feedback import feedback_torque
from runtime.identification.drive.passes import (
    BIAS_PRIOR,
    DrivePoint,
    DriveProblem,
    identification_at,
    linearised_at,
    newton_passes,
    stepped,
)
from runtime.identification.drive.result import DriveFit, DriveRequest
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Recording, Split
from runtime.recording.commanded_torque import without_ends
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction import default_terms, geared
from runtime.recording.preprocessing import before_test

SPLIT = Split((0.0, 0.58), (0.58, 0.6), (0.6, 1.0))
"""Split where none is stated: the method has no stopping rule, so that it trains on the first 60 %
but for the least validation part."""

MOST_SIGMA = 0.02
"""Standard deviation of a delay above which it is not determined [s]."""


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
    seen = before_test(problem.recording, problem.settings.splitting)
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
