"""Evaluation of an identified model on another log: torque errors and audit of the mass matrix.

M(q) ≻ 0 over the joint box is proven where the bodies allow it, else searched:

    proof     every P ≻ 0  ⇒  λ_min(M(q) + diag(J)) ≥ b > 0 for every q  (`Library.least_inertia`)
    search    N uniform positions, then descent of λ_min from the smallest of them

A search that finds no violation bounds the share of the box in which M is not positive definite:
below 1 − 0.05^(1/N) with 95 % confidence. Base parameters of a method without constraints need the
search; a controller that inverts M needs the answer.
"""

from dataclasses import dataclass
from os import PathLike
from typing import Any

import msgspec
import numpy as np
from scipy.optimize import minimize

from runtime.errors import RecordingError
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.identified import torque_of
from runtime.identification.position_errors import PositionErrors, drive_term, position_errors
from runtime.identification.prepared_log import preparation_of
from runtime.identification.result_file import AnyResult, opened
from runtime.identification.result_record import ErrorPercent, ErrorRms, error_parts
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.recording import Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.preprocessing import is_filtered, prepare
from runtime.recording.row_marks import SAME

SAMPLES = 4096
STARTS = 4
"""Positions from which λ_min descends; of more, hardly one ends lower."""
CONFIDENCE = 0.95
_HALF_RANGE = {"prismatic": 1.0}
"""Half range of joints without limits [m]; others turn by ±π."""


@dataclass(frozen=True, slots=True)
class MassAudit:
    """Smallest eigenvalue of M(q) + diag(J) over the joint box."""

    # b, a lower bound at every q [kg·m², kg]; None where there is no proof
    proven_bound: float | None
    least: float  # smallest eigenvalue that the search found, an upper bound of the minimum
    at: tuple[float, ...]  # (n,) position of it [rad, m]
    samples: int  # number of uniform positions N
    # bound of the share of the box with an eigenvalue of at most 0, with 95 % confidence; 0 with a
    # proof, None where the search found such a position
    violated_share: float | None

    @property
    def is_positive_definite(self) -> bool:
        """Whether no position with an eigenvalue of at most 0 is known."""
        return self.least > 0

    def sentence(self) -> str:
        """Result of the audit in one sentence."""
        place = ", ".join(f"{x:.2f}" for x in self.at)
        if self.proven_bound is not None:
            return (
                f"M(q) is positive definite at every q: proven eigenvalues from "
                f"{self.proven_bound:.1e} on, {self.least:.1e} is the smallest one seen"
            )
        if self.violated_share is None:
            return (
                f"M(q) is not positive definite: an eigenvalue is {self.least:.1e} at q = {place}; "
                "a controller that inverts M needs a physically consistent result (map, pc-ols)"
            )
        return (
            f"M(q) is positive definite at {self.samples} positions ({self.least:.1e} is the "
            f"smallest eigenvalue), so that with 95 % confidence less than "
            f"{100 * self.violated_share:.2f} % of the joint box violate it; not proven, since "
            "some links are not physically consistent"
        )

    def to_facts(self) -> dict[str, object]:
        """JSON-ready content."""
        return {
            "is_positive_definite": self.is_positive_definite,
            "proven_bound": self.proven_bound,
            "least_eigenvalue": self.least,
            "at": list(self.at),
            "samples": self.samples,
            "violated_share_95": self.violated_share,
        }


def audit_mass(
    lib: Library, pi: Array, rotor: Array | float = 0.0, samples: int = SAMPLES, seed: int = 0
) -> MassAudit:
    """Audit M(q) + diag(J) over the limits of the joints, for π (10 L,) and rotors J (n,)."""
    rotors = np.broadcast_to(np.asarray(rotor, dtype=float), lib.n_joints)
    lower, upper = joint_box(lib)
    q = np.random.default_rng(seed).uniform(lower, upper, (samples, lib.n_joints))
    least = np.linalg.eigvalsh(lib.mass_matrix(q, pi) + np.diag(rotors))[:, 0]
    best, at = np.inf, q[0]
    for k in np.argsort(least)[:STARTS]:
        descent = minimize(
            lambda x: _least_eigenvalue(lib, pi, rotors, x),
            q[k],
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(lower, upper, strict=True)),
        )
        # Where two eigenvalues meet, λ_min has a kink and the descent may stop early.
        value, place = (descent.fun, descent.x) if descent.fun < least[k] else (least[k], q[k])
        if value < best:
            best, at = float(value), place
    bound = lib.least_inertia(pi, rotors)
    proven = bound if np.isfinite(bound) and bound > 0 else None
    share = None if best <= 0 else 1 - (1 - CONFIDENCE) ** (1 / samples)
    if proven is not None:
        share = 0.0
    return MassAudit(proven, best, tuple(map(float, at)), samples, share)


def joint_box(lib: Library) -> tuple[Array, Array]:
    """Limits of the independent joints; where a joint has none, ±π rad or ±1 m, (n,) [rad, m]."""
    limits = lib.limits()
    half = np.array([_HALF_RANGE.get(joint.kind, np.pi) for joint in lib.manifest.joints])
    lower, upper = limits["lower"], limits["upper"]
    return np.where(np.isfinite(lower), lower, -half), np.where(np.isfinite(upper), upper, half)


