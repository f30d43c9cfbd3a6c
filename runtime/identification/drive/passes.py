"""Gauss–Newton passes over the delay of the torque and the encoder biases."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from runtime.estimators.convex import CAD
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.estimators.regression.samples import samples_of
from runtime.identification.drive.feedback import FEEDBACK
from runtime.identification.drive.linearised import LinearisedDrive, linearised, torque_rate
from runtime.identification.drive.result import DriveRequest
from runtime.identification.identified import Identification
from runtime.identification.known_priors import known_friction
from runtime.identification.problem_setup import assemble
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify, identify_assembled
from runtime.library import Array, Library
from runtime.recording import Preparation, Recording

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
        return identify(moved, problem.lib, usual, progress=progress)
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
