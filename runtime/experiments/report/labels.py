"""Display names and rounded numbers of the experiments."""

import math

from runtime.estimators.methods import METHODS
from runtime.experiments.report.reading import Experiment, Value

DOCUMENT = "document"
NOTHING = "–"
_VARIANTS = {
    "adam-frozen": "λ-Adam, link 7 frozen",
    "adam-zero": "λ-Adam, threshold 0",
    "adam-friction": "λ-Adam + friction",
    "pc-ols-friction": "PC-IDIM-OLS + friction",
    "map-friction": "MAP + friction",
    "map-dahl": "MAP + Dahl",
    "fixed-arm": "payload alone",
}
"""Methods of studies that are variants of an estimator."""
BEST = ("map-friction", "map", "lm")
"""Method of this package that is compared with the document: the first one that a study has.

Without noise it is lm, which starts from MAP.
"""
_OURS = {"search", "check", "pi", "lam", "beta"}
"""Entries that are not estimators: one computed number each."""
_METRICS = {
    "airm": "AIRM",
    "frobenius": "Frobenius norm",
    "frobenius_rms": "Frobenius norm / n",
    "base_error": "base parameters, error %",
    "smallest_eigenvalue": "smallest relative eigenvalue of P, before repair",
    "strict": "P ≻ 0 before repair",
    "iterations": "iterations",
    "time_s": "time [s]",
    "consistent": "physical consistency",
    "tau_error": "torque error, all joints [%]",
    "cost_before": "log cond before",
    "cost_after": "log cond after",
    "condition_before": "condition number before",
    "condition_after": "condition number after",
    "gap": "gap to the convex optimum",
    "mass_error_g": "error of the mass [g]",
    "com_error_mm": "error of the centre of mass [mm]",
    "difference": "largest difference [N·m]",
    "slope": "slope",
}
_SERIES = {
    "tau_idm": "inverse dynamics",
    "tau_regressor": "regressor Y π",
    "tau_5_full": "full regressor Y π",
    "tau_5_base": "base regressor Y_b β",
    "remainder": "|R(ε)|",
    "slope_two": "slope two",
}
AIRM, SHARES = "airm", ("consistent", "strict")


def method_name(method: str) -> str:
    """Display name of a method."""
    if method in METHODS:
        return METHODS[method].heading
    if method in _VARIANTS or method in _OURS:
        return _VARIANTS.get(method, "ours")
    return method.upper() if len(method) <= 5 and method != "before" else method


def metric_name(metric: str) -> str:
    """Display name of a metric, with its unit."""
    kind, _, joint = metric.rpartition("_")
    if kind in {"tau_error", "tau_rms"} and joint.isdigit():
        return f"joint {joint} [{'%' if kind == 'tau_error' else 'N·m'}]"
    return _METRICS.get(metric, metric.replace("omega_", "ω").replace("b_", "b "))


def curve_name(name: str) -> str:
    """Display name of a series; that of CASE/METHOD/… is its method."""
    parts = name.split("/")
    return method_name(parts[1]) if len(parts) > 1 else _SERIES.get(name, name)


def case_name(case: str) -> str:
    """Display name of a case."""
    return case.replace("sigma=", "σ = ").replace("p=", "p = ")


def printed(value: Value | None, metric: str) -> str:
    """Number of the document with its published digits."""
    if value is None:
        return NOTHING
    if metric in SHARES:
        return _share(value.mean)
    mean = _as_given(value.mean)
    text = mean if value.std is None else f"{mean} ± {_as_given(value.std)}"
    return f"{text} (corrected, printed {value.misprint})" if value.misprint else text


def measured(value: Value | None, metric: str, spread: str = "std") -> str:
    """Computed mean to three digits and standard deviation to the same decimal."""
    if value is None:
        return NOTHING
    if spread == "quartiles" and value.quartiles:
        return _quartiles(value, metric)
    if metric in SHARES:
        return _share(value.mean)
    if not math.isfinite(value.mean):
        return NOTHING
    return f"{value.mean:.5g}" if value.std is None else _deviating(value.mean, value.std)


def _quartiles(value: Value, metric: str) -> str:
    """Median and quartiles."""
    low, middle, high = (_share(x) if metric in SHARES else f"{x:.3g}" for x in value.quartiles)
    return f"{middle} [{low} to {high}]"


def _deviating(mean: float, std: float) -> str:
    """Mean to three digits ± standard deviation."""
    size = abs(mean)
    if size and not 1e-3 <= size < 1e5:
        return f"{mean:.1e} ± {std:.0e}"
    digits = 4 if not size else max(0, 2 - math.floor(math.log10(size)))
    return f"{mean:.{digits}f} ± {std:.{digits}f}"


def _share(value: float) -> str:
    return f"{100 * value:.3g}\N{NO-BREAK SPACE}%"


def _as_given(value: float) -> str:
    return repr(value)


def short_hash(experiment: Experiment) -> str:
    """First 12 digits of the config hash."""
    return experiment.config_hash[:12]


def best_method(experiment: Experiment) -> str:
    """First of `BEST` that a study has; "" where it has none."""
    return next((name for name in BEST if name in experiment.methods), "")
