"""Evaluation of an identified model on another log: torque errors and audit of the mass matrix.

M(q) ≻ 0 over the joint box is proven where the bodies allow it, else searched:

    proof     every P ≻ 0  ⇒  λ_min(M(q) + diag(J)) ≥ b > 0 for every q  (`Library.least_inertia`)
    search    N uniform positions, then descent of λ_min from the smallest of them

A search that finds no violation bounds the share of the box in which M is not positive definite:
below 1 − 0.05^(1/N) with 95 % confidence. Base parameters of a method without constraints need the
search; a controller that inverts M needs the answer.

Positions are predicted from the commands of a control law alone: the prediction starts at the first
row and sees no measurement after it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import msgspec
import numpy as np
from scipy.optimize import minimize

from runtime.common.tables import NOTHING, Table, number, percent, significant
from runtime.errors import RecordingError, SimulationError
from runtime.estimators.regression.samples import samples_of
from runtime.identification import metrics
from runtime.identification.identified import torque_of
from runtime.identification.prepared_log import preparation_of
from runtime.identification.result_file import AnyResult, opened
from runtime.identification.result_record import ErrorPercent, ErrorRms, error_parts
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.recording import Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.preprocessing import is_filtered, prepare
from runtime.recording.rest_speeds import still_travels
from runtime.recording.row_marks import SAME
from runtime.recording.settings import COLUMNS
from runtime.recording.unit_conversion import per_joint
from runtime.simulation.commanded_motion import ServoDrive, commanded_motion

FIRST = 5  # rows whose slope is the first velocity, where none was measured, and of a joint at rest
MOST_SECONDS = 300.0  # length of the part that is predicted [s]


@dataclass(frozen=True, slots=True)
class PositionErrors:
    """RMS over the rows per joint, (n,) [rad, m]."""

    commanded: tuple[float, ...]  # of the command less the measured position
    predicted: tuple[float, ...]  # of the predicted less the measured position
    seconds: float  # length of the part


def drive_term(saved: SavedResult, model_term: str) -> Array:
    """Coefficients (n,) of the columns that stand for a term of simulators' joints."""
    named = [COLUMNS[name].model_term == model_term for name in saved.friction.columns]
    return np.maximum(saved.phi[:, named].sum(axis=1), 0.0)


def position_errors(
    saved: SavedResult, lib: Library, recording: Recording, prepared: Recording
) -> tuple[PositionErrors | None, tuple[str, ...]]:
    """Errors of a log as read, by the delay of the log as prepared; and sentences on them."""
    law, tau = recording.law, recording.tau
    if law is None or tau is None or any(value is None for value in law.numbers.values()):
        return None, ()
    n = lib.n_joints
    kp, kd, limit, gear = (per_joint("torque", key, value, n) for key, value in law.numbers.items())
    stiffness, damping = gear**2 * kp, gear**2 * kd
    if not stiffness.all():
        return None, ("positions are not predicted: a joint whose kp is 0 follows no command",)
    if np.any(np.abs(tau) >= np.where(limit > 0, gear * limit, np.inf)):
        return None, ("positions are not predicted: rows at the effort limit hide the commands",)
    command = tau + stiffness * recording.q  # as far as it is needed: with kd the log has dq
    if damping.any():
        command = command + damping * recording.required("dq")
    t, rows = recording.t, recording.t <= recording.t[0] + MOST_SECONDS
    late = _delay(saved, prepared, n)
    moved = np.stack([np.interp(t - d, t, c) for d, c in zip(late, command.T, strict=True)], axis=1)
    columns = saved.friction.columns
    offset = saved.phi[:, [COLUMNS[name].is_constant for name in columns]].sum(axis=1)
    parts = saved.record.drive
    zero = np.array([part.encoder_bias or 0.0 for part in parts]) if parts else np.zeros(n)
    # Dry friction holds a joint that rests in the first rows.
    dry, place, still = drive_term(saved, "friction"), recording.q[0] + zero, np.zeros(n)
    weight = lib.inverse_dynamics(place, still, still, saved.pi) + lib.known_torque(place)
    load = np.abs(moved[0] - stiffness * recording.q[0] - offset - weight)
    rests = np.ptp(recording.q[:FIRST], axis=0) <= still_travels(lib)
    held = np.flatnonzero(rests & (load > dry))
    dry[held] = load[held]
    # The law acts late as a whole, −K q(t − d) − D dq(t − d): to second order in d a torque of
    # −K q − (D − K d) dq − (K d²/2 − D d) ddq.
    viscous = drive_term(saved, "damping")
    inertia = drive_term(saved, "armature") + stiffness * late**2 / 2 - damping * late
    drive = ServoDrive(
        stiffness,
        damping=np.maximum(damping - stiffness * late, -viscous),
        viscous=viscous,
        dry=dry,
        offset=offset,
        armature=np.maximum(inertia, 0.0),
    )
    slope = np.polyfit(t[:FIRST] - t[0], recording.q[:FIRST], 1)[0]
    first = recording.q[0], slope if recording.dq is None else recording.dq[0]
    try:
        q = commanded_motion(lib, saved.pi, drive, t[rows], moved[rows], first, zero)
    except SimulationError as fault:
        return None, (f"positions are not predicted: {fault}",)
    errors = PositionErrors(
        commanded=_rms(command[rows] / stiffness - recording.q[rows]),
        predicted=_rms(q - recording.q[rows]),
        seconds=float(np.ptp(t[rows])),
    )
    left = [name for name in columns if not (COLUMNS[name].model_term or COLUMNS[name].is_constant)]
    notes = []
    if held.size:
        sizes = (f"{lib.joint_names[j]} {significant(dry[j])}" for j in held)
        notes.append(
            "positions are predicted with more dry friction than was identified, since it holds "
            f"joints at rest in the first rows: {', '.join(sizes)} [N·m, N]"
        )
    if left:
        notes.append(f"positions are predicted without the friction columns {', '.join(left)}")
    return errors, tuple(notes)


