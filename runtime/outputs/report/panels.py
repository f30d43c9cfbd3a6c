"""Panels of lines and bars as inline SVG, written without a plotting library.

A panel maps numbers to points (1/72 inch) of the page:
    x = left + (u − u₀)/(u₁ − u₀) width,   y = top + (v₁ − v)/(v₁ − v₀) height.
Fourteen panels of lines take 30 ms; matplotlib takes 0.9 s and 0.4 s of imports.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from runtime.outputs.report.decimation import thinned

Array = NDArray[np.float64]

WIDTH = 720.0
"""Width of a figure [pt]; the page scales it."""
PIXELS = 1.5
"""Pixels of a wide screen per point of a figure."""
FONT = 8.0
"""Size of the text [pt]."""
LETTER = 0.6
"""Width of a letter over the font size, an upper bound for names."""


@dataclass(frozen=True, slots=True)
class Panel:
    """Rectangle of a figure with its two scales.

    Attributes:
        left, top, width, height: rectangle [pt].
        u: smallest and largest abscissa.
        v: smallest and largest ordinate.
    """

    left: float
    top: float
    width: float
    height: float
    u: tuple[float, float]
    v: tuple[float, float]

    def x(self, u: Array | float) -> Array:
        """Horizontal position [pt] of an abscissa."""
        return self.left + (np.asarray(u) - self.u[0]) / (self.u[1] - self.u[0]) * self.width

    def y(self, v: Array | float) -> Array:
        """Vertical position [pt] of an ordinate."""
        return self.top + (self.v[1] - np.asarray(v)) / (self.v[1] - self.v[0]) * self.height


def figure(name: str, height: float, parts: Sequence[str]) -> Markup:
    """<svg> element of the page width."""
    head = (
        f'<svg viewBox="0 0 {WIDTH:g} {height:g}" role="img" aria-label="{escape(name)}" '
        f'font-size="{FONT:g}" font-family="DejaVu Sans, sans-serif">'
    )
    return Markup("\n".join([head, *parts, "</svg>"]))  # noqa: S704  every text is escaped


def span(values: Sequence[Array], margin: float = 0.05) -> tuple[float, float]:
    """Smallest and largest value of all arrays, moved apart by a share of their distance."""
    low = min(float(np.min(a)) for a in values)
    high = max(float(np.max(a)) for a in values)
    if not high > low:
        reach = 0.05 * abs(low) or 0.05
        return low - reach, high + reach
    reach = margin * (high - low)
    return low - reach, high + reach


def ticks(ends: tuple[float, float], most: int) -> tuple[Array, list[str]]:
    """Multiples of 1, 2, 2.5 or 5 times a power of ten between two ends, with their labels."""
    low, high = ends
    raw = (high - low) / most
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * next(f for f in (1.0, 2.0, 2.5, 5.0, 10.0) if f * power >= raw * (1 - 1e-9))
    at = step * np.arange(np.ceil(low / step), np.floor(high / step) + 0.5)
    if 1e-4 <= step < 1e6:
        digits = max(0, int(-np.floor(np.log10(step) + 1e-9)) + (step / power == 2.5))
        labels = [f"{value + 0.0:.{digits}f}" for value in at]
    else:
        labels = [f"{value:.4g}" for value in at]
    return at, [label.replace("-", "−") for label in labels]


def axes(panel: Panel, title: str, u_ticks: int, v_ticks: int, u_label: str | None) -> list[str]:
    """Grid, left and lower edge, labels of both scales and title of a panel."""
    right, bottom = panel.left + panel.width, panel.top + panel.height
    at, names = ticks(panel.u, u_ticks)
    grid = [f"M{x:.2f} {panel.top:.2f}V{bottom:.2f}" for x in panel.x(at)]
    parts = []
    if u_label is not None:
        for x, label in zip(panel.x(at), names, strict=True):
            parts.append(text(label, float(x), bottom + FONT + 3, "middle"))
        parts.append(text(u_label, panel.left + panel.width / 2, bottom + 2 * FONT + 6, "middle"))
    if v_ticks:
        at, names = ticks(panel.v, v_ticks)
        for y, label in zip(panel.y(at), names, strict=True):
            grid.append(f"M{panel.left:.2f} {y:.2f}H{right:.2f}")
            parts.append(text(label, panel.left - 4, float(y) + 0.35 * FONT, "end"))
    edge = f"M{panel.left:.2f} {panel.top:.2f}V{bottom:.2f}H{right:.2f}"
    heading = text(title, panel.left, panel.top - 4)
    return [stroke("".join(grid), "--line", 0.4), stroke(edge, "--line", 0.8), *parts, heading]


def curve(
    panel: Panel, t: Array, y: Array, colour: str, gaps: NDArray[np.intp] | None = None
) -> str:
    """Line through samples, reduced to the smallest and largest value of each pixel."""
    u, v = thinned(t, y, round(2 * PIXELS * panel.width), gaps)
    points = np.column_stack([panel.x(u), panel.y(v)])
    pieces = np.split(points, np.flatnonzero(np.isnan(u)))
    drawn = (piece[~np.isnan(piece).any(axis=1)].tolist() for piece in pieces)
    path = "".join("M" + "L".join(f"{a:.2f} {b:.2f}" for a, b in piece) for piece in drawn if piece)
    return stroke(path, colour, 0.9)


def stroke(path: str, colour: str, width: float) -> str:
    """Path element."""
    return (
        f'<path d="{path}" style="fill: none; stroke: var({colour}); stroke-width: {width:g}; '
        'stroke-linejoin: round"/>'
    )


def bar(left: float, top: float, width: float, height: float, colour: str) -> str:
    """Filled rectangle."""
    return (
        f'<rect x="{left:.2f}" y="{top:.2f}" width="{width:.2f}" height="{height:.2f}" '
        f'style="fill: var({colour})"/>'
    )


def text(words: str, x: float, y: float, anchor: str = "start") -> str:
    """Text element."""
    return (
        f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}" style="fill: var(--ink)">'
        f"{escape(words)}</text>"
    )
