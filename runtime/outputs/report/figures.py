"""Figures by matplotlib, as inline SVG: convergence of a descent, errors of several methods."""

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray

from runtime.outputs.report.decimation import thinned
from runtime.outputs.report.svg import AFTER, BEFORE, INK, page_figure, svg

Array = NDArray[np.float64]

POINTS = 6000
"""Largest number of points of a trace."""


def convergence(iteration: Array, training: Array, validation: Array) -> Markup:
    """Training and validation loss over iterations, on a logarithmic axis."""
    with page_figure(height=2.6) as figure:
        axis = figure.subplots()
        most = POINTS
        for values, colour, label in (
            (training, AFTER, "training"),
            (validation, BEFORE, "validation"),
        ):
            seen = np.isfinite(values)
            if seen.any():
                mark = "." if seen.sum() < 40 else ""
                axis.plot(
                    *thinned(iteration[seen], values[seen], most),
                    color=colour,
                    label=label,
                    marker=mark,
                )
        _logarithmic(axis, np.concatenate([training, validation]))
        axis.set_xlabel("iteration")
        axis.set_ylabel("loss")
        if axis.has_data():
            axis.legend()
        return svg(figure, "convergence")


def method_bars(
    joints: Sequence[str],
    units: Sequence[str],
    methods: Sequence[str],
    rms: Array,
    good: Sequence[bool],
) -> Markup:
    """One panel per joint with a bar of the RMS torque error per method.

    rms (m, n) [N·m, N].
    """
    m, n = rms.shape
    columns = min(n, 4)
    lines = -(-n // columns)
    colours = [AFTER if ok else BEFORE for ok in good]
    with page_figure(height=lines * (0.7 + 0.19 * m)) as figure:
        axes = figure.subplots(lines, columns, squeeze=False, sharey=True).ravel()
        for j, axis in enumerate(axes[:n]):
            end = min(3 * float(np.median(rms[:, j])), float(rms[:, j].max())) or 1.0
            bars = axis.barh(range(m), np.minimum(rms[:, j], end), color=colours, height=0.7)
            cut = rms[:, j] > end
            labels = [
                f"{x:.3g}{' →' if far else ''}" for x, far in zip(rms[:, j], cut, strict=True)
            ]
            axis.bar_label(bars, labels, padding=2, color=INK, fontsize=6)
            axis.set_xlim(0, 1.35 * end)
            axis.set_title(f"{joints[j]}  [{units[j]}]")
            axis.set_yticks(range(m), list(methods))
            axis.grid(visible=False, axis="y")
        axes[0].invert_yaxis()
        for axis in axes[n:]:
            axis.set_visible(False)
        return svg(figure, "methods")


def _logarithmic(axis: Axes, values: Array) -> None:
    positive = values[np.isfinite(values) & (values > 0)]
    if not positive.size:
        return
    axis.set_yscale("log")
    decades = np.log10(positive.max() / positive.min())
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
    axis.yaxis.set_minor_formatter(lambda value, _: f"{value:.3g}" if decades < 1 else "")
