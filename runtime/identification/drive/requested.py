"""What the settings request of the drives of a log: delay, encoder biases, mirrored links."""

import math
from dataclasses import replace

from runtime.errors import IdentificationError
from runtime.estimators.convex.constraints import Constraints
from runtime.estimators.methods import METHODS, require_method
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.identification.drive.result import DriveRequest
from runtime.identification.drive.symmetry import mirrored_joints, mirrored_links
from runtime.identification.prepared_log import PreparedLog
from runtime.identification.settings import AUTO, PER_JOINT, Settings
from runtime.library import Library
from runtime.recording import Friction, Preparation
from runtime.recording.friction import default_terms
from runtime.recording.recipes.recipe import COMMANDED

LATEST = 1.0
"""Largest delay that is stated [s]."""


def drive_request(data: PreparedLog, settings: Settings, method: str) -> DriveRequest | None:
    """What is estimated of the drives; None for nothing."""
    estimated = settings.delay in {AUTO, PER_JOINT}
    commanded = data.recording.torque_source == COMMANDED
    bias = settings.encoder_bias
    wanted = bias if bias is not None else commanded and estimated
    if not (estimated or wanted or (commanded and method == "map")):
        return None
    tied = tuple(settings.symmetric) if settings.tie else ()
    return DriveRequest(estimated, settings.delay == PER_JOINT, wanted, tied)


def with_mirrored_links(
    prior: PriorFile | None, lib: Library, symmetric: tuple[str, ...], is_tied: bool
) -> PriorFile | None:
    """Inertial prior, with equations that tie the links of mirrored joints where requested."""
    if not is_tied and not symmetric:
        return prior
    if not is_tied:
        mirrored_joints(lib.joint_names, symmetric)
        return prior
    if not symmetric:
        raise IdentificationError(
            "--tie needs the names of the mirrored joints, got none; give --symmetric LEFT:RIGHT"
        )
    usual = prior or PriorFile(None, Constraints())
    rows = (*usual.constraints.equations, *mirrored_links(lib, symmetric))
    return replace(usual, constraints=replace(usual.constraints, equations=rows))


def columns_of(data: PreparedLog, settings: Settings) -> Friction | None:
    """Friction columns of one log; None for those of its recipe or of its commanded torque."""
    terms, stated = data.friction, settings.friction is None and settings.coulomb_speed is None
    if stated and terms == default_terms(data.recording):
        terms = None
    method = settings.method
    if terms is None and method and require_method(method).default_columns:
        terms = Friction(METHODS[method].default_columns)
    return terms


def delayed(data: PreparedLog, delay: float | str | None, has_bias: bool) -> Preparation | None:
    """Preparation with a stated delay."""
    recording, preparation = data.recording, data.preparation
    if data.is_at_rest and (delay is not None or has_bias):
        raise IdentificationError(
            "--delay and --encoder-bias need motion, but the log contains poses at rest; leave "
            "them out, or give --cutoff to identify from the motion between the poses"
        )
    if delay is None or delay in {AUTO, PER_JOINT}:
        return preparation
    try:
        seconds = float(delay)
        if not math.isfinite(seconds) or abs(seconds) > LATEST:
            raise ValueError
    except ValueError:
        raise IdentificationError(
            f"--delay needs a number of seconds within 1 s, {AUTO} or {PER_JOINT}, got '{delay}'"
        ) from None
    usual = preparation or recording.preparation
    return replace(usual, torque_delay_s=sign_of_delay(recording) * seconds or None)
