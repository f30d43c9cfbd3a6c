"""Figure of the expected standard deviations over recording time."""

from pathlib import Path

import numpy as np

from runtime.files import replacing
from runtime.identification.expected_accuracy import Growth
from runtime.outputs.report.log_figure import picture_format
from runtime.outputs.report.style import CYCLE, GREY, INK, blank, settings

_DASHES = ("-", "--", ":")


def draw_growth(growth: Growth, path: Path) -> None:
    """Write two panels over time: σ of every mass, and σ of the worst base parameter."""
    suffix = picture_format(path)
    with blank((10.0, 4.6), settings(), dpi=130) as figure:
        masses, worst = figure.subplots(1, 2, sharex=True)
        for k, (name, sigma) in enumerate(zip(growth.links, growth.masses.T, strict=True)):
            style = _DASHES[k // len(CYCLE) % len(_DASHES)]
            colour = CYCLE[k % len(CYCLE)]
            masses.plot(growth.seconds, 1e3 * sigma, color=colour, linestyle=style, label=name)
        is_known = np.isfinite(growth.payload)
        if is_known.any():
            masses.plot(
                growth.seconds[is_known],
                1e3 * growth.payload[is_known],
                color=INK,
                linewidth=2.0,
                label="payload of 1 kg on a known arm",
            )
        masses.set_title("σ of masses [g], MAP with the URDF as prior")
        worst.plot(growth.seconds, 100 * growth.worst, color=INK)
        worst.set_title("largest σ of a base parameter [% of its value]; "
                        f"at the end: {growth.worst_name}")  # fmt: skip
        for axis in (masses, worst):
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axis.margins(x=0)
            axis.set_xlabel("recording time [s]")
            if growth.seconds[-1] > growth.recorded:
                span = growth.recorded, float(growth.seconds[-1])
                axis.axvspan(*span, color=GREY, alpha=0.25, linewidth=0)
        figure.legend(*masses.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        further = f"; grey: {growth.further}" if growth.seconds[-1] > growth.recorded else ""
        figure.suptitle(
            f"{growth.robot}, {growth.motion}, {growth.recorded:.3g} s{further}",
            fontsize=9,
            x=0.01,
            ha="left",
        )
        with replacing(path) as file:
            figure.savefig(file, format=suffix)