def _least_eigenvalue(lib: Library, pi: Array, rotors: Array, q: Array) -> tuple[float, Array]:
    """λ_min and its gradient vᵀ ∂(M v)/∂q, v its eigenvector.

    M v is the torque at rest for the acceleration v, without that of gravity.
    """
    values, vectors = np.linalg.eigh(lib.mass_matrix(q, pi) + np.diag(rotors))
    v, still = vectors[:, 0], np.zeros(lib.n_joints)
    pushed, _, _ = lib.inverse_dynamics_derivatives(q, still, v, pi)
    at_rest, _, _ = lib.inverse_dynamics_derivatives(q, still, still, pi)
    return float(values[0]), v @ (pushed - at_rest)


ALIKE = "the log is prepared as the log of identify; --cutoff and the setting rate change that"
RAW = (
    "the model was identified from a low-passed log, but this log is not filtered; give the same "
    "--cutoff and the setting rate as identify"
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
    """Torque errors of an identified model on a log."""

    robot: str
    method: str  # that identified the model
    joints: tuple[str, ...]
    units: tuple[str, ...]  # of the torques of the joints
    # of the URDF (`before`) and of the model (`after`), per joint and overall: % of the RMS torque
    torque_error_percent: ErrorPercent
    torque_rms: ErrorRms  # the same [N·m, N]
    mass_matrix: MassAudit  # whether M(q) with the rotors is positive definite over the limits
    fitted_share: float  # share of the rows that the model was fitted to
    # of positions predicted from the commands of a control law; None for a measured torque
    position_errors: PositionErrors | None
    notes: tuple[str, ...]  # what to know about the comparison, sentences

    @property
    def is_test(self) -> bool:
        """Whether the model has not been fitted to rows of the log."""
        return self.fitted_share <= SAME

    def to_facts(self) -> dict[str, Any]:
        """Table of the JSON that `evaluate --json` prints."""
        return msgspec.to_builtins(self) | {"mass_matrix": self.mass_matrix.to_facts()}


def evaluate(
    result: AnyResult,
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
    saved, lib, known = opened(result, lib)
    if saved.record.is_free:
        raise RecordingError(
            f"expected a robot whose base is fixed, got '{saved.record.robot}', whose base is "
            "free; run: symgen evaluate RESULT LOG"
        )
    if not isinstance(log, Recording | str | PathLike):
        raise RecordingError(f"expected a log or its file, got {log!r:.60}")
    notes = list(known)
    recording = saved.log_of(log, lib, recipe, run)
    require_plausible(recording, lib)
    terms = saved.friction
    preparation = preparation_of(recording, cutoff, rate)
    if preparation is None and recording.preparation == Preparation() != saved.preparation:
        preparation = saved.preparation.at_rate(recording.rate_hz)
        notes.append(ALIKE)
    elif preparation is None and recording.recipe is not None and recording.recipe is saved.recipe:
        preparation = recording.preparation.at_rate(recording.rate_hz)
        notes.append(ALIKE)
    prepared = prepare(recording, preparation, terms, lib=lib)
    samples = samples_of(prepared, lib)
    after = torque_of(lib, samples, saved.pi, saved.phi, saved.learned)
    both = (samples.rigid(lib, lib.pi0), after)
    percent, rms = error_parts(*(metrics.torque_error(samples.tau, tau) for tau in both))
    if is_filtered(saved.record.recording.history) and not is_filtered(prepared.history):
        notes.append(RAW)
    else:
        notes += _other_filter(saved, prepared)
    fitted = saved.fitted_share(recording)
    if fitted > SAME:
        notes.insert(0, SEEN.format(100 * fitted))
    if percent.after_overall is not None and percent.after_overall > UNLIKE:
        name = log.name if isinstance(log, Recording) else log
        notes.insert(0, WORSE.format(percent.after_overall, name))
    positions, unlike = position_errors(saved, lib, recording, prepared)
    rotor = drive_term(saved, "armature")
    return Evaluation(
        robot=lib.name,
        method=saved.record.method,
        joints=saved.record.joints,
        units=saved.record.units,
        torque_error_percent=percent,
        torque_rms=rms,
        mass_matrix=audit_mass(lib, saved.pi, rotor),
        fitted_share=fitted,
        position_errors=positions,
        notes=(*notes, *unlike),
    )


def _other_filter(saved: SavedResult, prepared: Recording) -> list[str]:
    """Sentence on filters of identify and evaluate that differ; none where they agree."""
    then, now = saved.preparation, prepared.prepared or Preparation()
    history = saved.record.recording.history
    unknown = then.filter == "none" and is_filtered(history)  # results of earlier versions
    if unknown or all(getattr(then, key) == getattr(now, key) for key in _FILTER):
        return []
    return [
        f"the model was identified with {_filter_of(then)}, this log is evaluated with "
        f"{_filter_of(now)}: the errors do not compare; give --cutoff and the setting rate of "
        "identify"
    ]


def _filter_of(preparation: Preparation) -> str:
    if preparation.filter == "none":
        return "no filter"
    if preparation.filter == "butterworth":
        return f"a low-pass at {preparation.cutoff_hz:g} Hz of order {preparation.order}"
    kind = "a mean" if preparation.filter == "average" else "a Savitzky–Golay filter"
    return f"{kind} over {preparation.window_s:g} s"
