"""Settings of `symgen identify`."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from runtime.cli.common import numbers_option
from runtime.cli.log_options import FitChoices, inputs_of, prior_of, split_of
from runtime.common.settings import data_field, method_field, model_field, output_field
from runtime.common.terminal import completing
from runtime.errors import IdentificationError
from runtime.estimators.descent.fit import PRESETS
from runtime.estimators.methods import METHODS, chosen_method
from runtime.estimators.prior_file import KnownFriction
from runtime.identification.problem_setup import settings_for
from runtime.identification.settings import NAMES, Settings
from runtime.library import Library
from runtime.recording import Recording, read_recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.recipes.recipe_file import load_recipe


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifySettings(FitChoices):
    """Settings of `symgen identify`."""

    options = "robot recipe run method friction cutoff delay prior split out overwrite"
    method: str | None = method_field(
        metavar="NAME",
        autocompletion=completing(METHODS),
        help=f"Estimator: {', '.join(METHODS)}; default map, with the setting preset adam.",
    )
    preset: str | None = method_field(
        metavar="|".join(PRESETS),
        autocompletion=completing(PRESETS),
        help="Settings of the method adam: simulation and real are Tables 5.1 and 5.8 of the "
        "document, full uses all samples in every step; default full.",
    )
    prior: Path | None = model_field(
        metavar="FILE",
        help="Inertial prior as TOML: uncertainty of the URDF, known masses, centres of mass "
        "and symmetries.",
    )
    delay: str | None = model_field(
        metavar="S|auto|per-joint",
        help="Delay of the torque, s: of a commanded torque behind its stamp, of a measured "
        "one behind the motion; auto estimates it with its uncertainty, per-joint one for each "
        "joint; default torque_delay_s of the recipe, else none.",
    )
    encoder_bias: bool | None = model_field(
        None,
        "--encoder-bias/--no-encoder-bias",
        help="Estimate the error of the zero of every encoder, rad or m; default where --delay "
        "estimates the delay of a commanded torque.",
    )
    symmetric: list[str] | None = data_field(
        metavar="LEFT:RIGHT",
        help="Compare armature and friction of mirrored joints, whose names differ in these "
        "parts, such as left:right or FL:FR; repeatable.",
    )
    tie: bool = model_field(
        False,
        "--tie",
        help="With the setting symmetric: the right link is the mirror image of the left one, "
        "and viscous friction and armature of both differ by a tenth; dry friction stays "
        "apart.",
    )
    preparation: str | None = method_field(
        metavar="FILE",
        help="Recipe whose table [preparation] states every step, for a log that has another "
        "recipe; cutoff, rate and regressor beside it have no place.",
    )
    validation: str | None = method_field(
        metavar="LOG", help="Another log for validation, given together with test."
    )
    test: str | None = method_field(
        metavar="LOG", help="Another log for the test, so that LOG is not split, of one log."
    )
    lam0: str | None = method_field(
        metavar="λ,λ,…",
        help="First guess of λ, ten numbers per link: ln m, centre of mass, logarithms and "
        "angles of the inertia as in result.json; default that of the URDF.",
    )
    friction_prior: Path | None = method_field(
        metavar="FILE",
        help="Inertial prior as TOML of which the friction alone counts, for map; default that "
        "of --prior.",
    )
    certify: bool = method_field(
        True, help="Compute the convex optimum and the uncertainty, which most other commands need."
    )
    robust: bool = method_field(
        False,
        "--robust",
        help="Huber weights on blocks of training rows, for map, pc-ols, ols and wls; the "
        "notes name the rows that count less.",
    )
    gain_sigma: float = model_field(
        0.02,
        help="Largest relative σ of the gain of every torque or current, that of the data "
        "sheet; intervals of parameters contain it, or a smaller one that the log shows.",
    )
    payload_of: list[str] | None = model_field(
        metavar="LOG=FILE",
        help="Known payload of one of several logs: the payload.json that the command payload "
        "wrote; repeatable.",
    )
    refit: bool = method_field(
        True,
        help="Fit the parameters again to all rows once the errors on the test part are "
        "known (methods without early stopping).",
    )
    save_statistics: bool = output_field(
        False,
        "--save-statistics",
        help="Write statistics.npz, the compressed log that fleet needs.",
    )
    report: bool = output_field(True, help="Write report.html; its figures cost most of a second.")
    out: Path | None = output_field(
        None, "--out", metavar="FOLDER", help="Folder of the result; default results/LOG-METHOD."
    )

    def fitted(self, lib: Library) -> Settings:
        """Settings of Python: the fields of the same names, of which some are files."""
        if self.save_statistics and not self.certify:
            raise IdentificationError(
                "save_statistics needs the uncertainty, which certify=false leaves out; "
                "leave out one of them"
            )
        same = {field.name for field in fields(self)} & set(NAMES)
        files: dict[str, Any] = {
            "prior": prior_of(self.prior, lib),
            "friction_prior": self._known_friction(lib),
            "symmetric": tuple(self.symmetric or ()),
            "split": split_of(self.split),
            "preparation": self.preparation and load_recipe(self.preparation).preparation,
            "validation": self._other(self.validation, lib),
            "test": self._other(self.test, lib),
        }
        if self.lam0 is not None:
            files["lam0"] = numbers_option(self.lam0, len(lib.lam0), "the setting lam0")
        settings = settings_for(lib, Settings(**{n: getattr(self, n) for n in same} | files))
        method = chosen_method(settings.method, settings.preset, settings.prior)
        inputs = inputs_of([method], lib, controller=self.controller)
        return replace(settings, inputs=inputs or None)

    def _known_friction(self, lib: Library) -> KnownFriction | None:
        prior = prior_of(self.friction_prior, lib)
        if prior is None:
            return None
        if prior.friction is None:
            raise IdentificationError(
                f"the setting friction_prior expects a prior with a table [friction], which "
                f"'{self.friction_prior}' lacks; give one such as fleet writes, or leave it out"
            )
        return prior.friction

    def _other(self, log: str | None, lib: Library) -> Recording | None:
        """A log beside the first, read by the same recipe."""
        if log is None:
            return None
        return independent_joints(read_recording(log, self.recipe, None, lib.joint_names), lib)
