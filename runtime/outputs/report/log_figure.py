"""Figure of a log: time steps, q, dq and τ, with rests and gaps marked."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from runtime.identification.expected_accuracy.expected import Growth
from runtime.monitoring.observation import Observation
from runtime.outputs.report import canvas
from runtime.recording import Recording

POINTS = 4000  # largest number of points of one curve
_GAP = 10.0  # time step of a gap, in median time steps
_DASHES = ("-", "--", ":")


def draw_external_torque(
    observation: Observation, names: tuple[str, ...], units: tuple[str, ...], path: Path
) -> None:
    """Write a figure with one panel per joint: r, its thresholds, contacts shaded."""
    t = observation.t
    rows = np.arange(0, len(t), max(1, len(t) // POINTS))
    with canvas.picture(path, (10.0, 1.2 + 1.1 * len(names)), dpi=110) as figure:
        axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
        for j, (axis, name, unit) in enumerate(zip(axes, names, units, strict=True)):
            for contact in observation.contacts:
                if contact.number == j:
                    axis.axvspan(
                        contact.time_s, contact.end_s, color=canvas.VERMILION, alpha=0.3, lw=0
                    )
            curve = canvas.thinned(t, observation.r[:, j], POINTS)
            axis.plot(*curve, color=canvas.BLUE, linewidth=0.8)
            for sign in (1, -1):
                bound = sign * observation.threshold[rows, j]
                axis.plot(t[rows], bound, color=canvas.GREY, linewidth=0.8)
            axis.set_title(f"{name} [{unit.replace('*', '·')}]")
            axis.margins(x=0)
        axes[-1].set_xlabel("t [s]")
        canvas.heading(figure, "external torque (blue), thresholds (grey), contacts (shaded)")


def draw_growth(growth: Growth, path: Path) -> None:
    """Write two panels over time: σ of every mass, and σ of the worst base parameter."""
    with canvas.picture(path, (10.0, 4.6), dpi=130) as figure:
        masses, worst = figure.subplots(1, 2, sharex=True)
        for k, (name, sigma) in enumerate(zip(growth.links, growth.masses.T, strict=True)):
            style = _DASHES[k // len(canvas.CYCLE) % len(_DASHES)]
            colour = canvas.CYCLE[k % len(canvas.CYCLE)]
            masses.plot(growth.seconds, 1e3 * sigma, color=colour, linestyle=style, label=name)
        is_known = np.isfinite(growth.payload)
        if is_known.any():
            masses.plot(
                growth.seconds[is_known],
                1e3 * growth.payload[is_known],
                color=canvas.INK,
                linewidth=2.0,
                label="payload of 1 kg on a known arm",
            )
        masses.set_title("σ of masses [g], MAP with the URDF as prior")
        worst.plot(growth.seconds, 100 * growth.worst, color=canvas.INK)
        worst.set_title(
            f"largest σ of a base parameter [% of its value]; at the end: {growth.worst_name}"
        )
        for axis in (masses, worst):
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axis.margins(x=0)
            axis.set_xlabel("recording time [s]")
            if growth.seconds[-1] > growth.recorded:
                span = growth.recorded, float(growth.seconds[-1])
                axis.axvspan(*span, color=canvas.GREY, alpha=0.25, linewidth=0)
        figure.legend(*masses.get_legend_handles_labels(), loc="outside lower left", ncols=4)
        further = f"; grey: {growth.further}" if growth.seconds[-1] > growth.recorded else ""
        canvas.heading(figure, f"{growth.robot}, {growth.motion}, {growth.recorded:.3g} s{further}")


def draw_log(recording: Recording, path: Path, rest: Sequence[tuple[float, float]] = ()) -> None:
    """Figure of a recording, a panel per signal, with rests (from, to) [s] and gaps shaded."""
    signals = {"q [rad or m]": recording.q, "dq": recording.dq, "τ [N·m or N]": recording.tau}
    panels = {title: values for title, values in signals.items() if values is not None}
    t, steps = recording.t, np.diff(recording.t)
    names = recording.joint_names or tuple(str(j + 1) for j in range(recording.n_joints))
    with canvas.picture(path, (10.0, 1.8 * (len(panels) + 1)), dpi=120) as figure:
        axes = figure.subplots(len(panels) + 1, 1, sharex=True, squeeze=False)[:, 0]
        if len(steps):
            curve = canvas.thinned(t[1:], 1e3 * steps, POINTS)
            axes[0].plot(*curve, color=canvas.BLUE, linewidth=0.6)
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
                colour = canvas.CYCLE[j % len(canvas.CYCLE)]
                axis.plot(*canvas.thinned(t, values[:, j], POINTS), color=colour, label=name)
            axis.set_title(title)
        gaps = np.flatnonzero(steps > _GAP * np.median(steps)) if len(steps) else steps[:0]
        for axis in axes:
            for start, end in rest:
                axis.axvspan(start, end, color=canvas.GREY, alpha=0.3, linewidth=0)
            for i in gaps:
                axis.axvspan(
                    t[int(i)], t[int(i) + 1], color=canvas.VERMILION, alpha=0.3, linewidth=0
                )
        axes[-1].set_xlabel("time [s]; grey: rest, red: gaps")
        axes[1].legend(loc="upper right", ncols=len(names), fontsize=6)
