"""The record of result.json: its fields are the keys, with their types; schema, writer and reader.

n joints, L links, k friction columns, n_b base parameters. Torques are in N·m, forces in N. A file
of format 1 or 2 becomes one of the present format in `migrated`, from the table `RENAMED` (a key
that has another name now) and the third note on a type (what stands for a key that the file lacks).
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Annotated as Of
from typing import Any, Self, get_args, get_origin, get_type_hints

import numpy as np

from runtime.common.records import Record, Vector3
from runtime.estimators.classical.pc_ols import BOUNDARY
from runtime.estimators.convex.entropic_prior import com_sigma
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.metrics import TorqueError
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, centre_of_mass, links, mass
from runtime.recording.settings import WIDTHS, Friction, width_of

FORMAT = 3  # number of the present format; a change that an older reader would misread raises it

RENAMED = {  # key of formats 1 and 2 → its name in format 3
    "own_offset_overall": "log_offset_overall",
    "alone_overall": "single_log_overall",
    "beta_promised": "beta_sigma_expected",
    "rise": "exchanged_error_ratio",
    "white": "white_lag_share",
    "gain_limits": "detectable_gain_error",
}

Numbers = tuple[float, ...]
Gaps = tuple[float | None, ...]
Rows = tuple[Numbers, ...]
Texts = tuple[str, ...]
MaybeVector = tuple[float | None, float | None, float | None]
Ends = tuple[tuple[tuple[float, float] | None, ...], ...]
PerJoint = float | Numbers | None


class Part(Record, frozen=True, forbid_unknown_fields=False):
    """A table of result.json."""

    @classmethod
    @cache
    def keys(cls) -> dict[str, tuple[str, list[Any], type["Part"] | None]]:
        """Meaning of every key, what stands for it in older files, and the kind of its tables."""
        hints = get_type_hints(cls, include_extras=True)
        kinds = {name: get_args(hints[name]) for name in cls.__struct_fields__}
        return {name: (x[1], [*x[2:]], next(_parts(x[0]), None)) for name, x in kinds.items()}

    @classmethod
    def with_gaps(cls, **facts: Any) -> Self:
        """A table of some facts, with what stands for the missing ones in older files."""
        return cls(**{name: x[0] for name, (_, x, _) in cls.keys().items() if x} | facts)

    @classmethod
    def from_columns(cls, **columns: Iterable[Any]) -> tuple[Self, ...]:
        """One table per entry of columns of equal length."""
        values = (plain(x) if isinstance(x, np.ndarray) else x for x in columns.values())
        return tuple(cls(**dict(zip(columns, x, strict=True))) for x in zip(*values, strict=True))


def _parts(hint: Any) -> Iterator[type[Part]]:
    """Tables that a type names."""
    if isinstance(hint, type) and issubclass(hint, Part):
        yield hint
    for each in () if get_origin(hint) is dict else get_args(hint):
        yield from _parts(each)


class JointPlace(Part, frozen=True):
    """One joint of the model."""

    kind: Of[str, "kind of the joint"]
    parent: Of[int, "number of the joint that it sits on; −1 is the base"]
    rotation: Of[Rows, "of its frame in that of the parent, (3, 3)"]
    translation: Of[Vector3, "(3,) [m]"]
    axis: Of[Vector3, "(3,)"]


class ModelPart(Part, frozen=True):
    """Model that the parameters belong to."""

    model_hash: Of[str, "SHA-256 of the model"]
    gravity: Of[Vector3, "in the base frame, (3,) [m/s²]"]
    joints: Of[tuple[JointPlace, ...], "every joint, one per moving link"]
    lumped: Of[Texts, "names of the fixed links that count into moving ones"]


class RecordingPart(Part, frozen=True):
    """The data."""

    name: Of[str | None, "name of the recording", "unnamed recording"]
    duration: Of[float | None, "of all parts [s]", None]
    samples: Of[dict[str, int], "number per part: train, validation, test", {}]
    history: Of[Texts, "sentences on every step of the preparation", ()]
    preparation: Of[dict[str, Any], "settings of the preparation that are not the default", {}]
    split: Of[str, "instants of the parts, a phrase [s]", ""]


class ControlLaw(Part, frozen=True):
    """Control law of a commanded torque; a gain that varies over the log is null."""

    law: Of[str, "name of the law"]
    kp: Of[PerJoint, "stiffness, for all joints or (n,) [N·m/rad, N/m]"]
    kd: Of[PerJoint, "damping, for all joints or (n,) [N·m·s/rad, N·s/m]"]
    effort_limit: Of[PerJoint, "likewise [N·m, N]"]
    gear: Of[PerJoint, "ratio, likewise"]


class CurrentGain(Part, frozen=True):
    """Estimated gain of one motor current."""

    channel: Of[str, "joint, or motor where the gear couples joints"]
    gain: Of[float, "torque over current [N·m/A]"]
    sigma: Of[float | None, "standard deviation with the URDF as prior [N·m/A]; null if unseen"]
    ratio_to: Of[str, "channel to which the ratio is taken"]
    ratio_sigma: Of[float | None, "relative standard deviation of that ratio without the URDF"]
    verdict: Of[str, "determined (up to the common factor), of the URDF, or not identifiable"]


class Delay(Part, frozen=True, omit_defaults=True):
    """Delay of the torque; a list where joints differ, null where it is not determined."""

    value: Of[PerJoint, "[s]"]
    sigma: Of[PerJoint, "standard deviation [s]"]
    name: Of[str, "name of the log, of several"] = ""


class MirroredPair(Part, frozen=True):
    """Armature or friction of two mirrored joints."""

    left: Of[str, "left joint"]
    right: Of[str, "right joint"]
    quantity: Of[str, "armature or friction"]
    values: Of[tuple[Numbers, Numbers], "left and right, per coefficient, (2, m)"]
    sigma: Of[tuple[Numbers, Numbers], "standard deviations, (2, m)"]
    distance: Of[float, "difference in its standard deviations"]
    agrees: Of[bool, "whether it is within the 95 % interval"]
    exchanged_error_ratio: Of[float | None, "held-out error with exchanged drives, over without"]
    sentence: Of[str | None, "where the sides disagree and why; null where they agree"]


class DriveValues(Part, frozen=True):
    """Values of one drive; null where the motion does not determine them."""

    armature: Of[float | None, "inertia of rotor and gear [kg·m²]"]
    viscous: Of[float | None, "viscous friction [N·m·s/rad]"]
    coulomb: Of[float | None, "Coulomb friction, with or without a memory [N·m]"]
    offset: Of[float | None, "torque offset [N·m]"]
    encoder_bias: Of[float | None, "b of q_true = q + b [rad]"]


class DrivePart(DriveValues, frozen=True):
    """Drive of one joint."""

    joint: Of[str, "name of the joint"]
    sigma: Of[DriveValues, "standard deviations"]
    encoder_bias_verdict: Of[str, "identified, not identifiable from this motion, or not estimated"]


class ErrorPercent(Part, frozen=True, omit_defaults=True):
    """100 ‖τ − τ̂‖/‖τ‖ on the test part [%]; null where τ = 0."""

    before: Of[Gaps, "of the URDF without friction, (r,)"]
    after: Of[Gaps, "of the identified model, (r,)"]
    before_overall: Of[float | None, "of the URDF, all joints together"]
    after_overall: Of[float | None, "of the identified model, all joints together"]
    urdf_friction: Of[Gaps | None, "of the URDF with friction fitted, (n,)"] = None
    urdf_friction_overall: Of[float | None, "likewise, all joints together"] = None


class ErrorRms(Part, frozen=True, omit_defaults=True):
    """Root mean square of τ − τ̂ on the test part."""

    before: Of[Numbers, "of the URDF without friction, (r,)"]
    after: Of[Numbers, "of the identified model, (r,)"]
    urdf_friction: Of[Numbers | None, "of the URDF with friction fitted, (n,)"] = None


class LinkPart(Part, frozen=True):
    """One moving link."""

    name: Of[str, "name of the link"]
    mass: Of[float, "identified mass [kg]"]
    mass_before: Of[float, "mass of the URDF [kg]"]
    com: Of[MaybeVector, "identified centre of mass in the link's frame, (3,) [m]"]
    com_before: Of[Vector3, "centre of mass of the URDF, (3,) [m]"]
    min_relative_eigenvalue: Of[float | None, "λ_min(P)/tr P; below 0 is not consistent"]


class LinkUncertainty(Part, frozen=True):
    """Uncertainty of one link."""

    mass_sigma: Of[float, "standard deviation of the mass [kg]"]
    com_sigma: Of[Vector3 | None, "of the centre of mass, (3,) [m]; null where it is undefined"]
    verdicts: Of[Texts, "one per parameter: identified, prior-dominated or unobservable, (10,)"]


class UncertaintyPart(Part, frozen=True):
    """Posterior of the parameters."""

    advice: Of[str, "what to record next, a sentence"]
    n_eff: Of[float, "effective sample size of the residuals"]
    inflation: Of[float, "samples per independent sample, N / N_eff"]
    excited: Of[int, "base parameters that the motion excites", 0]
    weakest_direction: Of[Any, "weakest over strongest excited direction", None]
    boundary: Of[bool, "whether a link is close to a plate or a rod"]
    links: Of[tuple[LinkUncertainty, ...], "one table per moving link, (L,)"]
    pi_sigma: Of[Numbers, "standard deviations of π, (10 L,) or empty [SI]", ()]
    posterior_over_prior: Of[Numbers, "posterior over prior variance of π, (10 L,) or empty", ()]
    beta_sigma: Of[Numbers, "standard deviations of β, (n_b,) or empty [SI]", ()]
    beta_verdicts: Of[Texts, "identified or prior-dominated, per entry of β, (n_b,) or empty", ()]
    noise: Of[Numbers, "residual RMS per joint, (n,); of a free base empty"]
    model_band: Of[Numbers, "σ of the model's torque, (n,); of a free base empty"]
    white_lag_share: Of[Numbers, "share of lags within the bounds of white noise, (n,); likewise"]
    detectable_gain_error: Of[Gaps, "gain error shown in 95 of 100 such logs, (n,) or empty", ()]
    gain_sigma: Of[float, "relative σ of the torque gains that all σ contain"] = 0.0


class FrictionPart(Part, frozen=True, omit_defaults=True):
    """Friction model."""

    columns: Of[Texts, "names of the columns, (k,)"]
    values: Of[Rows, "coefficients φ; a spring has one, in the first row, (n, k) [SI]"]
    coulomb_speed: Of[float, "ε, width of the smooth sign of dq [rad/s]"]
    stribeck_speed: Of[float | None, "v_s, width of the Stribeck peak [rad/s]"] = None
    dahl_stroke: Of[float | Numbers | None, "z_c, travel of a reversal, or per joint [rad]"] = None
    gear: Of[Rows, "gear matrix R of q_motor = R q, (n, n) or empty"] = ()
    sigma: Of[tuple[Gaps, ...] | None, "of φ; null where not determined, (n, k) [SI]"] = None
    interval_95: Of[Ends | None, "ends of the 95 % interval, null likewise, (n, k) of two"] = None
    net: Of[dict[str, Any] | None, "friction net: theta, scale"] = None


class ConvergencePart(Part, frozen=True):
    """Losses over the iterations."""

    iteration: Of[tuple[int, ...], "numbers of the iterations, (m,)"]
    training: Of[Gaps, "L on the training part, (m,)"]
    validation: Of[Gaps | None, "L on the validation part, (m,)", None]


class TrainedPart(Part, frozen=True):
    """Fit to the training part, whose errors, loss and gap are stated."""

    pi: Of[Numbers, "π of that fit, (10 L,) [kg, kg·m, kg·m²]"]
    friction_values: Of[Rows, "φ of that fit, (n, k)"]


class LeftOutPart(Part, frozen=True):
    """Torque errors on one log [%]."""

    name: Of[str, "name of the log"]
    before_overall: Of[float, "of the URDF"]
    after_overall: Of[float, "of the fit to all other logs"]
    log_offset_overall: Of[float, "of that fit with the offset of this log"]
    single_log_overall: Of[float, "of a fit to this log alone"]
    rms: Of[Numbers, "of the fit to all other logs, (r,) [N·m, N]"]


class RepeatabilityPart(Part, frozen=True):
    """Spread of the fits to single logs."""

    masses: Of[Rows, "mass of every link from each log alone, (logs, L) [kg]"]
    mass_spread: Of[Numbers, "standard deviation of these masses over the logs, (L,) [kg]"]
    beta_spread: Of[Numbers, "standard deviation of each base parameter over the logs, (n_b,)"]
    beta_sigma_expected: Of[Numbers, "the same by the covariances of the single fits, (n_b,)"]
    ratio: Of[float, "root mean square of spread over expected spread"]
    sentence: Of[str, "whether the logs agree within their noise"]


class SessionsPart(Part, frozen=True):
    """Comparison of several logs."""

    names: Of[Texts, "names of the logs, (logs,)"]
    payload_kg: Of[Numbers, "known payload of every log, (logs,) [kg]"]
    train_samples: Of[tuple[int, ...], "training rows of every log, (logs,) or empty", ()]
    offsets: Of[Rows | None, "torque offsets of every log, (logs, n)", None]
    delay_s: Of[tuple[Delay, ...] | None, "delay of every log, (logs,) [s]", None]
    leave_one_out: Of[tuple[LeftOutPart, ...], "errors of the fit to all other logs, (logs,)"]
    repeatability: Of[RepeatabilityPart, "spread of the fits to single logs"]


class ProvenancePart(Part, frozen=True):
    """How to compute the result again."""

    command: Of[str, "command line", ""]
    versions: Of[dict[str, str], "of what computed the result", {}]
    files: Of[dict[str, str], "SHA-256 of the raw files, by name", {}]
    model_hash: Of[str, "SHA-256 of the model", ""]
    seed: Of[int | None, "of mini-batches and nets", None]


class Coefficient(Part, frozen=True):
    """A value with its standard deviation; null where the data do not determine it."""

    value: Of[float | None, "in SI units"]
    sigma: Of[float | None, "standard deviation"]


class TotalMass(Part, frozen=True):
    """Mass of all links [kg]."""

    value: Of[float, "identified"]
    sigma: Of[float, "standard deviation"]
    interval: Of[tuple[float, float], "95 % interval"]
    urdf: Of[float, "of the URDF"]


class VerticalForcePart(Part, frozen=True):
    """Sum of the vertical forces of the contacts on the test part."""

    mean: Of[float, "of the measured sum [N]"]
    before_percent: Of[float, "RMS error of the URDF over the mean [%]"]
    after_percent: Of[float, "RMS error of the identified model over the mean [%]"]


class ResultRecord(Part, frozen=True, omit_defaults=True):
    """Content of result.json."""

    format: Of[int, "number of the format"]
    method: Of[str, "name of the method"]
    robot: Of[str, "name of the robot"]
    base: Of[str, "fixed, or free of a robot that walks", "fixed"]
    model: Of[ModelPart | None, "model that the parameters belong to", None]
    status: Of[str | None, "how the method ended, a sentence", ""]
    joints: Of[Texts, "names of the joints, (n,)"]
    units: Of[Texts, "unit of the torque of every joint, N*m or N, (n,)"]
    recording: Of[RecordingPart, "the data", {}]
    torque_source: Of[
        str, "measured, commanded (a control law) or current (times a gain)", "measured"
    ]
    control_law: Of[ControlLaw | None, "of a commanded torque; null for a measured one", None]
    current_gains: Of[tuple[CurrentGain, ...] | None, "of currents, where estimated, (n,)", None]
    delay_s: Of[Delay | tuple[Delay, ...] | None, "of the torque, one or per joint, (n,) [s]", None]
    symmetric: Of[tuple[MirroredPair, ...] | None, "mirrored pairs and quantities, or null", None]
    drive: Of[tuple[DrivePart, ...] | None, "where torque is commanded or delayed, (n,)", None]
    torque_error_percent: Of[ErrorPercent, "relative errors on the test part [%]"]
    torque_rms: Of[ErrorRms, "errors on the test part"]
    links: Of[tuple[LinkPart, ...], "one table per moving link, (L,)"]
    consistent: Of[bool, "whether every link is physically consistent"]
    gap_to_convex_optimum: Of[float | None, "(L − L*)/L*; null when not computed", None]
    uncertainty: Of[UncertaintyPart | None, "posterior of the parameters, where computed", None]
    loss: Of[float | None, "L on the training part", None]
    convex_optimum: Of[float | None, "L*, smallest loss of a consistent model", None]
    weights: Of[Numbers, "diagonal of W in the loss, (e,) or empty: e = n, or 1 of energy", ()]
    friction: Of[FrictionPart | None, "friction model; null without one", None]
    convergence: Of[ConvergencePart | None, "losses over iterations; null for closed forms", None]
    iterations: Of[int | None, "of the method", None]
    seconds: Of[float | None, "time of the method alone [s]", None]
    warnings: Of[Texts, "notes on the limits of the result, sentences", ()]
    pi: Of[Numbers, "standard parameters π: m, m·c, I per link [kg, kg·m, kg·m²]", ()]
    lam: Of[Numbers | None, "λ of π, as long; null where π is not consistent", None]
    beta: Of[Numbers, "base parameters β = K π, (n_b,) or empty [SI]", ()]
    condition_number: Of[float | None, "of the normalised regressor; null when singular", None]
    trained: Of[TrainedPart | None, "fit to the training part; null where π is that fit", None]
    sessions: Of[SessionsPart | None, "comparison of several logs; null for one", None]
    provenance: Of[ProvenancePart, "how to compute the result again", {}]
    doubts: Of[Texts, "reasons not to use the result as it is, the strongest first"] = ()
    rows: Of[str, "free base: rows that were fitted, base, joints or all"] = ""
    error_rows: Of[Texts, "rows whose errors are stated, if not the joints, (r,) or empty"] = ()
    error_units: Of[Texts, "their units, (r,) or empty"] = ()
    total_mass: Of[TotalMass | None, "free base: mass of the robot"] = None
    vertical_force: Of[VerticalForcePart | None, "free base, where it was measured"] = None
    sensors: Of[dict[str, Coefficient] | None, "free base: offset [N] by link, γ, crosstalk"] = None

    @property
    def rows_of_errors(self) -> tuple[Texts, Texts]:
        """Names of the rows whose errors are stated, and their units."""
        return (self.error_rows or self.joints, self.error_units or self.units)

    @property
    def is_free(self) -> bool:
        """Whether the base of the robot is free, as that of one that walks."""
        return self.base == "free"

    @property
    def delays(self) -> tuple[Delay, ...]:
        """Delays of the torque, one for the log or one per joint; none where not estimated."""
        return (self.delay_s,) if isinstance(self.delay_s, Delay) else self.delay_s or ()


def error_parts(
    before: TorqueError, after: TorqueError, with_friction: TorqueError | None = None
) -> tuple[ErrorPercent, ErrorRms]:
    """Errors of two models, and of the first with friction: [%], null if not finite; RMS."""
    three = {"before": before, "after": after, "urdf_friction": with_friction}
    errors = {name: each for name, each in three.items() if each is not None}
    overall: dict[str, Any] = {f"{name}_overall": each.overall for name, each in errors.items()}
    percent = {name: plain(each.percent) for name, each in errors.items()} | overall
    return ErrorPercent(**percent), ErrorRms(**{n: plain(e.rms) for n, e in errors.items()})


def link_parts(lib: Library, pi: Array) -> tuple[LinkPart, ...]:
    """Masses and centres of mass before and after, and consistency."""
    now, then = links(pi), links(lib.pi0)
    return LinkPart.from_columns(
        name=lib.link_names,
        mass=mass(now),
        mass_before=mass(then),
        com=centre_of_mass(now),
        com_before=centre_of_mass(then),
        min_relative_eigenvalue=lib.relative_eigenvalues(pi),
    )


def uncertainty_part(
    lib: Library, pi: Array, root: Array, share: Array, verdicts: Sequence[str], **facts: Any
) -> UncertaintyPart:
    """Posterior of π by a root of its covariance, (10 L, ·), with further facts."""
    sigma = np.linalg.norm(root, axis=1)
    return UncertaintyPart.with_gaps(
        boundary=bool(np.abs(lib.relative_eigenvalues(pi)).min() < BOUNDARY),
        links=LinkUncertainty.from_columns(
            mass_sigma=sigma[::N_PARAMETERS],
            com_sigma=[None if each is None else plain(each) for each in com_sigma(root, pi)],
            verdicts=[*zip(*[iter(verdicts)] * N_PARAMETERS, strict=True)],
        ),
        pi_sigma=plain(sigma),
        posterior_over_prior=plain(share),
        beta_sigma=plain(np.linalg.norm(lib.base_matrix @ root, axis=1)),
        **facts,
    )


def friction_part(
    terms: Friction, phi: Array, sigma: Array | None, **facts: Any
) -> FrictionPart | None:
    """Columns, coefficients φ (n, k), σ, intervals and other facts; None where none was fitted."""
    if not phi.size:
        return None
    interval = None  # ends, where they are finite
    if sigma is not None:
        half = NORMAL_95 * sigma
        ends = plain(np.stack([phi - half, phi + half], axis=2))
        interval = tuple(tuple(None if None in pair else pair for pair in row) for row in ends)
    widths = {key: width_of(getattr(terms, key)) for key in WIDTHS}
    usual = {"columns": terms.columns, "gear": terms.gear, "values": plain(phi)}
    spread = {"sigma": plain(sigma), "interval_95": interval}
    return FrictionPart(**usual | widths | spread | facts)


def plain(values: Any) -> Any:
    """A number or array as numbers and tuples, None where it is not finite."""
    if isinstance(values, np.ndarray | tuple | list):
        return tuple(map(plain, values))
    return None if values is None or not np.isfinite(values) else float(values)
