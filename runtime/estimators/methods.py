"""Every estimator by its name, and what a problem must offer before one is run."""

from typing import Any

from runtime.errors import IdentificationError, NeedsError
from runtime.estimators.method import Method
from runtime.estimators.problem import Fit, Origin, Problem
from runtime.registry import Registry

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
        "ols": "runtime.estimators.classical.ols:OLS",
        "wls": "runtime.estimators.classical.wls:WLS",
        "iv": "runtime.estimators.literature.iv_didim:IV",
        "didim": "runtime.estimators.literature.iv_didim:DIDIM",
        "ekf": "runtime.estimators.literature.kalman:EKF",
        "ukf": "runtime.estimators.literature.kalman:UKF",
        "nn": "runtime.estimators.literature.neural:NEURAL",
    },
)
DEFAULT = "map"
"""The method where neither a name nor a preset is given."""


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
    problem: Problem,
    method: str,
    preset: Any = None,
    prior: Any = None,
    log: Origin | None = None,
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
    """Names of the methods that have a flag, in order."""
    return [m.name for m in METHODS.records() if getattr(m, flag)]


def _require_rows(problem: Problem, record: Method, preset: Any) -> None:
    """Refuse rows without accelerations where τ(q, dq, ddq) itself is evaluated."""
    if problem.train.base is None:
        return
    joints = record.every_joint and problem.train.equations < problem.lib.n_joints
    if not (record.needs_samples(preset) or joints):
        return
    batches = record.from_statistics and not joints
    what = f"{record.name} with mini-batches" if batches else record.name
    raise NeedsError(
        f"{what} needs {'rows of every joint' if joints else 'accelerations'}, which "
        "the regressor of the log has not; use --regressor acceleration, or one of "
        f"{', '.join(methods_from_statistics())}"
    )


def _require_columns(problem: Problem, record: Method) -> None:
    """Refuse friction columns that the method cannot use."""
    if record.columns is None:
        return
    unusable = sorted(set(problem.friction_names) - set(record.columns))
    if unusable:
        raise NeedsError(
            f"the method {record.name} uses the friction columns {', '.join(record.columns)}, not "
            f"{', '.join(unusable)}; leave them out"
        )