def _rms(error: Array) -> tuple[float, ...]:
    return tuple(np.sqrt(np.mean(error**2, axis=0)).tolist())


def position_table(joints: Sequence[str], errors: PositionErrors) -> Table:
    """Errors per joint, and the share that the model leaves of those of the commands."""
    rows = zip(joints, errors.commanded, errors.predicted, strict=True)
    return Table(
        ("joint", "RMS of command − q", "RMS of prediction − q", "share"),
        tuple(
            (name, number(a), number(b), percent(100 * b / a) if a else NOTHING)
            for name, a, b in rows
        ),
        title=f"positions predicted from the commands alone, {errors.seconds:.0f} s [rad or m]",
    )


def _delay(saved: SavedResult, prepared: Recording, n: int) -> Array:
    """Time from a command to its torque (n,) [s]: of the preparation, else of the logs."""
    steps, sessions = prepared.prepared, saved.record.sessions
    if steps is not None and steps.torque_delay_s is not None:
        return -per_joint("preparation", "torque_delay_s", steps.torque_delay_s, n)
    logs = () if sessions is None or sessions.delay_s is None else sessions.delay_s
    known = [np.broadcast_to(each.value, n) for each in logs if each.value is not None]
    return np.median(known, axis=0) if known else np.zeros(n)


SAMPLES = 4096
STARTS = 4  # positions from which λ_min descends; of more, hardly one ends lower
CONFIDENCE = 0.95
_HALF_RANGE = {"prismatic": 1.0}  # half range of joints without limits [m]; others turn by ±π


@dataclass(frozen=True, slots=True)
class MassAudit:
    """Smallest eigenvalue of M(q) + diag(J) over the joint box."""

    proven_bound: float | None  # b, a lower bound at every q [kg·m², kg]; None without proof
    least_eigenvalue: float  # smallest one by the search, an upper bound of the minimum
    at: tuple[float, ...]  # (n,) position of it [rad, m]
    samples: int  # number of uniform positions N
    # bound of the share of the box with an eigenvalue of at most 0, with 95 % confidence; 0 with a
    # proof, None where the search found such a position
    violated_share_95: float | None

    @property
    def is_positive_definite(self) -> bool:
        """Whether no position with an eigenvalue of at most 0 is known."""
        return self.least_eigenvalue > 0

    def sentence(self) -> str:
        """Result of the audit in one sentence."""
        place, least = ", ".join(f"{x:.2f}" for x in self.at), f"{self.least_eigenvalue:.1e}"
        if self.proven_bound is not None:
            return (
                f"M(q) is positive definite at every q: proven eigenvalues from "
                f"{self.proven_bound:.1e} on, {least} is the smallest one seen"
            )
        if self.violated_share_95 is None:
            return (
                f"M(q) is not positive definite: an eigenvalue is {least} at q = {place}; "
                "a controller that inverts M needs a physically consistent result (map, pc-ols)"
            )
        return (
            f"M(q) is positive definite at {self.samples} positions ({least} is the "
            f"smallest eigenvalue), so that with 95 % confidence less than "
            f"{100 * self.violated_share_95:.2f} % of the joint box violate it; not proven, since "
            "some links are not physically consistent"
        )


