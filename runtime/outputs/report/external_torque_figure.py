"""Figure of the external torque of a log with its thresholds and contacts."""

from pathlib import Path

import numpy as np

from runtime.files import replacing
from runtime.monitoring.observation import Observation
from runtime.outputs.report.decimation import thinned
from runtime.outputs.report.log_figure import POINTS, picture_format
from runtime.outputs.report.style import BLUE, GREY, VERMILION, blank, settings


def draw_external_torque(
    observation: Observation, names: tuple[str, ...], units: tuple[str, ...], path: Path
) -> None:
    """Write a figure with one panel per joint: r, its thresholds, contacts shaded."""
    suffix, t = picture_format(path), observation.t
    rows = np.arange(0, len(t), max(1, len(t) // POINTS))
    with blank((10.0, 1.2 + 1.1 * len(names)), settings(), dpi=110) as figure:
        axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
        for j, (axis, name, unit) in enumerate(zip(axes, names, units, strict=True)):
            for contact in observation.contacts:
                if contact.number == j:
                    axis.axvspan(contact.time_s, contact.end_s, color=VERMILION, alpha=0.3, lw=0)
            axis.plot(*thinned(t, observation.r[:, j], POINTS), color=BLUE, linewidth=0.8)
            for sign in (1, -1):
                axis.plot(t[rows], sign * observation.threshold[rows, j], color=GREY, linewidth=0.8)
            axis.set_title(f"{name} [{unit.replace('*', '·')}]")
            axis.margins(x=0)
        axes[-1].set_xlabel("t [s]")
        figure.suptitle(
            "external torque (blue), thresholds (grey), contacts (shaded)",
            fontsize=9,
            x=0.01,
            ha="left",
        )
        with replacing(path) as file:
            figure.savefig(file, format=suffix)
