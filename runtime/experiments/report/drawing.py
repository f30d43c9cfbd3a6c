"""Figures 3.1 to 5.8 and A.1 to A.4 in the form of the document.

The page (SVG) and the PNG files share one drawing. Artists carry the name of their method, by
which the filter of the page hides them.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from runtime.experiments.report.labels import DOCUMENT, case_name, curve_name, method_name
from runtime.experiments.report.reading import Experiment, Value, Values
from runtime.experiments.study import View
from runtime.library import Array
from runtime.outputs.report import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 130

_WIDTH = 10.0  # width of a figure [inch]


def write_pictures(experiments: tuple[Experiment, ...], folder: Path) -> tuple[Path, ...]:
    """Write all figures as `fig-5.1.png` and so on."""
    written = []
    for experiment, view, path in paths_of(experiments, folder):
        with canvas.picture(path, (_WIDTH, height(experiment, view)), DPI) as figure:
            draw(figure, experiment, view)
        written.append(path)
    return tuple(written)


def paths_of(
    experiments: tuple[Experiment, ...], folder: Path
) -> tuple[tuple[Experiment, View, Path], ...]:
    """Figures of the studies with their files."""
    both = ((each, view) for each in experiments for view in filter(has_figure, each.views))
    return tuple((each, view, folder / f"{view.id}.png") for each, view in both)


LINES = (  # colours and line styles, distinguishable with any colour vision and in print
    *((canvas.BLUE, "-"), (canvas.ORANGE, "--"), (canvas.GREEN, "-."), (canvas.PURPLE, ":")),
    *((canvas.VERMILION, "-"), (canvas.SKY, "--"), (canvas.INK, "-")),
)
POINTS = 700  # largest number of points of one curve
MOTION = ("position", "velocity", "acceleration", "torque")
UNITS = ("rad", "rad/s", "rad/s²", "N·m")
_BAR = 0.8  # width of a group of bars over the distance of groups
_ENTRY = 1.85  # width of an entry of a legend [inch]


def has_figure(view: View) -> bool:
    """Whether a view is a figure, not a table."""
    return view.kind != "table"


def height(experiment: Experiment, view: View) -> float:
    """Height of a figure of the page width."""
    if view.kind == "lines" and _is_per_joint(experiment, view):
        return 5.0
    per_case = 2.8 * len(experiment.cases_of(view))
    return {"path": 5.0, "motion": 5.2, "bars": per_case}.get(view.kind, 3.4)


def inline(experiment: Experiment, view: View) -> Markup:
    """Figure as SVG for the page."""
    with canvas.page_figure(height(experiment, view)) as figure:
        draw(figure, experiment, view)
        return canvas.svg(figure, view.id)


def draw(figure: "Figure", experiment: Experiment, view: View) -> None:
    """Draw a view."""
    _KINDS[view.kind](figure, experiment, view)


def _band(figure: "Figure", experiment: Experiment, view: View) -> None:
    iteration, mean, std = (experiment.series[name] for name in view.series)
    name = curve_name(view.series[1])
    axis = figure.subplots()
    low = np.maximum(mean - std, 0)
    axis.fill_between(
        iteration, low, mean + std, color=canvas.SKY, alpha=0.3, linewidth=0, label="± 1 std"
    )
    axis.plot(
        iteration, mean, color=canvas.BLUE, label=f"mean of {experiment.trials} trials, {name}"
    )
    axis.set_ylim(bottom=0)
    _finish(axis, view)


def _lines(figure: "Figure", experiment: Experiment, view: View) -> None:
    if _is_per_joint(experiment, view):
        _joints(figure, experiment, view)
        return
    axis = figure.subplots()
    pairs = _curves(experiment, view)
    for (name, x, y), (colour, dashes) in zip(pairs, LINES, strict=False):
        broad = 3.0 if dashes == "-" and len(pairs) > 1 else 1.2
        alpha = 0.6 if broad > 2 else 1.0
        line = {"color": colour, "linestyle": dashes, "linewidth": broad, "alpha": alpha}
        axis.plot(*canvas.thinned(x, y, POINTS), label=name, **line)  # type: ignore[arg-type]
    _finish(axis, view)


def _curves(experiment: Experiment, view: View) -> list[tuple[str, Array, Array]]:
    """Name, x and y of each curve; curves share one x, or each one has its own iterations."""
    names, series = view.series, experiment.series
    if all(name.endswith("iteration") for name in names[::2]):
        pairs = zip(names[::2], names[1::2], strict=True)
        return [(curve_name(y), series[x], series[y]) for x, y in pairs]
    return [(curve_name(name), series[names[0]], series[name]) for name in names[1:]]


def _is_per_joint(experiment: Experiment, view: View) -> bool:
    return any(experiment.series[name].ndim == 2 for name in view.series)


def _joints(figure: "Figure", experiment: Experiment, view: View) -> None:
    """Draw one panel per joint with all curves."""
    across = 4
    down = -(-len(experiment.joints) // across)
    axes = figure.subplots(down, across, sharex=True, squeeze=False).ravel()
    styles = ({"color": canvas.SKY, "linewidth": 3.0}, {"color": canvas.INK, "linestyle": "--"})
    for j, axis in enumerate(axes[: len(experiment.joints)]):
        for (name, x, y), look in zip(_curves(experiment, view), styles, strict=False):
            axis.plot(*canvas.thinned(x, y[:, j], POINTS), label=name, **look)  # type: ignore[arg-type]
        axis.set_title(experiment.joints[j])
        axis.margins(x=0)
        axis.set_xlabel(view.axes[0])
    axes[0].set_ylabel(view.axes[1])
    for axis in axes[len(experiment.joints) :]:
        axis.set_axis_off()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)


def _path(figure: "Figure", experiment: Experiment, view: View) -> None:
    path = experiment.series[view.series[0]]
    if path.ndim == 3:  # poses (N, 4, 4) of the tip
        path = path[:, :3, 3]
    axis: Any = figure.add_subplot(projection="3d")
    axis.plot(*path[:: max(1, len(path) // POINTS)].T, color=canvas.BLUE)
    axis.plot(*path[:1].T, "o", color=canvas.GREEN, label="start and end")
    extent = np.ptp(path, axis=0)
    if extent.any():  # else the path is one point
        axis.set_box_aspect(extent, zoom=0.9)
    for name, one in zip("xyz", (axis.xaxis, axis.yaxis, axis.zaxis), strict=True):
        one.set_pane_color((1, 1, 1, 0))
        one.set_label_text(f"{name} [m]")
        one.get_major_locator().set_params(nbins=4)
    axis.legend(loc="upper right")


def _motion(figure: "Figure", experiment: Experiment, view: View) -> None:
    t, *motion = (experiment.series[name] for name in view.series)
    axes = figure.subplots(2, 2, sharex=True).ravel()
    for axis, values, name, unit in zip(axes, motion, MOTION, UNITS, strict=True):
        for j, (colour, dashes) in enumerate(LINES[: values.shape[1]]):
            x, y = canvas.thinned(t, values[:, j], POINTS // 2)
            axis.plot(x, y, color=colour, linestyle=dashes, label=experiment.joints[j])
        axis.set_title(f"{name} [{unit}]")
        axis.margins(x=0)
    for axis in axes[2:]:
        axis.set_xlabel(view.axes[0])
    handles = axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=len(experiment.joints))


def _loglog(figure: "Figure", experiment: Experiment, view: View) -> None:
    x, curve, reference = (experiment.series[name] for name in view.series)
    axis = figure.subplots()
    name, other = (curve_name(key) for key in view.series[1:])
    seen = curve > 0
    axis.loglog(x, reference, color=canvas.ORANGE, linestyle="--", label=other)
    axis.loglog(x[seen], curve[seen], color=canvas.BLUE, marker="o", markersize=3, label=name)
    for one in (axis.xaxis, axis.yaxis):  # the default formatter of logarithms writes mathematics
        one.set_major_formatter(lambda value, _: f"{value:.0e}")
        one.set_minor_formatter(lambda *_: "")
    _finish(axis, view)


def _bars(figure: "Figure", experiment: Experiment, view: View) -> None:
    """Draw one panel per case, a group of bars per metric, a bar per method and source."""
    cases = experiment.cases_of(view)
    document = experiment.document.get(view.document, {})
    axes = figure.subplots(len(cases), 1, squeeze=False).ravel()
    # More methods than colours: the next ones have the same colours, cross-hatched.
    styles = {
        method: (LINES[k % len(LINES)][0], None if k < len(LINES) else "xxxx")
        for k, method in enumerate(experiment.methods)
    }
    for axis, case in zip(axes, cases, strict=True):
        bars = [
            (method, known is document, heights)
            for method in experiment.methods
            for known in (document, experiment.values)
            if not np.isnan(heights := _heights(known, case, method, view.metrics)).all()
        ]
        wide = _BAR / max(len(bars), 1)
        for k, (method, is_document, heights) in enumerate(bars):
            owner = DOCUMENT if is_document else method_name(method)
            colour, hatch = styles[method]
            drawn = axis.bar(
                np.arange(len(heights)) - _BAR / 2 + (k + 0.5) * wide,
                heights,
                wide,
                label=f"{DOCUMENT}, {method_name(method)}" if is_document else owner,
                color="none" if is_document or hatch else colour,
                edgecolor=colour,
                linewidth=0.8,
                hatch="////" if is_document else hatch,
            )
            for bar in drawn:
                bar.set_gid(f"{canvas.OWNER}{owner}")
        joints = [f"joint {m.rpartition('_')[2]}" for m in view.metrics]
        axis.set_xticks(range(len(view.metrics)), joints)
        axis.grid(visible=False, axis="x")
        axis.set_title(experiment.cases.get(case, case_name(case)))
        axis.set_ylabel(view.axes[1] or "%")
    columns = min(4, int(figure.get_figwidth() / _ENTRY))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=columns)


def _heights(known: Values, case: str, method: str, metrics: tuple[str, ...]) -> Array:
    values = [known.get((case, method, metric), Value(math.nan)).mean for metric in metrics]
    return np.array(values, dtype=float)


def _finish(axis: "Axes", view: View) -> None:
    axis.margins(x=0.01)
    axis.set_xlabel(view.axes[0])
    axis.set_ylabel(view.axes[1])
    axis.legend()


_KINDS: "dict[str, Callable[[Figure, Experiment, View], None]]" = {
    "band": _band,
    "lines": _lines,
    "path": _path,
    "motion": _motion,
    "loglog": _loglog,
    "bars": _bars,
}
