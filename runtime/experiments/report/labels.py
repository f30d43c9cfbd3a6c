"""Display names, rounded numbers and tables of the experiments.

A table has a row per metric and a group of columns per case, document and computed values.
"""

import math
from collections.abc import Iterator

from runtime.common.tables import Table
from runtime.estimators.methods import METHODS
from runtime.experiments.report.reading import Experiment, Value
from runtime.experiments.study import View

DOCUMENT = "document"
NOTHING = "–"
_VARIANTS = {  # methods of studies that are variants of an estimator
    "adam-frozen": "λ-Adam, link 7 frozen",
    "adam-zero": "λ-Adam, threshold 0",
    "adam-friction": "λ-Adam + friction",
    "pc-ols-friction": "PC-IDIM-OLS + friction",
    "map-friction": "MAP + friction",
    "map-dahl": "MAP + Dahl",
    "fixed-arm": "payload alone",
}
_OURS = {"search", "check", "pi", "lam", "beta"}  # computed numbers, not estimators
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
    text = f"{value.mean!r}" if value.std is None else f"{value.mean!r} ± {value.std!r}"
    return f"{text} (corrected, printed {value.misprint})" if value.misprint else text


def measured(value: Value | None, metric: str, spread: str = "std") -> str:
    """Computed mean to three digits and standard deviation to the same decimal, or quartiles."""
    if value is None:
        return NOTHING
    if spread == "quartiles" and value.quartiles:
        low, middle, high = (_share(x) if metric in SHARES else f"{x:.3g}" for x in value.quartiles)
        return f"{middle} [{low} to {high}]"
    if metric in SHARES:
        return _share(value.mean)
    if not math.isfinite(value.mean):
        return NOTHING
    return f"{value.mean:.5g}" if value.std is None else _deviating(value.mean, value.std)


def _deviating(mean: float, std: float) -> str:
    """Mean to three digits ± standard deviation."""
    size = abs(mean)
    if size and not 1e-3 <= size < 1e5:
        return f"{mean:.1e} ± {std:.0e}"
    digits = 4 if not size else max(0, 2 - math.floor(math.log10(size)))
    return f"{mean:.{digits}f} ± {std:.{digits}f}"


def _share(value: float) -> str:
    return f"{100 * value:.3g}\N{NO-BREAK SPACE}%"


MANY = 7  # largest number of methods in columns; more methods become rows
Column = tuple[str, str, bool]  # case, method, and whether the number is printed in the document


def tables(experiment: Experiment, view: View) -> Iterator[Table]:
    """Tables of a view, one per group of methods that share metrics; bars have none."""
    if view.kind == "bars":
        return
    for methods in _families(experiment, view):
        columns = list(_columns(experiment, view, methods))
        rows = [
            (metric_name(metric), *(_cell(experiment, view, c, metric) for c in columns))
            for metric in view.metrics
        ]
        rows = [row for row in rows if any(cell != NOTHING for cell in row[1:])]
        if not columns or not rows:
            continue
        made = _table(columns, rows)
        yield _turned(made) if len(methods) > MANY and not made.groups else made


def _table(columns: list[Column], rows: list[tuple[str, ...]]) -> Table:
    of_document = {column[1] for column in columns if column[2]}
    names = [_head(column, of_document) for column in columns]
    cases = list(dict.fromkeys(case for case, _, _ in columns))
    groups = [("", 1), *((case_name(c), sum(k[0] == c for k in columns)) for c in cases)]
    return Table(
        ("figure", *names),
        tuple(rows),
        kind="numbers paired",
        groups=tuple(groups) if len(cases) > 1 else (),
        column_methods=(
            "",
            *(DOCUMENT if printed else method_name(m) for _, m, printed in columns),
        ),
    )


def _turned(table: Table) -> Table:
    """Transposed table with a row per method, which can be sorted by any metric."""
    lines = tuple(zip(table.header, *table.rows, strict=True))
    header = ("method", *lines[0][1:])
    return Table(header, lines[1:], kind=table.kind, row_methods=table.column_methods[1:])


def _head(column: Column, of_document: set[str]) -> str:
    _, method, is_document = column
    if not is_document:
        return method_name(method)
    return f"{DOCUMENT}, {method_name(method)}" if len(of_document) > 1 else DOCUMENT


def _families(experiment: Experiment, view: View) -> list[list[str]]:
    """Groups of methods that share metrics, in their order."""
    families: list[tuple[list[str], set[str]]] = []
    for method in experiment.methods:
        keys = ((case, method, m) for case in experiment.cases_of(view) for m in view.metrics)
        metrics = {key[2] for key in keys if key in experiment.values}
        near = next((f for f in families if f[1] & metrics), None)
        if near is not None:
            near[0].append(method)
            near[1].update(metrics)
        elif metrics:
            families.append(([method], metrics))
    return [methods for methods, _ in families]


def _columns(experiment: Experiment, view: View, methods: list[str]) -> Iterator[Column]:
    document = experiment.document.get(view.document, {})
    for case in experiment.cases_of(view):
        for method in methods:
            for is_document, known in ((True, document), (False, experiment.values)):
                if any((case, method, metric) in known for metric in view.metrics):
                    yield case, method, is_document


def _cell(experiment: Experiment, view: View, column: Column, metric: str) -> str:
    case, method, is_document = column
    key = (case, method, metric)
    if is_document:
        return printed(experiment.document[view.document].get(key), metric)
    return measured(experiment.values.get(key), metric, view.spread)
