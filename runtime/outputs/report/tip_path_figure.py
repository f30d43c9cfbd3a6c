"""Figure of a motion in space: path of the tip (Fig. 3.3 of the document), distances over time."""

from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from runtime.excitation.motion_profile import Gap, MotionProfile
from runtime.outputs.report.style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION

Array = NDArray[np.float64]

CLOSEST = 4
"""Number of emphasised distances, those with the least distance − margin."""
NEAR = 0.3
"""Upper end of the panel where all emphasised distances fall below it [m]."""
BOLD = ((BLUE, "-"), (ORANGE, "--"), (GREEN, "-."), (PURPLE, ":"))
TITLES = {
    "self-collision": "distance between links [m]",
    "table": "height above the table [m]",
    "obstacle": "distance from obstacles [m]",
}


def draw_space(figure: Figure, profile: MotionProfile) -> None:
    """Draw the path of the tip with table and box, and one panel of distances per kind."""
    kinds = list(dict.fromkeys(gap.kind for gap in profile.gaps)) or ["self-collision"]
    left, right = figure.subfigures(1, 2, width_ratios=(1, 1.15), squeeze=False)[0]
    _path(left.add_subplot(projection="3d"), profile)
    panels = right.subplots(len(kinds), 1, sharex=True, squeeze=False).ravel()
    for kind, axis in zip(kinds, panels, strict=True):
        _distances(axis, profile, [gap for gap in profile.gaps if gap.kind == kind])
        note = "" if kind not in profile.certificate.unchecked else ": NOT checked"
        axis.set_title(TITLES[kind] + note)
    panels[-1].set_xlabel("time [s]")
    figure.suptitle(
        f"{profile.robot}, {profile.t[-1]:g} s: path of the tip and distances",
        fontsize=9,
        x=0.01,
        ha="left",
    )


def _distances(axis: Axes, profile: MotionProfile, gaps: list[Gap]) -> None:
    """Draw the closest distances emphasised with their margins, the others thin."""
    axis.margins(x=0)
    if not gaps:
        text = "the robot has no collision proxies"
        axis.text(0.5, 0.5, text, transform=axis.transAxes, ha="center", va="center")
        axis.set_yticks([])
        return
    ranked = sorted(gaps, key=lambda gap: gap.left)
    bold, others = ranked[:CLOSEST], ranked[CLOSEST:]
    for gap in others:
        axis.plot(profile.t, gap.values, color=GREY, linewidth=0.6)
    for gap, (colour, dashes) in zip(bold, BOLD, strict=False):
        label = f"{gap.label}: {1e3 * gap.least:.1f} / {1e3 * gap.margin:g} mm"
        axis.plot(profile.t, gap.values, color=colour, linestyle=dashes, label=label, zorder=3)
    for margin in sorted({gap.margin for gap in gaps}):
        worst = min(gap.left for gap in gaps if gap.margin == margin)
        axis.axhline(margin, color=VERMILION, linewidth=1.0)
        if worst < 0:
            axis.axhspan(min(0.0, margin + worst), margin, color=VERMILION, alpha=0.12, linewidth=0)
    top = min(max(gap.values.max() for gap in bold), max(NEAR, 2 * bold[-1].least))
    low = min(0.0, *(gap.least for gap in gaps))
    axis.set_ylim(low - 0.03 * (top - low), 1.02 * top)
    axis.plot([], [], color=VERMILION, linewidth=1.0, label="margin")
    if others:
        axis.plot([], [], color=GREY, linewidth=0.6, label=f"{len(others)} others")
    axis.legend(
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
        fontsize=7,
        title="least / margin",
        title_fontsize=7,
        alignment="left",
    )


def _path(axis: Axes3D, profile: MotionProfile) -> None:
    """Draw path, start and half time with equal scales, and the shadow on the table or floor."""
    tip, middle = profile.tip, profile.tip[len(profile.tip) // 2]
    low, high = _room(profile)
    floor = profile.table if profile.table is not None else low[2]
    axis.plot(tip[:, 0], tip[:, 1], np.full(len(tip), floor), color=GREY, linewidth=0.8)
    axis.plot(*tip.T, color=BLUE, label="tip")
    axis.plot(*tip[:1].T, "o", color=GREEN, markersize=7, label="start and end")
    axis.plot(*middle[:, None], "s", color=ORANGE, markersize=5, label="half time")
    if profile.table is not None:
        corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
        ends = np.array([low, high])
        plane = [[(ends[i, 0], ends[j, 1], profile.table) for i, j in corners]]
        axis.add_collection3d(Poly3DCollection(plane, color=SKY, alpha=0.25, label="table"))
    if profile.box is not None:
        _wires(axis, *_open_ends(profile.box, low, high))
    axis.set_xlim(low[0], high[0])
    axis.set_ylim(low[1], high[1])
    axis.set_zlim(low[2], high[2])
    axis.set_aspect("equal")
    for name, label in zip("xyz", ("x [m]", "y [m]", "z [m]"), strict=True):
        getattr(axis, f"set_{name}label")(label)
    axis.tick_params(labelsize=7)
    axis.legend(loc="upper left", fontsize=7)


def _room(profile: MotionProfile) -> tuple[Array, Array]:
    """Corners of the drawn space: path, finite sides of the box, and table."""
    points = [profile.tip]
    if profile.box is not None:
        low, high = profile.tip.min(axis=0), profile.tip.max(axis=0)
        points.append(np.array(_open_ends(profile.box, low, high)))
    if profile.table is not None:
        points.append(np.array([[*profile.tip[0, :2], profile.table]]))
    every = np.concatenate(points)
    low, high = every.min(axis=0), every.max(axis=0)
    pad = 0.05 * max(0.1, float((high - low).max()))
    return low - pad, high + pad


def _open_ends(box: tuple[float, ...], low: Array, high: Array) -> tuple[Array, Array]:
    """Corners of a box; sides at infinity end with the drawn space."""
    ends = np.array(box).reshape(3, 2)
    return (
        np.where(np.isfinite(ends[:, 0]), ends[:, 0], low),
        np.where(np.isfinite(ends[:, 1]), ends[:, 1], high),
    )


def _wires(axis: Axes3D, low: Array, high: Array) -> None:
    """Draw the twelve edges of a box."""
    ends, label = np.array([low, high]), "box"
    for along, pair in product(range(3), product((0, 1), repeat=2)):
        edge = np.empty((2, 3))
        edge[:, along] = ends[:, along]
        for other, side in zip([k for k in range(3) if k != along], pair, strict=True):
            edge[:, other] = ends[side, other]
        axis.plot(*edge.T, color=VERMILION, linewidth=0.8, label=label)
        label = "_"
