"""A trajectory as one picture: every joint's motion inside its limits, and how much it uses.

Left of each row the position with its limits; right the shares of position, velocity,
acceleration and jerk limits over time, and what the certificate proves of them.
"""

from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from runtime.atomic import replacing
from runtime.certificate import KINDS, certificate
from runtime.excitation import Safety, Trajectory
from runtime.library import Library

Array = NDArray[np.float64]

PALETTE = {
    "position": "#0072B2",
    "velocity": "#E69F00",
    "acceleration": "#009E73",
    "jerk": "#CC79A7",
}
"""Okabe and Ito, told apart with any colour vision."""
DASHES = {"position": "-", "velocity": "--", "acceleration": "-.", "jerk": ":"}
"""For prints without colour."""
LIMIT, INK, GREY = "#D55E00", "#222222", "#BBBBBB"
SAMPLES = 1001

_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8,
    "text.parse_math": False,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.formatter.useoffset": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.5,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
}


def write_picture(
    lib: Library, trajectory: Trajectory, path: Path, safety: Safety | None = None
) -> None:
    """Draw the trajectory as PNG, atomically; the title tells its certificate under `safety`.

    Raises:
        IdentificationError: the trajectory is not one of this robot.
        RuntimeFault: the place cannot be written.
    """
    proof = certificate(lib, trajectory, safety)
    t = np.linspace(0.0, trajectory.duration, SAMPLES)
    motion = trajectory.at(lib, t)
    shares = uses(lib, trajectory, motion)
    n = lib.n_joints
    with style.context(["default", _STYLE]):
        figure = Figure(figsize=(10.0, 1.4 + 1.25 * n), layout="constrained", dpi=130)
        rows = figure.subplots(n, 2, sharex=True, squeeze=False)
        for j, (left, right) in enumerate(rows):
            _position(left, lib, j, t, motion[0][:, j])
            for kind, share in shares.items():
                line = {"color": PALETTE[kind], "linestyle": DASHES[kind], "label": kind}
                right.plot(t, 100 * share[:, j], **line)
            right.axhline(100, color=LIMIT, linewidth=1.0)
            right.set_ylim(0, max(108.0, 104 * np.nan_to_num(_peak(shares, j))))
            right.set_yticks([0, 50, 100])
            right.margins(x=0)
        rows[0, 1].set_title("use of limits [%]")
        for axis in rows[-1]:
            axis.set_xlabel("time [s]")
        handles, labels = rows[0, 1].get_legend_handles_labels()
        handles.append(rows[0, 1].lines[-1])
        figure.legend(handles, [*labels, "limit"], loc="outside lower center", ncols=5)
        verdict = "hold at every instant" if proof.holds else "do NOT all hold"
        parts = [f"{u.kind} {100 * u.bound:.1f} % ({u.where})" for u in proof.uses]
        figure.suptitle(
            f"{lib.name}, {trajectory.duration:g} s: limits {verdict}\n"
            + "\n".join("  ·  ".join(parts[k : k + 5]) for k in range(0, len(parts), 5)),
            fontsize=9,
            x=0.01,
            ha="left",
        )
        with replacing(path) as file:
            figure.savefig(file, format="png", metadata={"Software": None})


def uses(lib: Library, trajectory: Trajectory, motion: tuple[Array, ...]) -> dict[str, Array]:
    """|value| / limit at samples per kind that the robot limits, each (N, n).

    The position counts from home, as in `runtime.certificate`.

    Args:
        lib: of n joints.
        trajectory: its motion.
        motion: q, dq, ddq, dddq, each (N, n).
    """
    limits = lib.limits()
    way = motion[0] - trajectory.home
    up, down = limits["upper"] - trajectory.home, trajectory.home - limits["lower"]
    shares = {"position": np.maximum(way / up, -way / down)}
    for kind, values in zip(KINDS[1:], motion[1:], strict=True):
        shares[kind] = np.abs(values) / limits[kind]
    free = {"position": np.isinf(up) & np.isinf(down)}
    free |= {kind: np.isinf(limits[kind]) for kind in KINDS[1:]}
    return {kind: share for kind, share in shares.items() if not free[kind].all()}


def _peak(shares: dict[str, Array], joint: int) -> float:
    return max((float(share[:, joint].max()) for share in shares.values()), default=0.0)


def _position(axis: Axes, lib: Library, joint: int, t: Array, q: Array) -> None:
    limits = lib.limits()
    for value in (limits["lower"][joint], limits["upper"][joint]):
        if np.isfinite(value):
            axis.axhline(value, color=LIMIT, linewidth=1.0)
    axis.axhline(q[0], color=GREY, linewidth=0.8)
    axis.plot(t, q, color=PALETTE["position"])
    axis.set_title(f"{lib.joint_names[joint]}  [{lib.manifest.joints[joint].unit}]")
    axis.margins(x=0, y=0.08)
