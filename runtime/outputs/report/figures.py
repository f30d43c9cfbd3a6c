"""Figures of an identification and of a comparison as inline SVG."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray

from runtime.outputs.report.svg import AFTER, BEFORE, INK, MEASURED, page_figure, svg

Array = NDArray[np.float64]

POINTS = 60_000
"""Largest number of vertices in one figure, about 1 MB of SVG."""


def torques(
    joints: Sequence[str],
    units: Sequence[str],
    t: Array,
    measured: Array,
    before: Array,
    after: Array,
) -> Markup:
    """Torque (left) and measured − predicted (right) of each joint over the test split.

    Args:
        joints: n names.
        units: n units of torque.
        t: (N,) time [s].
        measured: (N, n) torques [N·m, N].
        before: (N, n) torques predicted by the URDF [N·m, N].
        after: (N, n) torques predicted by the identified parameters [N·m, N].

    Returns:
        The <svg> element.
    """
    n = len(joints)
    most = max(50, POINTS // (5 * n))
    with page_figure(height=0.6 + 1.15 * n) as figure:
        axes = figure.subplots(n, 2, sharex=True, squeeze=False, width_ratios=(3, 2))
        for j, (left, right) in enumerate(axes):
            for values, colour, label in (
                (measured, MEASURED, "measured"),
                (before, BEFORE, "predicted before"),
                (after, AFTER, "predicted after"),
            ):
                left.plot(*thinned(t, values[:, j], most), color=colour, label=label)
                if values is not measured:
                    error = measured[:, j] - values[:, j]
                    right.plot(*thinned(t, error, most), color=colour)
            left.set_title(f"{joints[j]}  [{units[j]}]")
            left.margins(x=0)
        axes[0, 1].set_title("measured − predicted")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
        return svg(figure, "torques")


def mass_change(
    links: Sequence[str], before: Array, after: Array, sigma: Array | None = None
) -> Markup:
    """Bars of m_after − m_before per link, labelled with the two masses and σ of the second.

    Args:
        links: n names.
        before: (n,) masses of the URDF [kg].
        after: (n,) identified masses [kg].
        sigma: (n,) standard deviations of the identified masses [kg]; None where unknown.

    Returns:
        The <svg> element.
    """
    n = len(links)
    change = after - before
    spread = [""] * n if sigma is None else [f" ± {s:.2g}" for s in sigma]
    with page_figure(height=0.7 + 0.28 * n) as figure:
        axis = figure.subplots()
        bars = axis.barh(range(n), np.nan_to_num(change), color=AFTER, height=0.6)
        triples = zip(before, after, spread, strict=True)
        axis.bar_label(bars, [f"{b:.3g} → {a:.3g}{s}" for b, a, s in triples], padding=4, color=INK)
        if sigma is not None:
            axis.errorbar(change, range(n), xerr=sigma, fmt="none", ecolor=INK, capsize=2)
        axis.axvline(0, color=INK, linewidth=0.8)
        axis.set_yticks(range(n), list(links))
        axis.invert_yaxis()
        axis.grid(visible=False, axis="y")
        axis.margins(x=0.2)
        axis.set_xlabel("change of mass [kg]")
        return svg(figure, "mass")


def convergence(iteration: Array, training: Array, validation: Array) -> Markup:
    """Training and validation loss over iterations, on a logarithmic axis.

    Args:
        iteration: (K,) numbers.
        training: (K,) loss; NaN where it was not evaluated.
        validation: (K,) loss; NaN where it was not evaluated.

    Returns:
        The <svg> element.
    """
    with page_figure(height=2.6) as figure:
        axis = figure.subplots()
        most = POINTS // 10
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

    Args:
        joints: n names.
        units: n units of torque.
        methods: m names.
        rms: (m, n) errors [N·m, N]; a bar of more than three medians is cut and marked by →.
        good: whether each of the m results is physically consistent, which sets its colour.

    Returns:
        The <svg> element.
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


def thinned(t: Array, y: Array, most: int) -> tuple[Array, Array]:
    """Reduce a curve to about `most` points: the smallest and largest value of equal bins.

    A pause of more than ten median steps becomes a gap in the line.

    Args:
        t: (N,) abscissa.
        y: (N,) values.
        most: largest number of points.

    Returns:
        Abscissa and values of the kept points, with NaN at gaps.
    """
    step = np.median(np.diff(t)) if len(t) > 1 else 0.0
    pauses = np.flatnonzero(np.diff(t) > 10 * step) + 1
    if len(pauses) > most // 20:
        pauses = pauses[:0]
    pieces_t, pieces_y = [], []
    edges = [0, *pauses, len(t)]
    for start, stop in pairwise(edges):
        kept = start + _envelope(y[start:stop], max(2, most * (stop - start) // len(t)))
        pieces_t += [t[kept], [np.nan]]
        pieces_y += [y[kept], [np.nan]]
    return np.concatenate(pieces_t[:-1]), np.concatenate(pieces_y[:-1])


def _envelope(y: Array, most: int) -> NDArray[np.intp]:
    """Indices of the first, the last, and the smallest and largest value of each bin."""
    if len(y) <= most:
        return np.arange(len(y))
    safe = np.nan_to_num(y)
    edges = np.linspace(0, len(y), max(1, most // 2) + 1).astype(int)
    kept = {0, len(y) - 1}
    for start, stop in pairwise(edges):
        if stop > start:
            kept |= {start + int(safe[start:stop].argmin()), start + int(safe[start:stop].argmax())}
    return np.array(sorted(kept))


def _logarithmic(axis: Axes, values: Array) -> None:
    positive = values[np.isfinite(values) & (values > 0)]
    if not positive.size:
        return
    axis.set_yscale("log")
    decades = np.log10(positive.max() / positive.min())
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
    axis.yaxis.set_minor_formatter(lambda value, _: f"{value:.3g}" if decades < 1 else "")