def audit_mass(
    lib: Library, pi: Array, rotor: Array | float = 0.0, samples: int = SAMPLES, seed: int = 0
) -> MassAudit:
    """Audit M(q) + diag(J) over the limits of the joints, for π (10 L,) and rotors J (n,)."""
    rotors = np.broadcast_to(np.asarray(rotor, dtype=float), lib.n_joints)
    lower, upper = joint_box(lib)
    q = np.random.default_rng(seed).uniform(lower, upper, (samples, lib.n_joints))
    least = np.linalg.eigvalsh(lib.mass_matrix(q, pi) + np.diag(rotors))[:, 0]

    def eigenvalue(q: Array) -> tuple[float, Array]:
        """λ_min and its gradient vᵀ ∂(M v)/∂q, v its eigenvector; M v: torque by ddq = v."""
        values, vectors = np.linalg.eigh(lib.mass_matrix(q, pi) + np.diag(rotors))
        v, still = vectors[:, 0], np.zeros(lib.n_joints)
        pushed, _, _ = lib.inverse_dynamics_derivatives(q, still, v, pi)
        at_rest, _, _ = lib.inverse_dynamics_derivatives(q, still, still, pi)
        return float(values[0]), v @ (pushed - at_rest)

    best, at = np.inf, q[0]
    for k in np.argsort(least)[:STARTS]:
        box = list(zip(lower, upper, strict=True))
        descent = minimize(eigenvalue, q[k], jac=True, method="L-BFGS-B", bounds=box)
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


ALIKE = "the log is prepared as the log of identify; --cutoff and the setting rate change that"
RAW = (
    "the model was identified from a low-passed log, but this log is not filtered; give the same "
    "--cutoff and the setting rate as identify"
)

SEEN = (
    "the model was fitted to {:.0f} % of the rows of this log: these are errors of the fit, not of "
    "a test; give a log that identify has not read"
)
UNLIKE = 100.0  # torque error above which the model is worse than no model, %
WORSE = (
    "an error of {:.0f} % is larger than the torque itself: order, sign or unit of the joints, the "
    "payload or the robot of this log differ from those of identify; run: symgen inspect {}"
)

_FILTER = ("filter", "cutoff_hz", "window_s", "order")  # preparation's band of the torque


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """Torque errors of an identified model on a log.

    Attributes:
        robot: name of the robot.
        method: method that identified the model.
        joints: names of the joints, (n,).
        units: units of their torques, (n,).
        torque_error_percent: of the URDF and of the model, per joint and overall, in % of the RMS
            torque.
        torque_rms: the same [N·m, N].
        mass_matrix: whether M(q) with the rotors is positive definite over the limits.
        fitted_share: share of the rows that the model was fitted to.
        position_errors: errors of the positions that the control law predicts; None for a log of
            measured torques.
        notes: sentences on what limits the comparison.
    """

    robot: str
    method: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    torque_error_percent: ErrorPercent
    torque_rms: ErrorRms
    mass_matrix: MassAudit
    fitted_share: float
    position_errors: PositionErrors | None
    notes: tuple[str, ...]

    @property
    def is_test(self) -> bool:
        """Whether the model has not been fitted to rows of the log."""
        return self.fitted_share <= SAME

    def to_facts(self) -> dict[str, Any]:
        """Table of the JSON that `evaluate --json` prints."""
        facts = msgspec.to_builtins(self)
        is_positive = {"is_positive_definite": self.mass_matrix.is_positive_definite}
        return facts | {"mass_matrix": is_positive | facts["mass_matrix"]}


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
    preparation = preparation_of(recording, cutoff, rate)
    if preparation is None and recording.preparation == Preparation() != saved.preparation:
        preparation = saved.preparation.at_rate(recording.rate_hz)
        notes.append(ALIKE)
    elif preparation is None and recording.recipe is not None and recording.recipe is saved.recipe:
        preparation = recording.preparation.at_rate(recording.rate_hz)
        notes.append(ALIKE)
    prepared = prepare(recording, preparation, saved.friction, lib=lib)
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
    return Evaluation(
        robot=lib.name,
        method=saved.record.method,
        joints=saved.record.joints,
        units=saved.record.units,
        torque_error_percent=percent,
        torque_rms=rms,
        mass_matrix=audit_mass(lib, saved.pi, drive_term(saved, "armature")),
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
