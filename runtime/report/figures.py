"""Arrays → inline SVG that takes its colours from the page, so that it follows light and dark.

Matplotlib draws in placeholder colours; each becomes a CSS variable. Same input, same bytes: no
date, salted ids, no state shared with other plots. Names of joints and links are text, not maths.
"""

import io
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from runtime.report.style import blank, settings

Array = NDArray[np.float64]

COLOURS = {
    "#010203": "var(--ink)",
    "#010204": "var(--line)",
    "#010205": "var(--measured)",
    "#010206": "var(--before)",
    "#010207": "var(--after)",
}
INK, LINE, MEASURED, BEFORE, AFTER = COLOURS

POINTS = 60_000
"""Vertices in one figure, about 1 MB of SVG."""

_STYLE = settings(INK, LINE, LINE) | {
    "svg.fonttype": "none",
    "grid.linewidth": 0.4,
    "lines.linewidth": 0.9,
}
_WIDTH = 10.0  # inches; the page scales it


def torques(
    joints: Sequence[str],
    units: Sequence[str],
    t: Array,
    measured: Array,
    before: Array,
    after: Array,
) -> str:
    """Torque (left) and measured − predicted (right) of each joint over the test split.

    Args:
        joints: n names.
        units: n units.
        t: (N,) s.
        measured: (N, n).
        before: (N, n), predicted by the URDF.
        after: (N, n), predicted by the identified parameters.
    """
    n = len(joints)
    most = max(50, POINTS // (5 * n))
    with _figure(height=0.6 + 1.15 * n) as figure:
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
        return _svg(figure, "torques")


def mass_change(links: Sequence[str], before: Array, after: Array) -> str:
    """Bars of m_after − m_before per link, kg, labelled with the two masses."""
    n = len(links)
    change = after - before
    with _figure(height=0.7 + 0.28 * n) as figure:
        axis = figure.subplots()
        bars = axis.barh(range(n), np.nan_to_num(change), color=AFTER, height=0.6)
        labels = [f"{b:.3g} → {a:.3g}" for b, a in zip(before, after, strict=True)]
        axis.bar_label(bars, labels, padding=4, color=INK)
        axis.axvline(0, color=INK, linewidth=0.8)
        axis.set_yticks(range(n), list(links))
        axis.invert_yaxis()
        axis.grid(visible=False, axis="y")
        axis.margins(x=0.2)
        axis.set_xlabel("change of mass [kg]")
        return _svg(figure, "mass")


def convergence(iteration: Array, training: Array, validation: Array) -> str:
    """Training and validation loss over iterations, logarithmic."""
    with _figure(height=2.6) as figure:
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
        return _svg(figure, "convergence")


def method_bars(
    joints: Sequence[str],
    units: Sequence[str],
    methods: Sequence[str],
    rms: Array,
    good: Sequence[bool],
) -> str:
    """A panel per joint with a bar of RMS error per method; `good` ones in the colour of after.

    Args:
        joints: n names.
        units: n units.
        methods: m names.
        rms: (m, n); a bar of more than three medians is cut, and its number says so.
        good: m claims.
    """
    m, n = rms.shape
    columns = min(n, 4)
    lines = -(-n // columns)
    colours = [AFTER if ok else BEFORE for ok in good]
    with _figure(height=lines * (0.7 + 0.19 * m)) as figure:
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
        return _svg(figure, "methods")


def thinned(t: Array, y: Array, most: int) -> tuple[Array, Array]:
    """At most about `most` points that keep every peak: smallest and largest of equal bins.

    A pause of more than ten median steps becomes a gap in the line.
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


@contextmanager
def _figure(height: float) -> Iterator[Figure]:
    """A blank figure as wide as the page."""
    with warnings.catch_warnings(), blank((_WIDTH, height), _STYLE) as figure:
        # The browser has fonts that the layout engine lacks.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield figure


def _svg(figure: Figure, name: str) -> str:
    """The bare <svg> element: page colours, short numbers, ids that no other figure has."""
    buffer = io.StringIO()
    with rc_context({"svg.hashsalt": name}):
        figure.savefig(
            buffer,
            format="svg",
            transparent=True,
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    for colour, variable in COLOURS.items():
        text = text.replace(f": {colour}", f": {variable}")
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r'\sd="[^"]*"', lambda m: re.sub(r"\d+\.\d{3,}", _short, m.group()), text)
    width, height = figure.get_size_inches() * 72
    head = f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{name}">'
    return re.sub(r"<svg[^>]*>", head, text, count=1)


def _short(match: re.Match[str]) -> str:
    return f"{float(match.group()):.2f}"
