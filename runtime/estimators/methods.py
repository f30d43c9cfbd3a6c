"""Every estimator by its name, and what a problem must offer before one is run."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from runtime.errors import IdentificationError, NeedsError
from runtime.estimators.problem import ERROR_OF, Fit, Learned, Origin, Problem
from runtime.library import Library
from runtime.recording.settings import COLUMNS
from runtime.registry import Registry

DEFAULT = "map"  # the method where neither a name nor a preset is given


@dataclass(frozen=True, slots=True, eq=False)
class Method:
    """One estimator."""

    name: str  # word by which a user selects it
    sentence: str  # what it is, for `--help`, tables and reports
    # solves a `Problem`. It gets the keyword `preset` where `takes_preset` and the keyword `prior`,
    # a `PriorFile` or None, where `takes_prior`
    fit: Callable[..., Fit]
    label: str = ""  # heading of its column in tables; the name in capitals where empty
    # compressed statistics are all that it needs of the samples. It then takes streamed logs,
    # several logs, and rows without accelerations
    from_statistics: bool = False
    bounds_friction: bool = False  # its viscous, Coulomb and rotor coefficients are ≥ 0
    every_joint: bool = False  # needs an equation per joint, not the power of all joints
    uses_validation: bool = False  # stops or chooses by the validation part, not trained on
    takes_log: bool = False  # gets the keyword `log`, the `Origin` of the samples or None
    # name of an input that only this method needs → reader of its file
    files: Mapping[str, Callable[[Path, Library], Any]] = field(default_factory=dict)
    unfiltered: bool = False  # works on the unfiltered recording, so that no low-pass is missed
    columns: tuple[str, ...] | None = None  # friction columns that it can use; None for any
    default_columns: tuple[str, ...] = ()  # friction columns that it is given where none are named
    objective: str = ""  # what it minimises instead of the weighted loss L; empty for L
    when_recommended: str = ""  # half a sentence that follows where a comparison recommends it
    takes_preset: bool = False  # has settings to choose from
    takes_prior: bool = False  # uses a file of inertial priors
    # returns the most probable model under the inertial prior, so that the posterior is centred at
    # its answer
    is_most_probable: bool = False
    # whether a preset (a name, settings or None) draws samples one by one; None where no preset
    # does
    in_batches: Callable[[Any], bool] | None = None
    learned: Callable[[Any], Learned] | None = None  # reads learned friction beyond φ from `facts`

    @property
    def heading(self) -> str:
        """Heading of its column in tables."""
        return self.label or self.name.upper()

    def needs_samples(self, preset: Any = None) -> bool:
        """Whether it needs the samples one by one, with a preset or without."""
        if not self.from_statistics:
            return True
        return self.in_batches is not None and self.in_batches(preset)


METHODS: Registry[Method] = Registry(
    "symgen.estimators",
    Method,
    "method",
    {
        "map": "runtime.estimators.convex.map_estimate:MAP",
        "adam": "runtime.estimators.descent.fit:ADAM",
        "lm": "runtime.estimators.descent.fit:LEVENBERG_MARQUARDT",
        "log-cholesky": "runtime.estimators.descent.fit:LOG_CHOLESKY",
        "pc-ols": "runtime.estimators.classical.pc_ols:PC_OLS",
        "ols": "runtime.estimators.classical.least_squares:OLS",
        "wls": "runtime.estimators.classical.least_squares:WLS",
        "iv": "runtime.estimators.literature.iv_didim:IV",
        "didim": "runtime.estimators.literature.iv_didim:DIDIM",
        "ekf": "runtime.estimators.literature.kalman:EKF",
        "ukf": "runtime.estimators.literature.kalman:UKF",
        "nn": "runtime.estimators.literature.neural:NEURAL",
    },
)


def require_method(name: str) -> Method:
    """The record of a method."""
    if name not in METHODS:
        raise IdentificationError(
            f"there is no method '{name}'; choose one of {', '.join(METHODS)}"
        )
    return METHODS[name]


def methods_from_statistics() -> tuple[str, ...]:
    """Names of the methods that need no more of the samples than compressed statistics."""
    return tuple(m.name for m in METHODS.records() if m.from_statistics)


def chosen_method(method: str | None, preset: Any, prior: Any) -> str:
    """The method that is named, or the one that the other options belong to."""
    if method is None:
        method = DEFAULT if preset is None else _those("takes_preset")[0]
    record = require_method(method)
    if preset is not None and not record.takes_preset:
        raise IdentificationError(
            f"a preset belongs to the method {' or '.join(_those('takes_preset'))}, "
            f"the method is '{method}'; leave one out"
        )
    if prior is not None and not record.takes_prior:
        raise IdentificationError(
            f"a prior is used by the method {' or '.join(_those('takes_prior'))} only, "
            f"the method is '{method}'; leave one out"
        )
    return method


def fit_by(
    problem: Problem, method: str, preset: Any = None, prior: Any = None, log: Origin | None = None
) -> Fit:
    """Solve a problem by one of `METHODS`."""
    record = require_method(method)
    _require_rows(problem, record, preset)
    _require_columns(problem, record)
    options: dict[str, Any] = {"preset": preset} if record.takes_preset else {}
    if record.takes_prior:
        options["prior"] = prior
    if record.takes_log:
        options["log"] = log
    return record.fit(problem, **options)


def _those(flag: str) -> list[str]:
    return [m.name for m in METHODS.records() if getattr(m, flag)]


def _require_rows(problem: Problem, record: Method, preset: Any) -> None:
    """Refuse rows without accelerations where τ(q, dq, ddq) itself is evaluated."""
    if problem.train.base is None:
        return
    joints = record.every_joint and problem.train.equations == 1 < problem.lib.n_joints
    if not (record.needs_samples(preset) or joints):
        return
    batches = record.from_statistics and not joints
    what = f"{record.name} with mini-batches" if batches else record.name
    raise NeedsError(
        f"{what} needs {'rows of every joint' if joints else 'accelerations'}, which "
        "the regressor of the log has not; use --settings regressor=acceleration, or one of "
        f"{', '.join(methods_from_statistics())}"
    )


def _require_columns(problem: Problem, record: Method) -> None:
    """Refuse friction columns that the method cannot use."""
    names = [name for name in problem.friction_names if name in COLUMNS]
    of_prior = [name for name in names if COLUMNS[name].needs_prior]
    if of_prior and not record.is_most_probable:
        able = ", ".join(_those("is_most_probable"))
        raise NeedsError(
            f"the scale of the friction column {', '.join(of_prior)} comes from an inertial prior, "
            f"which the method {record.name} has not; use {able}, or leave the column out"
        )
    errors = [name for name in problem.friction_names if name.startswith(ERROR_OF)]
    if errors and not record.is_most_probable:
        raise NeedsError(
            "the log states standard deviations of errors of its contact sensors, which are a "
            f"prior, and the method {record.name} takes none; use map, or leave "
            "contact_force_z_sigma, contact_force_z_sharing and contact_force_z_crosstalk out"
        )
    if record.columns is None:
        return
    unusable = sorted(set(problem.friction_names) - set(record.columns))
    if unusable:
        raise NeedsError(
            f"the method {record.name} uses the friction columns {', '.join(record.columns)}, not "
            f"{', '.join(unusable)}; leave them out"
        )
