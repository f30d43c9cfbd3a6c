"""Evaluation of an identified model on another log: torque errors and audit of the mass matrix."""

from dataclasses import dataclass
from os import PathLike
from typing import Any

import msgspec
import numpy as np

from runtime.errors import RecordingError
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.identified import Identification, torque_of
from runtime.identification.mass_audit import MassAudit, audit_mass
from runtime.identification.prepared_log import preparation_of
from runtime.identification.result_file import saved_of
from runtime.identification.result_record import ErrorPercent, ErrorRms, error_parts
from runtime.identification.saved_result import SavedResult, require_model
from runtime.library import Library, load, require_library
from runtime.recording import Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.friction import COLUMNS
from runtime.recording.preprocessing import is_filtered, prepare
from runtime.recording.row_marks import SAME

ALIKE = "the log is prepared as the log of identify; --cutoff and --rate change that"
RAW = (
    "the model was identified from a low-passed log, but this log is not filtered; give the same "
    "--cutoff and --rate as identify"
)

SEEN = (
    "the model was fitted to {:.0f} % of the rows of this log: these are errors of the fit, not of "
    "a test; give a log that identify has not read"
)
UNLIKE = 100.0
"""Torque error above which the model is worse than no model, %."""
WORSE = (
    "an error of {:.0f} % is larger than the torque itself: order, sign or unit of the joints, the "
    "payload or the robot of this log differ from those of identify; run: symgen inspect {}"
)

_FILTER = ("filter", "cutoff_hz", "window_s", "order")
"""Fields of a preparation that decide which band the torque has."""


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """Torque errors of an identified model on a log.

    Attributes:
        robot: name of the robot.
        method: that identified the model.
        joints: names of the joints.
        units: of their torques.
        torque_error_percent: of the URDF (`before`) and of the model (`after`) in percent of the
            RMS torque, per joint and overall.
        torque_rms: the same in N·m or N.
        mass_matrix: whether M(q) with the rotors is positive definite over the joint limits.
        fitted_share: share of the rows that the model was fitted to.
        notes: what to know about the comparison, sentences.
    """

    robot: str
    method: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    torque_error_percent: ErrorPercent
    torque_rms: ErrorRms
    mass_matrix: MassAudit
    fitted_share: float
    notes: tuple[str, ...]

    @property
    def is_test(self) -> bool:
        """Whether the model has not been fitted to rows of the log."""
        return self.fitted_share <= SAME

    def to_facts(self) -> dict[str, Any]:
        """Table of the JSON that `evaluate --json` prints."""
        return {
            "robot": self.robot,
            "method": self.method,
            "joints": list(self.joints),
            "units": list(self.units),
            "torque_error_percent": msgspec.to_builtins(self.torque_error_percent),
            "torque_rms": msgspec.to_builtins(self.torque_rms),
            "mass_matrix": self.mass_matrix.to_facts(),
            "fitted_share": self.fitted_share,
            "notes": list(self.notes),
        }


def evaluate(
    result: SavedResult | Identification | str | PathLike[str],
    log: Recording | str | PathLike[str],
    lib: Library | None = None,
    *,
    recipe: str | None = None,
    run: str | None = None,
    cutoff: float | None = None,
    rate: float | None = None,
) -> Evaluation:
    """Evaluate an identified model on another log, as the command does.

    Args:
        result: of `identify` or `read_result`, or a folder that `symgen identify` wrote.
        log: of the same robot, as `read_recording` returns it, or its file.
        lib: library of the robot; None is that of the result.
        recipe: name or file of a recipe of the log; None finds it.
        run: run of a data set that holds several.
        cutoff: cut-off of the low-pass [Hz]; None is that of identify.
        rate: rate of the rows [Hz]; None is that of identify.

    Returns:
        Errors of the URDF and of the model, the audit of M(q), and notes.

    Raises:
        RuntimeFault: an argument of another kind, a log or result that cannot be read, another
            robot, or one with a free base.
    """
    saved = saved_of(result)
    if lib is None:
        lib = result.lib if isinstance(result, Identification) else load(saved.robot)
    require_library(lib)
    place = result if isinstance(result, str | PathLike) else f"the result of {saved.robot}"
    notes = require_model(saved, lib, str(place))
    if saved.is_free:
        raise RecordingError(
            f"expected a robot whose base is fixed, got '{saved.robot}', whose base is free; run: "
            "symgen evaluate RESULT LOG"
        )
    if not isinstance(log, Recording | str | PathLike):
        raise RecordingError(f"expected a log or its file, got {log!r:.60}")
    return evaluation_of(saved, lib, log, notes, recipe, run, cutoff, rate)


