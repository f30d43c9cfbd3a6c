"""Views → tables: a row per metric, a group of columns per case, document and computed values."""

from collections.abc import Iterator

from runtime.common.tables import Table
from runtime.experiments.report.labels import (
    DOCUMENT,
    NOTHING,
    case_name,
    measured,
    method_name,
    metric_name,
    printed,
)
from runtime.experiments.report.reading import Experiment
from runtime.experiments.study import View

MANY = 7
"""Largest number of methods in columns; more methods become rows."""
Column = tuple[str, str, bool]
"""Case, method, and whether the number is printed in the document."""


def tables(experiment: Experiment, view: View) -> Iterator[Table]:
    """Tables of a view: one per group of methods that share metrics.

    π, λ and β, for example, share none. Bars have no table of their own.
    """
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
            *(
                DOCUMENT if is_document else method_name(method)
                for _, method, is_document in columns
            ),
        ),
    )


def _turned(table: Table) -> Table:
    """Transposed table with a row per method, which can be sorted by any metric."""
    lines = tuple(zip(table.header, *table.rows, strict=True))
    return Table(
        ("method", *lines[0][1:]),
        lines[1:],
        kind=table.kind,
        row_methods=table.column_methods[1:],
    )


def _head(column: Column, of_document: set[str]) -> str:
    _, method, is_document = column
    if not is_document:
        return method_name(method)
    return f"{DOCUMENT}, {method_name(method)}" if len(of_document) > 1 else DOCUMENT


def _families(experiment: Experiment, view: View) -> list[list[str]]:
    """Groups of methods that share metrics, in their order."""
    families: list[tuple[list[str], set[str]]] = []
    for method in experiment.methods:
        metrics = {
            metric
            for case in cases_of(experiment, view)
            for metric in view.metrics
            if (case, method, metric) in experiment.values
        }
        near = next((f for f in families if f[1] & metrics), None)
        if near is not None:
            near[0].append(method)
            near[1].update(metrics)
        elif metrics:
            families.append(([method], metrics))
    return [methods for methods, _ in families]


def _columns(experiment: Experiment, view: View, methods: list[str]) -> Iterator[Column]:
    document = experiment.document.get(view.document, {})
    for case in cases_of(experiment, view):
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


def cases_of(experiment: Experiment, view: View) -> tuple[str, ...]:
    """Cases of a view; all cases where it names none."""
    return view.cases or tuple(experiment.cases)
