"""Settings of an identification, and what a caller sees of it while it runs.

One frozen `Settings` is the keywords of `identify` and the options of the command, for a single
log, several logs, a streamed log and a comparison of methods; each refuses what it cannot use.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypedDict

from numpy.typing import ArrayLike

from runtime.errors import IdentificationError
from runtime.estimators.choice.friction_choice import FrictionChoice
from runtime.estimators.choice.regressor_choice import CutoffChoice
from runtime.estimators.convex.entropic_prior import CAD
from runtime.estimators.descent.fit import Preset
from runtime.estimators.methods import METHODS, Method, chosen_method
from runtime.estimators.prior_file import KnownFriction, PriorFile
from runtime.estimators.problem import FrictionPrior
from runtime.library import Array
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction.model import DRIVE
from runtime.recording.recipes.recipe import COMMANDED
from runtime.recording.streamed import StreamedRecording

AUTO = "auto"  # word for a friction model, cut-off, regressor or delay that is chosen from the log
PER_JOINT = "per-joint"  # word for one delay per joint
NO_FRICTION = "none"  # word for a fit of the inertia only
OF_PREPARATION = ("cutoff", "rate", "regressor")  # fields in place of single steps of a preparation


GAIN_SIGMA = 0.02  # relative standard deviation of torque gains where no data sheet states it


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Settings:
    """Settings of an identification.

    Attributes:
        method: one of `METHODS`; None is "map", or "adam" where a preset is given.
        preset: settings of "adam", a name of `PRESETS` or a `Preset`; None is "full".
        prior: inertial prior beyond the URDF, for "map".
        friction: friction model: a `Friction`, names of columns (with commas, or a sequence),
            "none" or () for a fit of the inertia only, "auto" for a choice among all models by
            cross-validation, "auto,rotor" with a column in every candidate. None is the recipe's,
            and without one the choice among offset, viscous, Coulomb or Dahl, and rotor columns.
        coulomb_speed: width of the smooth Coulomb sign [rad/s, m/s]; None is the recipe's, else
            that of the choice.
        preparation: all steps from the log to the rows of the fit, which are then taken as they
            are; None is the recipe's with the next three fields in place, and without a recipe only
            missing derivatives are computed.
        cutoff: cut-off of the low-pass [Hz], or "auto" for a choice by cross-validation; None is
            that of the recipe, or a choice where a log without a filter has noisy accelerations.
        rate: rate of the rows to which the log is decimated [Hz].
        regressor: form of the equations, one of `REGRESSORS`, or "auto" for momentum where the
            differentiation of the log fails.
        delay: delay of the torque [s], "auto" to estimate it, "per-joint" for one per joint.
        encoder_bias: whether the zero of every encoder is estimated; None where the delay of a
            commanded torque is.
        symmetric: parts "LEFT:RIGHT" of the names of mirrored joints, whose drives are compared.
        tie: whether mirrored links and drives are tied, too.
        split: shares of the recording for training, validation and test; None is the recipe's, and
            without a recipe 48 %, 12 % and 40 %.
        validation: separate recording for validation, prepared like the first; None splits.
        test: separate recording for the test; given together with `validation` or not at all.
        lam0: first guess λ, (10 n,) [ln kg, m ×3, rad ×3, kg^½·m ×3]; None is that of the URDF.
        inputs: what single methods need beyond the log, by name, such as the closed loop
            "controller" of "iv" and "didim".
        seed: of the mini-batches of "adam" and the initial weights of "nn".
        certify: False skips the convex optimum and the uncertainty, for thousands of trials; the
            gap is then NaN.
        refit: after the fit to the training part, whose errors are reported, fit again to all rows
            of the recording. Parameters and uncertainty are those of the second fit. Without
            effect where a separate test recording is given, and for methods that stop by the
            validation part or simulate the robot.
        robust: Huber weights on blocks of training rows, for the methods that train on all rows
            of joints; the notes of the result name the rows that count less.
        friction_prior: prior of the friction coefficients, for "map", in place of that in `prior`.
        gain_sigma: largest relative standard deviation of the gain of every torque sensor or
            current, that of its data sheet; intervals of parameters contain it, or a smaller one
            that the log shows. A model that predicts readings of the same sensors does not need it.
        rows: equations of a robot with a free base, "base", "joints" or "all"; None is all, and
            base for a log without torques.
    """

    method: str | None = None
    preset: "str | Preset | None" = None
    prior: PriorFile | None = None
    friction: Friction | str | Sequence[str] | None = None
    coulomb_speed: float | None = None
    preparation: Preparation | None = None
    cutoff: float | str | None = None
    rate: float | None = None
    regressor: str | None = None
    delay: float | str | None = None
    encoder_bias: bool | None = None
    symmetric: Sequence[str] = ()
    tie: bool = False
    split: Split | None = None
    validation: Recording | None = None
    test: Recording | None = None
    lam0: ArrayLike | None = None
    inputs: Mapping[str, Any] | None = None
    seed: int = 0
    certify: bool = True
    refit: bool = True
    robust: bool = False
    friction_prior: FrictionPrior | KnownFriction | None = None
    gain_sigma: float = GAIN_SIGMA
    rows: str | None = None

    def __post_init__(self) -> None:
        cutoff_of(self.cutoff)  # refused here, before a log is read
        if not 0 <= self.gain_sigma < 1:
            raise IdentificationError(
                "gain_sigma needs the relative standard deviation of the torque gains, 0.02 for 2 "
                f"%, got {self.gain_sigma:g}"
            )
        beside = [name for name in OF_PREPARATION if getattr(self, name) is not None]
        if self.preparation is not None and beside:
            raise IdentificationError(
                f"a preparation states every step, so {', '.join(beside)} beside it would have no "
                "effect; put it into the preparation, or leave the preparation out"
            )

    @property
    def estimator(self) -> Method:
        """The method that is named, or the one that the other settings belong to."""
        return METHODS[chosen_method(self.method, self.preset, self.prior)]

    @property
    def kappa(self) -> float:
        """Trust κ in the inertial prior."""
        return self.prior.kappa if self.prior and self.prior.kappa else CAD

    @property
    def centre(self) -> Array | None:
        """π0 of the type of robot, (10 n,); None for that of the URDF."""
        return None if self.prior is None else self.prior.centre


def require_default(settings: Settings, names: Sequence[str], task: str) -> None:
    """Refuse fields that a task cannot use; the task is the subject of the message."""
    default = Settings()
    stated = {name: (getattr(settings, name), getattr(default, name)) for name in names}
    given = [
        name
        for name, (value, usual) in stated.items()
        if value is not usual and not (isinstance(value, float) and value == usual)
    ]
    if given:
        raise IdentificationError(
            f"{task} takes no {', '.join(given)}; leave {'it' if len(given) == 1 else 'them'} "
            "out of the settings"
        )


def cutoff_of(stated: float | str | None) -> float | None:
    """Cut-off [Hz]; None where none is stated or it is chosen from the log."""
    if stated is None or stated == AUTO:
        return None
    try:
        return float(stated)
    except ValueError:
        raise IdentificationError(
            f"--cutoff needs a frequency in Hz or auto, got '{stated}'"
        ) from None


class SettingKeywords(TypedDict, total=False):
    """Fields of `Settings` as keywords."""

    method: str | None
    preset: "str | Preset | None"
    prior: PriorFile | None
    friction: Friction | str | Sequence[str] | None
    coulomb_speed: float | None
    preparation: Preparation | None
    cutoff: float | str | None
    rate: float | None
    regressor: str | None
    delay: float | str | None
    encoder_bias: bool | None
    symmetric: Sequence[str]
    tie: bool
    split: Split | None
    validation: Recording | None
    test: Recording | None
    lam0: ArrayLike | None
    inputs: Mapping[str, Any] | None
    seed: int
    certify: bool
    refit: bool
    robust: bool
    friction_prior: FrictionPrior | KnownFriction | None
    gain_sigma: float
    rows: str | None


NAMES = tuple(each.name for each in fields(Settings))
CHOSEN = ("cutoff", "rate", "regressor", "delay", "encoder_bias", "symmetric", "tie")
"""Fields that `identify` turns into a preparation or unknowns before a fit."""


def settings_from(settings: Settings | str | None, keywords: Mapping[str, Any]) -> Settings:
    """Settings with some fields replaced by keywords."""
    for name in keywords:
        if name not in NAMES:
            raise IdentificationError(
                f"expected settings of {', '.join(NAMES)}, got '{name}'; correct or leave out "
                f"'{name}'"
            )
    if settings is None or isinstance(settings, str):
        settings = Settings(method=settings)
    return replace(settings, **keywords)


def bare_settings(settings: Settings | str | None, keywords: Mapping[str, Any]) -> Settings:
    """Settings of a fit that chooses nothing; keywords alone fit the training part only."""
    if not isinstance(settings, Settings):
        keywords = {"refit": False, **keywords}
    chosen = settings_from(settings, keywords)
    require_default(chosen, CHOSEN, "a fit of prepared rows")
    return chosen


def default_terms(recording: Recording) -> Friction | None:
    """Friction terms of a log for which none are named: of its recipe, or of commanded drives."""
    terms = recording.recipe.friction if recording.recipe else None
    if terms is None and recording.torque_source == COMMANDED and recording.columns is None:
        return Friction(columns=DRIVE)
    return terms


def friction_of(recording: Recording, settings: Settings) -> Friction | None:
    """Friction model of the settings, else of the recipe, with the stated width; None for neither.

    The first column is "auto" where a model is to be chosen.
    """
    names, speed = settings.friction, settings.coulomb_speed
    if isinstance(names, Friction):
        return names if speed is None else replace(names, coulomb_speed=speed)
    default = default_terms(recording)
    if names is None and speed is None:
        return default
    known = (recording.recipe and recording.recipe.friction) or Friction(columns=())
    columns, width = (default or known).columns, known.coulomb_speed if speed is None else speed
    if names is not None:
        listed = tuple(names.split(",")) if isinstance(names, str) else tuple(names)
        columns = () if listed == (NO_FRICTION,) else listed
    return replace(known, columns=columns, coulomb_speed=width)


def terms_of(recording: Recording, settings: Settings) -> Friction:
    """Friction model of a fit: that of the settings, else of the recipe, else none."""
    return friction_of(recording, settings) or Friction(columns=())


def shares_of(recording: Recording | StreamedRecording, settings: Settings) -> Split:
    """Fractions of the parts: of the settings, else of the recipe, else the default."""
    recipe = recording.recipe
    return settings.split or (recipe.split if recipe else None) or Split()


def _unseen(_: Any) -> None:
    """Show nothing."""


@dataclass(frozen=True, slots=True)
class Progress:
    """What a caller is shown of an identification while it runs; by default nothing."""

    step: Callable[[str], None] = _unseen  # the present step, such as "choosing a cut-off"
    # the candidates of a choice with their errors, and the chosen one
    choice: Callable[[CutoffChoice | FrictionChoice], None] = _unseen
    iteration: Callable[[int, float], None] | None = None  # its number, and best validation loss


SILENT = Progress()


def progress_of(given: Callable[[int, float], None] | Progress | None) -> Progress:
    """The progress that a caller gives: all of it, or a callable for the iterations."""
    return given if isinstance(given, Progress) else Progress(iteration=given)
