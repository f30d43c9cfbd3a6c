"""Figure of a log: time steps, q, dq and τ, with rests and gaps marked."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from runtime.errors import RecordingError
from runtime.files import replacing
from runtime.outputs.report.decimation import thinned
from runtime.outputs.report.style import BLUE, CYCLE, GREY, VERMILION, blank, settings
from runtime.recording import Recording

FORMATS = ("png", "pdf", "svg")
POINTS = 4000
"""Largest number of points of one curve."""
_GAP = 10.0
"""Time step of a gap, in median time steps."""


def picture_format(path: Path) -> str:
    """Image format of a file name: png, pdf or svg."""
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in FORMATS:
        raise RecordingError(
            f"expected an image file with the suffix .{', .'.join(FORMATS)}, got '{path.name}'; "
            "rename it"
        )
    return suffix


def draw_log(recording: Recording, path: Path, rest: Sequence[tuple[float, float]] = ()) -> None:
    """Write a figure of a recording with one panel per signal; rests and gaps are shaded.

    rest (from, to) [s].
    """
    suffix = picture_format(path)
    signals = {"q [rad or m]": recording.q, "dq": recording.dq, "τ [N·m or N]": recording.tau}
    panels = {title: values for title, values in signals.items() if values is not None}
    t, steps = recording.t, np.diff(recording.t)
    names = recording.joint_names or tuple(str(j + 1) for j in range(recording.n_joints))
    with blank((10.0, 1.8 * (len(panels) + 1)), settings(), dpi=120) as figure:
        axes = figure.subplots(len(panels) + 1, 1, sharex=True, squeeze=False)[:, 0]
        if len(steps):
            axes[0].plot(*thinned(t[1:], 1e3 * steps, POINTS), color=BLUE, linewidth=0.6)
            median, most = 1e3 * float(np.median(steps)), 1e3 * float(steps.max())
            if most > _GAP * median:
                axes[0].set_yscale("log")
                axes[0].yaxis.set_major_formatter(lambda value, _: f"{value:g}")
                axes[0].yaxis.set_minor_formatter(lambda *_: "")
            else:
                axes[0].set_ylim(0.0, 1.1 * max(most, 1.5 * median))
        axes[0].set_title("time step [ms]")
        for axis, (title, values) in zip(axes[1:], panels.items(), strict=True):
            for j, name in enumerate(names):
                colour = CYCLE[j % len(CYCLE)]
                axis.plot(*thinned(t, values[:, j], POINTS), color=colour, label=name)
            axis.set_title(title)
        gaps = np.flatnonzero(steps > _GAP * np.median(steps)) if len(steps) else steps[:0]
        for axis in axes:
            for start, end in rest:
                axis.axvspan(start, end, color=GREY, alpha=0.3, linewidth=0)
            for i in gaps:
                axis.axvspan(t[int(i)], t[int(i) + 1], color=VERMILION, alpha=0.3, linewidth=0)
        axes[-1].set_xlabel("time [s]; grey: rest, red: gaps")
        axes[1].legend(loc="upper right", ncols=len(names), fontsize=6)
        with replacing(path) as file:
            figure.savefig(file, format=suffix)
