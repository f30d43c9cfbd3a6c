"""Settings of an identification: method, preparation, friction, split, prior, first guess.

One frozen `Settings` serves a single log, several logs, a streamed log and a comparison of methods.
Each of them refuses the fields that it cannot use.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from numpy.typing import ArrayLike

from runtime.errors import IdentificationError
from runtime.estimators.descent.adam import Preset
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import FrictionPrior
from runtime.recording import Friction, Preparation, Recording, Split, StreamedRecording


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Settings:
    """Settings of an identification.

    Attributes:
        method: one of `METHODS`; None is "map", or "adam" where a preset is given.
        preset: settings of "adam", a name of `PRESETS` or a `Preset`; None is "full".
        prior: inertial prior beyond the URDF, for "map".
        preparation: steps from the log to the rows of the fit; None is the recipe's, and without
            a recipe only missing derivatives are computed.
        splitting: shares of the recording for training, validation and test; None is the
            recipe's, and without a recipe 48 %, 12 % and 40 %.
        friction_columns: friction model; None is the recipe's, and without a recipe no friction,
            which a note of the result states. `runtime.choose_default_friction` returns the
            choice of the command.
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
        friction_prior: prior of the friction coefficients, for "map".
    """

    method: str | None = None
    preset: "str | Preset | None" = None
    prior: PriorFile | None = None
    preparation: Preparation | None = None
    splitting: Split | None = None
    friction_columns: Friction | None = None
    validation: Recording | None = None
    test: Recording | None = None
    lam0: ArrayLike | None = None
    inputs: Mapping[str, Any] | None = None
    seed: int = 0
    certify: bool = True
    refit: bool = False
    robust: bool = False
    friction_prior: FrictionPrior | None = None

    def require_default(self, names: tuple[str, ...], task: str) -> None:
        """Refuse fields that a task cannot use.

        Args:
            names: fields that must keep their default.
            task: the task as the subject of the message, such as "a streamed log".

        Raises:
            IdentificationError: one of the fields has been set.
        """
        default = Settings()
        given = [name for name in names if getattr(self, name) is not getattr(default, name)]
        if given:
            raise IdentificationError(
                f"{task} takes no {', '.join(given)}; leave {'it' if len(given) == 1 else 'them'} "
                "out of the settings"
            )


NAMES = tuple(each.name for each in fields(Settings))


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


def shares_of(recording: Recording | StreamedRecording, settings: Settings) -> Split:
    """Fractions of the parts: of the settings, else of the recipe, else the default."""
    recipe = recording.recipe
    return settings.splitting or (recipe.split if recipe else None) or Split()
