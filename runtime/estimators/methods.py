"""Every method by its name: what it is, and what solves a problem by it."""

from runtime.errors import IdentificationError, NeedsError
from runtime.estimators.classical import BASELINES
from runtime.estimators.convex import CAD
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.descent.drivers import Preset
from runtime.estimators.descent.fit import PRESETS, fit_adam, fit_levenberg, in_batches
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.samples import FROM_STATISTICS

METHODS: dict[str, str] = {
    "map": "most probable consistent model given the URDF as a prior, one convex problem (default)",
    "adam": "gradient descent in λ, consistent by construction (document Sec. 4)",
    "lm": "Levenberg-Marquardt in λ on the compressed data, consistent by construction",
    "log-cholesky": "Levenberg-Marquardt in log-Cholesky coordinates, consistent by construction",
    "pc-ols": "convex program with linear matrix inequalities: the optimum (Eq. 3.8)",
    "ols": "ordinary least squares on base parameters, not always consistent (Eq. 3.7)",
    "wls": "least squares with every joint weighted by its residual, four passes",
    "iv": "instrumental variables from a simulation of the closed loop; needs the loop",
    "didim": "measured torque against the simulated closed loop; needs the loop",
    "ekf": "extended Kalman filter over q, dq, pi and friction, on the unfiltered recording",
    "ukf": "unscented Kalman filter over q, dq, beta and friction, on the unfiltered recording",
    "nn": "consistent, with a small net per joint for what linear friction leaves over",
}


def require_method(method: str) -> None:
    """Refuse a name that is none.

    Raises:
        IdentificationError: there is no such method.
    """
    if method not in METHODS:
        raise IdentificationError(
            f"there is no method '{method}'; choose one of {', '.join(METHODS)}"
        )


def chosen_method(method: str | None, preset: str | Preset | None, prior: PriorFile | None) -> str:
    """The method asked for, or that which the other options ask for.

    Raises:
        IdentificationError: there is none such, or the options belong to another.
    """
    method = method or ("map" if preset is None else "adam")
    require_method(method)
    if preset is not None and method != "adam":
        raise IdentificationError(
            f"a preset belongs to the method adam, the method is '{method}'; leave one out"
        )
    if prior is not None and method != "map":
        raise IdentificationError(
            f"a prior is known to the method map only, the method is '{method}'; leave one out"
        )
    return method


def _require_rows(problem: Problem, method: str, preset: str | Preset | None) -> None:
    """Refuse rows without accelerations where a method evaluates τ(q, dq, ddq) itself.

    Raises:
        NeedsError: it does, or power is all it is given and it needs joints.
    """
    if problem.train.base is None:
        return
    batches = method == "adam" and in_batches(preset)
    joints = method == "wls" and problem.train.equations < problem.lib.n_joints
    if method not in FROM_STATISTICS or batches or joints:
        what = "adam with mini-batches" if batches else method
        raise NeedsError(
            f"{what} needs " + ("rows of every joint" if joints else "accelerations") + ", which "
            "the regressor of the log has not; use --regressor acceleration, or one of "
            f"{', '.join(FROM_STATISTICS)}"
        )


def fit_by(
    problem: Problem,
    method: str,
    preset: str | Preset | None = None,
    prior: PriorFile | None = None,
) -> Fit:
    """The answer of one of `METHODS`; the preset is that of "adam", the prior that of "map".

    Raises:
        IdentificationError: the method or the preset is unknown, or the method failed.
    """
    require_method(method)
    _require_rows(problem, method, preset)
    if method in BASELINES:
        return BASELINES[method](problem)
    if method == "map":
        kappa = prior.kappa if prior and prior.kappa else CAD
        return fit_map(problem, kappa, prior.constraints if prior else None)
    if method in {"lm", "log-cholesky"}:
        return fit_levenberg(problem, cholesky=method == "log-cholesky")
    preset = preset or "full"
    if isinstance(preset, str):
        if preset not in PRESETS:
            raise IdentificationError(
                f"there is no preset '{preset}'; choose one of {', '.join(PRESETS)}"
            )
        preset = PRESETS[preset]
    return fit_adam(problem, preset)
