"""The two figures of every identification: torques over time, change of the masses."""

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from runtime.outputs.report.decimation import pauses
from runtime.outputs.report.panels import (
    FONT,
    LETTER,
    WIDTH,
    Panel,
    axes,
    bar,
    curve,
    figure,
    span,
    stroke,
    text,
)

Array = NDArray[np.float64]

CURVES = (
    ("measured", "--measured"),
    ("predicted before", "--before"),
    ("predicted after", "--after"),
)
"""Label and colour of the torques."""
_HEAD, _FOOT = 26.0, 28.0
"""Height of the legend above and of the label below all panels [pt]."""
_PITCH, _GAP = 83.0, 19.0
"""Distance of panels, and what of it holds the title [pt]."""
_EDGE, _MIDDLE = 44.0, 48.0
"""Room left of the first and of the second column for numbers [pt]."""
_LEFT_SHARE = 0.6
"""Share of the torques in the width of both columns."""


def torques(
    joints: Sequence[str],
    units: Sequence[str],
    t: Array,
    measured: Array,
    before: Array,
    after: Array,
) -> Markup:
    """Torque (left) and measured − predicted (right) of each joint over the test split.

    t (N,) [s], measured (N, n) [N·m, N], before (N, n) [N·m, N], after (N, n) [N·m, N].
    """
    n, time = len(joints), span([t], margin=0.0)
    both = WIDTH - _EDGE - _MIDDLE - 8.0
    wide, narrow = _LEFT_SHARE * both, (1.0 - _LEFT_SHARE) * both
    second = _EDGE + wide + _MIDDLE
    parts, gaps = _legend(), pauses(t)
    for j in range(n):
        values = [np.ascontiguousarray(a[:, j]) for a in (measured, before, after)]
        errors = [values[0] - other for other in values[1:]]
        top, height = _HEAD + _PITCH * j + _GAP, _PITCH - _GAP
        label = "time [s]" if j == n - 1 else None
        left = Panel(_EDGE, top, wide, height, time, span(values))
        right = Panel(second, top, narrow, height, time, span(errors))
        heading = "measured − predicted" if j == 0 else ""
        parts += axes(left, f"{joints[j]}  [{units[j]}]", 8, 4, label)
        parts += [curve(left, t, v, c, gaps) for v, (_, c) in zip(values, CURVES, strict=True)]
        parts += axes(right, heading, 6, 4, label)
        parts += [curve(right, t, v, c, gaps) for v, (_, c) in zip(errors, CURVES[1:], strict=True)]
    return figure("torques", _HEAD + _PITCH * n + _FOOT, parts)


def mass_change(
    links: Sequence[str], before: Array, after: Array, sigma: Array | None = None
) -> Markup:
    """Bars of m_after − m_before per link, labelled with the two masses and σ of the second.

    before (n,) [kg], after (n,) [kg], sigma (n,) [kg].
    """
    n, pitch, top = len(links), 20.0, 8.0
    change = np.nan_to_num(after - before)
    reach = np.zeros(n) if sigma is None else np.nan_to_num(sigma)
    spread = [""] * n if sigma is None else [f" ± {s:.2g}" for s in sigma]
    # The labels need more room than the bars, on the side to which a bar points.
    ends = span([change - reach, change + reach, np.zeros(1)], margin=0.35)
    room = min(0.4 * WIDTH, 12.0 + LETTER * FONT * max(len(name) for name in links))
    panel = Panel(room, top, WIDTH - room - 8.0, pitch * n, ends, (float(n), 0.0))
    parts = axes(panel, "", 8, 0, "change of mass [kg]")
    zero = float(panel.x(0.0))
    for k, name in enumerate(links):
        end = float(panel.x(change[k]))
        middle = float(panel.y(k + 0.5))
        outer = float(panel.x(change[k] + np.copysign(reach[k], change[k])))
        parts.append(text(name, room - 4, middle + 0.35 * FONT, "end"))
        parts.append(bar(min(zero, end), middle - 0.3 * pitch, abs(end - zero), 0.6 * pitch, _BAR))
        if sigma is not None:
            low, high = (float(x) for x in panel.x(change[k] + np.array([-1, 1]) * reach[k]))
            caps = "".join(f"M{x:.2f} {middle - 2:.2f}v4" for x in (low, high))
            parts.append(stroke(f"M{low:.2f} {middle:.2f}H{high:.2f}{caps}", "--ink", 0.9))
        label = f"{before[k]:.3g} → {after[k]:.3g}{spread[k]}"
        away, anchor = (4.0, "start") if change[k] >= 0 else (-4.0, "end")
        parts.append(text(label, outer + away, middle + 0.35 * FONT, anchor))
    parts.append(stroke(f"M{zero:.2f} {top:.2f}v{pitch * n:.2f}", "--ink", 0.8))
    return figure("mass", top + pitch * n + _FOOT, parts)


_BAR = "--after"
"""Colour of the bars."""


def _legend() -> list[str]:
    """One stroke and one word per curve, in the middle above the panels."""
    widths = [24.0 + LETTER * FONT * len(label) + 16.0 for label, _ in CURVES]
    parts, x = [], (WIDTH - sum(widths)) / 2
    for (label, colour), width in zip(CURVES, widths, strict=True):
        parts.append(stroke(f"M{x:.2f} 9h18", colour, 1.2))
        parts.append(text(label, x + 24.0, 9 + 0.35 * FONT))
        x += width
    return parts
