"""History of `watch` → one page: verdicts, and every estimated change over time and temperature."""

from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from runtime.common.tables import Table
from runtime.estimators.regression.samples import NORMAL_95
from runtime.monitoring.trends import (
    ALPHA,
    MONTH,
    Series,
    Slope,
    TrendAxis,
    Trends,
    read_history,
    trends_of,
)
from runtime.outputs.report.canvas import CYCLE, PAGE_INK, page_figure, svg
from runtime.outputs.report.page import Page, Section, Tile, write_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes


GLOSSARY = (
    ("size", "estimate of one change from one log, as if nothing else had changed; bars are 95 %"),
    ("slope", "weighted least squares over all logs, with the scatter of the logs in its interval"),
    ("significant", f"p-value times the number of slopes below {ALPHA:g}"),
)


def write_trends(history: Path, out: Path) -> Path:
    """Write the page of a history."""
    return write_page(_page(trends_of(read_history(history)), history.name), out)


def _page(trends: Trends, name: str) -> Page:
    slopes = [
        (axis, series, slope)
        for axis in trends.axes
        for series in trends.series
        if (slope := axis.slope(series)) is not None
    ]
    significant = [each for each in slopes if each[2].p_value * len(slopes) < ALPHA]
    first, last = _date(trends.days[0]), _date(trends.days[-1])
    count = sum(trends.changed)
    sentences = [
        f"{_name(series)} changes with {axis.word} by {_slope(slope, series, axis)}."
        for axis, series, slope in significant
    ]
    left_out = (f"{trends.others} checks of other models are left out.",) if trends.others else ()
    return Page(
        title="Trends of a robot",
        subtitle=f"{name} · {len(trends.logs)} logs · {first} to {last}",
        headline=" ".join(sentences) or "No significant trend.",
        notes=left_out,
        tiles=(
            Tile("Logs", str(len(trends.logs)), f"{first} to {last}"),
            Tile("Changes", str(count), "logs with a change", "bad" if count else "good"),
            Tile(
                "Trends",
                str(len(significant)),
                "significant slopes",
                "bad" if significant else "good",
            ),
        ),
        sections=(*_sections(trends, len(slopes)), _verdicts(trends)),
        glossary=GLOSSARY,
    )


def _sections(trends: Trends, tests: int) -> Iterator[Section]:
    for group, members in groupby(
        sorted(trends.series, key=lambda series: series.group), key=lambda series: series.group
    ):
        many = tuple(members)
        for axis in trends.axes:
            if not any(np.isfinite(axis.x[list(series.at)]).any() for series in many):
                continue
            yield Section(
                f"{group.capitalize()} over {axis.word}",
                table=_table(many, axis, tests),
                figure=_figure(many, axis, trends, f"{group.replace(' ', '-')}-{axis.word}"),
                group=group.capitalize(),
            )


def _table(many: tuple[Series, ...], axis: TrendAxis, tests: int) -> Table:
    rows, flagged = [], set()
    for k, series in enumerate(many):
        slope = axis.slope(series)
        if slope is None:
            rows.append((series.where or "robot", "–", "–", "–"))
            continue
        low, high = slope.interval
        corrected = min(1.0, slope.p_value * tests)
        if corrected < ALPHA:
            flagged.add(k)
        cells = (f"{slope.value:+.3g}", f"{low:+.3g} to {high:+.3g}", f"{corrected:.1e}")
        rows.append((series.where or "robot", *cells))
    header = ("where", f"slope [{many[0].unit} per {axis.unit}]", "95 %", "p, corrected")
    return Table(header, tuple(rows), flagged=frozenset(flagged))


def _figure(many: tuple[Series, ...], axis: TrendAxis, trends: Trends, name: str) -> Markup:
    columns = min(len(many), 4)
    lines = -(-len(many) // columns)
    with page_figure(height=0.4 + 1.5 * lines) as figure:
        panels = np.atleast_1d(figure.subplots(lines, columns, squeeze=False)).ravel()
        for panel in panels[len(many) :]:
            panel.set_visible(False)
        for panel, series in zip(panels, many, strict=False):
            _panel(panel, series, axis, trends)
        return svg(figure, f"trend-{name}")


def _panel(panel: "Axes", series: Series, axis: TrendAxis, trends: Trends) -> None:
    x = axis.x[list(series.at)]
    known = np.isfinite(x)
    x, size, half = x[known], series.size[known], NORMAL_95 * series.sigma[known]
    panel.errorbar(x, size, yerr=half, fmt=".", color=CYCLE[0], elinewidth=0.8, markersize=3)
    panel.axhline(0, color=PAGE_INK, linewidth=0.6)
    slope = axis.slope(series)
    if slope is not None:
        ends = np.array([x.min(), x.max()])
        panel.plot(ends, slope.offset + slope.value * ends, color=CYCLE[3])
    panel.set_title(f"{series.where or 'robot'} [{series.unit}]")
    panel.locator_params(axis="x", nbins=3)
    if axis.word == "time":
        panel.xaxis.set_major_formatter(lambda value, _: _date(trends.days[0] + value * MONTH))
    else:
        panel.set_xlabel(axis.unit)


def _verdicts(trends: Trends) -> Section:
    rows = tuple(
        (_date(day), log, "" if np.isnan(warm) else f"{warm:.1f}", sentence)
        for day, log, warm, sentence in zip(
            trends.days, trends.logs, trends.temperature, trends.sentences, strict=True
        )
    )
    flagged = frozenset(k for k, changed in enumerate(trends.changed) if changed)
    table = Table(("date", "log", "°C", "verdict"), rows, kind="facts", flagged=flagged)
    return Section("Verdicts", table=table)


def _name(series: Series) -> str:
    return f"{series.group}{f' of {series.where}' if series.where else ''}".capitalize()


def _slope(slope: Slope, series: Series, axis: TrendAxis) -> str:
    low, high = slope.interval
    return f"{slope.value:+.3g} {series.unit} per {axis.unit} (95 %: {low:+.3g} to {high:+.3g})"


def _date(day: float) -> str:
    return datetime.fromtimestamp(day * 86400, UTC).strftime("%Y-%m-%d")
