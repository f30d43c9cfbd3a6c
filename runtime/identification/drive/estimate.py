"""Identification with the delay of the torque and the encoder biases as further unknowns.

Gauss–Newton on the exact model: at every pass the recording is prepared and identified anew with
the present delay d (`Preparation.torque_delay_s`) and q + b, and `linearised` gives the next step.
The first d is the minimum of the profile of the loss (`recorded_delay`).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD
from runtime.estimators.methods import chosen_method
from runtime.estimators.regression.recorded_delay import recorded_delay, sign_of_delay
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.drive.linearised import LinearisedDrive, linearised
from runtime.identification.drive.result import DriveFit, DriveRequest
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify
from runtime.library import Array, Library
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction import default_terms, geared
from runtime.recording.preprocessing import before_test
from runtime.recording.preprocessing.segments import segments

SPLIT = Split((0.0, 0.58), (0.58, 0.6), (0.6, 1.0))
"""Split where none is stated: the method has no stopping rule, so that it trains on the first 60 %
but for the least validation part."""
PASSES = 6
"""Largest number of Gauss–Newton passes."""
DONE = 0.1
"""Step over standard deviation below which the passes end."""
MOST_STEP = (0.02, 0.05)
"""Largest step of one pass: of a delay [s], of a bias [rad, m]."""
BIAS_PRIOR = 0.02
"""Standard deviation of the prior of an encoder bias [rad, m]: the residual of a calibration by
hand, a degree."""


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
    recipe = recording.recipe
    if settings.splitting is None and (recipe is None or recipe.split is None):
        settings = replace(settings, splitting=SPLIT)
    preparation = settings.preparation or recording.preparation
    terms = settings.friction_columns or default_terms(recording) or Friction(columns=())
    terms = geared(terms, recording, lib)
    sign, n = sign_of_delay(recording), lib.n_joints
    given = np.atleast_1d(np.asarray(preparation.torque_delay_s or 0.0, dtype=float)) * sign
    delay = given
    notes: tuple[str, ...] = ()
    if request.delay:
        seen = before_test(recording, settings.splitting)  # the delay is of the training, too
        first = recorded_delay(seen, lib, preparation, terms)
        if first.profile.is_flat:
            low, high = (1e3 * end for end in first.interval_s)
            request = replace(request, delay=False)
            notes = (
                "the log does not determine a delay: the loss is flat or least at the end of the "
                f"range ({low:.0f} to {high:.0f} ms); record a faster motion, or give "
                "torque_delay_s under [preparation]",
            )
        else:
            delay = np.full(n if request.per_joint else 1, first.delay_s)
    bias = np.zeros(n)
    for _ in range(PASSES):
        result = _at(recording, lib, replace(settings, certify=False), preparation, delay, bias)
        step = _linearised(result, settings, request, bias, rough=True)
        move, turn = step.delay_step, step.bias_step
        size = np.concatenate([move / step.delay_sigma, turn / step.bias_sigma])
        if not size.size or np.nanmax(np.abs(size)) < DONE:
            break
        if request.delay:
            delay = delay + np.clip(move, -MOST_STEP[0], MOST_STEP[0])
        if request.bias:
            bias = bias + np.clip(turn, -MOST_STEP[1], MOST_STEP[1])
    result = _at(recording, lib, settings, preparation, delay, bias, progress)
    step = _linearised(result, settings, request, bias)
    empty = np.full(n, np.nan)
    drive = DriveFit(
        delay=delay if request.delay else np.zeros(0),
        delay_sigma=step.delay_sigma,
        bias=bias if request.bias else empty,
        bias_sigma=step.bias_sigma if request.bias else empty,
        bias_prior=BIAS_PRIOR,
        phi_sigma=step.phi_sigma,
    )
    return replace(result, drive=drive, notes=(*notes, *result.notes))


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
    delay: Array,
    bias: Array,
    progress: Callable[[int, float], None] | None = None,
) -> Identification:
    """Identification at a given delay and given biases."""
    moved = recording.replace(q=recording.q + bias) if bias.any() else recording
    usual = replace(settings, preparation=_delayed(recording, preparation, delay))
    return identify(moved, lib, usual, progress=progress)


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
        rate = _torque_rate(result, samples, request.per_joint)
    prior = settings.prior
    return linearised(
        lib,
        samples,
        result.pi,
        result.phi,
        result.weights,
        kappa=prior.kappa if prior and prior.kappa else CAD,
        torque_rate=rate,
        biases=bias if request.bias else np.zeros(0),
        bias_prior=BIAS_PRIOR,
        rough=rough,
    )


def _torque_rate(result: Identification, samples: Samples, per_joint: bool) -> Array:
    """∂e/∂d = s τ̂̇ at the rows of the training part, (N, n, 1) or (N, n, n).

    The predicted torque is differentiated: the noise of the logged one, differentiated, would count
    as information on the delay.
    """
    predicted = result.predict_samples(samples)
    t = result.train.t
    rate = np.zeros_like(predicted)
    for part in segments(t):
        if part.stop - part.start > 1:
            rate[part] = np.gradient(predicted[part], t[part], axis=0)
    rate *= sign_of_delay(result.train)
    if not per_joint:
        return rate[:, :, None]
    return rate[:, :, None] * np.eye(rate.shape[1])
