"""Options --delay and --encoder-bias, and the table of the drives of a result."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from rich.table import Table

from runtime.cli.log_options import AUTO, PER_JOINT
from runtime.cli.prepared_log import PreparedLog
from runtime.common.terminal import console, say
from runtime.errors import IdentificationError
from runtime.estimators.convex.constraints import Constraints
from runtime.estimators.methods import METHODS, require_method
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.identification.drive.result import DriveRequest
from runtime.identification.drive.symmetry import mirrored_joints, mirrored_links
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.commanded_torque import COMMANDED
from runtime.recording.friction import default_terms


def drive_request(
    recording: Recording,
    delay: str | None,
    bias: bool | None,
    method: str,
    tied: tuple[str, ...] = (),
) -> DriveRequest | None:
    """Request for an estimate of the drives."""
    estimated = delay in {AUTO, PER_JOINT}
    commanded = recording.torque_source == COMMANDED
    wanted = bias if bias is not None else commanded and estimated
    if not (estimated or wanted or (commanded and method == "map")):
        return None

    return DriveRequest(estimated, delay == PER_JOINT, wanted, tied)


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


def terms_of(data: PreparedLog, method: str | None, named: object) -> Friction | None:
    """Friction columns of one log."""
    terms = data.friction
    if named is None and terms == default_terms(data.recording):
        terms = None
    if terms is None and method and require_method(method).default_columns:
        terms = Friction(METHODS[method].default_columns)
    return terms


def delayed(data: PreparedLog, delay: str | None, has_bias: bool) -> Preparation | None:
    """Preparation with the number of --delay."""
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
        if not math.isfinite(seconds) or abs(seconds) > 1.0:
            raise ValueError
    except ValueError:
        raise IdentificationError(
            f"--delay needs a number of seconds within 1 s, {AUTO} or {PER_JOINT}, got '{delay}'"
        ) from None

    usual = preparation or recording.preparation
    return replace(usual, torque_delay_s=sign_of_delay(recording) * seconds or None)


def print_drives(facts: Mapping[str, Any]) -> None:
    """Print delay and drives of result.json, value ± standard deviation."""
    drives = facts["drive"]
    if not drives:
        return
    names = ("armature", "viscous", "coulomb", "offset", "encoder_bias")
    kept = [name for name in names if any(drive[name] is not None for drive in drives)]
    table = Table("joint", title="Drives: value ± standard deviation, SI units")
    for name in kept:
        table.add_column(name.replace("_", " "), justify="right")
    for drive in drives:
        cells = (_cell(drive[name], drive["sigma"][name]) for name in kept)
        table.add_row(drive["joint"], *cells)
    if kept:
        console.print(table)
    delays = facts["delay_s"]
    for each in [delays] if isinstance(delays, dict) else delays or []:
        where = f" of {each['log']}" if "log" in each else ""
        say(f"delay of the torque{where}: {_cell(each['value'], each['sigma'], 1e3)} ms")
    unknown = [d["joint"] for d in drives if d["encoder_bias_verdict"].startswith("not ident")]
    if unknown:
        say(f"encoder bias: not identifiable from this motion at {', '.join(unknown)}")


def _cell(value: float | None, sigma: float | None, factor: float = 1.0) -> str:
    if value is None:
        return "–"
    spread = "" if sigma is None else f" ± {factor * sigma:.2g}"
    return f"{factor * value:.4g}{spread}"