def evaluation_of(
    saved: SavedResult,
    lib: Library,
    log: Recording | str | PathLike[str],
    known: tuple[str, ...],
    recipe: str | None,
    run: str | None,
    cutoff: float | None,
    rate: float | None,
) -> Evaluation:
    """Evaluation of a saved model of a robot with a fixed base."""
    notes = list(known)
    recording = saved.log_of(log, lib, recipe, run)
    require_plausible(recording, lib)
    terms = saved.friction
    preparation = preparation_of(recording, cutoff, rate)
    if preparation is None and recording.preparation == Preparation() != saved.preparation:
        preparation = saved.preparation
        notes.append(ALIKE)
    elif preparation is None and recording.recipe is not None and recording.recipe is saved.recipe:
        notes.append(ALIKE)
    prepared = prepare(recording, preparation, terms, lib=lib)
    samples = samples_of(prepared, lib)
    after = torque_of(lib, samples, saved.pi, saved.phi, saved.learned)
    both = (samples.rigid(lib, lib.pi0), after)
    percent, rms = error_parts(*(metrics.torque_error(samples.tau, tau) for tau in both))
    if is_filtered(saved.history) and not is_filtered(prepared.history):
        notes.append(RAW)
    else:
        notes += _other_filter(saved, prepared)
    fitted = saved.fitted_share(recording)
    if fitted > SAME:
        notes.insert(0, SEEN.format(100 * fitted))
    if percent.after_overall is not None and percent.after_overall > UNLIKE:
        name = log.name if isinstance(log, Recording) else log
        notes.insert(0, WORSE.format(percent.after_overall, name))
    inertial = [k for k, n in enumerate(terms.columns) if COLUMNS[n].model_term == "armature"]
    rotor = np.maximum(saved.phi[:, inertial].sum(axis=1), 0.0)
    return Evaluation(
        robot=lib.name,
        method=saved.method,
        joints=saved.joints,
        units=saved.units,
        torque_error_percent=percent,
        torque_rms=rms,
        mass_matrix=audit_mass(lib, saved.pi, rotor),
        fitted_share=fitted,
        notes=tuple(notes),
    )


def _other_filter(saved: SavedResult, prepared: Recording) -> list[str]:
    """Sentence on filters of identify and evaluate that differ; none where they agree."""
    then, now = saved.preparation, prepared.prepared or Preparation()
    unknown = then.filter == "none" and is_filtered(saved.history)  # results of earlier versions
    if unknown or all(getattr(then, key) == getattr(now, key) for key in _FILTER):
        return []
    return [
        f"the model was identified with {_filter_of(then)}, this log is evaluated with "
        f"{_filter_of(now)}: the errors do not compare; give --cutoff and --rate of identify"
    ]


def _filter_of(preparation: Preparation) -> str:
    if preparation.filter == "none":
        return "no filter"
    if preparation.filter == "butterworth":
        return f"a low-pass at {preparation.cutoff_hz:g} Hz of order {preparation.order}"
    kind = "a mean" if preparation.filter == "average" else "a Savitzky–Golay filter"
    return f"{kind} over {preparation.window_s:g} s"
