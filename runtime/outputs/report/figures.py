"""Figures of a result page: torques, masses, loss of a descent, errors of several methods."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from runtime.library import Array
from runtime.outputs.report import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes


POINTS, PANEL_POINTS = 6000, 1200  # of a trace over the page, and over a part of its width

CURVES = (  # label and colour of the torques
    ("measured", canvas.MEASURED),
    ("predicted before", canvas.BEFORE),
    ("predicted after", canvas.AFTER),
)


def torques(
    joints: Sequence[str],
    units: Sequence[str],
    t: Array,
    measured: Array,
    before: Array,
    after: Array,
) -> Markup:
    """Torques (N, n) and measured − predicted of each joint over the times t (N,) of a test."""
    n, gaps = len(joints), canvas.pauses(t)
    height = 0.75 + 1.15 * n
    with canvas.page_figure(height, layout=None) as figure:
        axes = figure.subplots(n, 2, squeeze=False, sharex=True, width_ratios=(3, 2))
        # Fixed margins: the layout engine would draw every panel once more.
        top, bottom = 1 - 0.6 / height, 0.45 / height
        figure.subplots_adjust(0.06, bottom, 0.98, top, wspace=0.12, hspace=0.35)
        for j, (left, right) in enumerate(axes):
            values = [a[:, j] for a in (measured, before, after)]
            # The measured torque is a thin line above the predictions, which it nearly covers.
            for value, (label, colour), width in zip(values, CURVES, (0.6, 1.2, 2.0), strict=True):
                points = canvas.thinned(t, value, PANEL_POINTS, gaps)
                line = {"linewidth": width, "zorder": 3 if value is values[0] else 2}
                left.plot(*points, color=colour, label=label, **line)
            for value, (_, colour) in zip(values[1:], CURVES[1:], strict=True):
                right.plot(*canvas.thinned(t, values[0] - value, PANEL_POINTS, gaps), color=colour)
            left.set_title(f"{joints[j]}  [{units[j]}]")
            for axis in (left, right):
                axis.margins(x=0)
                axis.locator_params(axis="y", nbins=4)
        axes[0, 1].set_title("measured − predicted")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="upper left", ncols=3)
        return canvas.svg(figure, "torques")


def mass_change(
    links: Sequence[str], before: Array, after: Array, sigma: Array | None = None
) -> Markup:
    """Bars of m_after − m_before [kg] per link (n,), labelled with both masses and σ."""
    n, change = len(links), np.nan_to_num(after - before)
    reach = np.zeros(n) if sigma is None else np.nan_to_num(sigma)
    spread = [""] * n if sigma is None else [f" ± {s:.2g}" for s in sigma]
    with canvas.page_figure(height=0.5 + 0.28 * n) as figure:
        axis = figure.subplots()
        axis.barh(range(n), change, color=canvas.AFTER, height=0.6)
        if sigma is not None:
            bars: dict[str, Any] = {"ecolor": canvas.PAGE_INK, "elinewidth": 0.9, "capsize": 2}
            axis.errorbar(change, range(n), xerr=reach, fmt="none", **bars)
        axis.axvline(0, color=canvas.PAGE_INK, linewidth=0.8)
        for k in range(n):
            away = 1 if change[k] >= 0 else -1
            axis.annotate(
                f"{before[k]:.3g} → {after[k]:.3g}{spread[k]}",
                (change[k] + away * reach[k], k),
                xytext=(4 * away, 0),
                textcoords="offset points",
                ha="left" if away > 0 else "right",
                va="center",
            )
        # The labels need more room than the bars, on the side to which a bar points.
        axis.margins(x=0.35)
        axis.set_yticks(range(n), list(links))
        axis.invert_yaxis()
        axis.grid(visible=False, axis="y")
        axis.set_xlabel("change of mass [kg]")
        return canvas.svg(figure, "mass")


def convergence(iteration: Array, training: Array, validation: Array) -> Markup:
    """Training and validation loss over iterations, on a logarithmic axis."""
    with canvas.page_figure(height=2.6) as figure:
        axis = figure.subplots()
        most = POINTS
        for values, colour, label in (
            (training, canvas.AFTER, "training"),
            (validation, canvas.BEFORE, "validation"),
        ):
            seen = np.isfinite(values)
            if seen.any():
                mark = "." if seen.sum() < 40 else ""
                points = canvas.thinned(iteration[seen], values[seen], most)
                axis.plot(*points, color=colour, label=label, marker=mark)
        _logarithmic(axis, np.concatenate([training, validation]))
        axis.set_xlabel("iteration")
        axis.set_ylabel("loss")
        if axis.has_data():
            axis.legend()
        return canvas.svg(figure, "convergence")


def method_bars(
    joints: Sequence[str],
    units: Sequence[str],
    methods: Sequence[str],
    rms: Array,
    good: Sequence[bool],
) -> Markup:
    """One panel per joint with a bar of the RMS torque error per method; rms: (m, n) [N·m, N]."""
    m, n = rms.shape
    columns = min(n, 4)
    lines = -(-n // columns)
    colours = [canvas.AFTER if ok else canvas.BEFORE for ok in good]
    with canvas.page_figure(height=lines * (0.7 + 0.19 * m)) as figure:
        axes = figure.subplots(lines, columns, squeeze=False, sharey=True).ravel()
        for j, axis in enumerate(axes[:n]):
            end = min(3 * float(np.median(rms[:, j])), float(rms[:, j].max())) or 1.0
            bars = axis.barh(range(m), np.minimum(rms[:, j], end), color=colours, height=0.7)
            cut = rms[:, j] > end
            labels = [
                f"{x:.3g}{' →' if far else ''}" for x, far in zip(rms[:, j], cut, strict=True)
            ]
            axis.bar_label(bars, labels, padding=2, color=canvas.PAGE_INK, fontsize=6)
            axis.set_xlim(0, 1.35 * end)
            axis.set_title(f"{joints[j]}  [{units[j]}]")
            axis.set_yticks(range(m), list(methods))
            axis.grid(visible=False, axis="y")
        axes[0].invert_yaxis()
        for axis in axes[n:]:
            axis.set_visible(False)
        return canvas.svg(figure, "methods")


def _logarithmic(axis: "Axes", values: Array) -> None:
    positive = values[np.isfinite(values) & (values > 0)]
    if not positive.size:
        return
    axis.set_yscale("log")
    decades = np.log10(positive.max() / positive.min())
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
    axis.yaxis.set_minor_formatter(lambda value, _: f"{value:.3g}" if decades < 1 else "")
