"""Figures of a designed motion, and its profile beside its limits, from which they are drawn.

`NAME.png`: q, dq, ddq and torque of every joint with their limits (Fig. A.2 of the document), and
the use of all limits. `NAME-speed.png`: dq over q with velocity limits that depend on the position.
`NAME-space.png`: path of the tip and distances.

Values of a `MotionProfile` come from the robot's kernels and from the `constraints` of the design,
at equally spaced times. The certificate states what holds between them. In document mode, torque
and distances are not limited: they are included, and the certificate lists them as unchecked.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.distance_limits import Clearance
from runtime.excitation.limits.safety import Safety
from runtime.excitation.limits.torque_limits import TorqueLimit
from runtime.excitation.proof.certificate import KINDS, Certificate, CertifiedMotion
from runtime.library import Array, Library
from runtime.outputs.report import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

SAMPLES = 1001  # number of times over the motion; with the ends and the middle
_EDGE = 201  # number of points of the velocity bound over a range
CLOSEST = 4  # number of emphasised distances, those with the least distance − margin

NEAR = 0.3  # upper end of the panel where all emphasised distances fall below it [m]

BOLD = ((canvas.BLUE, "-"), (canvas.ORANGE, "--"), (canvas.GREEN, "-."), (canvas.PURPLE, ":"))

TITLES = {
    "self-collision": "distance between links [m]",
    "table": "height above the table [m]",
    "obstacle": "distance from obstacles [m]",
}


@dataclass(frozen=True, slots=True)
class Band:
    """Lower and upper ends per joint, (n,); ±inf without a limit."""

    lower: Array
    upper: Array


@dataclass(frozen=True, slots=True)
class Gap:
    """A distance over time, (N,) m, and the margin that it keeps; `kind` as in certificates."""

    kind: str
    label: str
    values: Array
    margin: float

    @property
    def least(self) -> float:
        """Smallest distance, m."""
        return float(self.values.min())

    @property
    def left(self) -> float:
        """Smallest distance − margin, m."""
        return self.least - self.margin


@dataclass(frozen=True, slots=True)
class Envelope:
    """Velocities that a joint may have over its range: (K,) each, inf where unlimited."""

    q: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, slots=True)
class MotionProfile:
    """A motion at N times, beside its limits."""

    robot: str  # name of the robot
    joints: tuple[str, ...]  # n names
    units: tuple[str, ...]  # rad or m per joint
    t: Array  # (N,) s, from 0 to t_f
    motion: dict[str, Array]  # q, dq, ddq, dddq, torque (viscous friction where known), (N, n)
    bands: dict[str, Band]  # limits by the same names; of the torque the share, less Coulomb
    shares: dict[str, Array]  # use of the limits per kind that the robot limits, (N, n) each
    tip: Array  # (N, 3) m in the base frame
    table: float | None  # height of a plane, m; None without
    box: tuple[float, ...] | None  # xmin, xmax, ymin, ymax, zmin, zmax of the tip, m; None without
    gaps: tuple[Gap, ...]  # distances between links and above the table
    envelopes: tuple[Envelope, ...]  # one per joint
    has_friction: bool  # friction is part of the torque
    certificate: Certificate  # bounds over all t


def profile_of(certified: CertifiedMotion, samples: int = SAMPLES) -> MotionProfile:
    """Everything that pictures of a motion show, at equally spaced times."""
    lib, trajectory, safety = certified.lib, certified.trajectory, certified.safety
    t = np.linspace(0.0, trajectory.duration, samples)
    motion = np.array(trajectory.at(lib, t))
    limits = lib.limits()
    bands = {
        "position": Band(limits["lower"], limits["upper"]),
        **{kind: Band(-limits[kind], limits[kind]) for kind in KINDS[1:]},
    }
    envelopes = tuple(_envelopes(lib, bands))
    gaps: list[Gap] = []
    free = np.full(lib.n_joints, np.inf)
    torque_band = Band(-free, free)
    tau = lib.inverse_dynamics(motion[0], motion[1], motion[2], lib.pi0)
    for constraint in constraints(lib, trajectory.home, safety or Safety(torque_fraction=1.0)):
        if isinstance(constraint, TorqueLimit) and not constraint.order:
            tau, torque_band = constraint.smooth(motion), Band(-constraint.limit, constraint.limit)
        elif isinstance(constraint, Clearance):
            margins = np.broadcast_to(constraint.margin, len(constraint.labels))
            rows = zip(constraint.labels, constraint.distances(motion).T, margins, strict=True)
            gaps += [Gap(constraint.kind, label, row, float(least)) for label, row, least in rows]
    values = dict(zip(KINDS, motion, strict=True)) | {"torque": tau}
    bands["torque"] = torque_band
    return MotionProfile(
        robot=lib.name,
        joints=lib.joint_names,
        units=tuple(joint.unit for joint in lib.manifest.joints),
        t=t,
        motion=values,
        bands=bands,
        shares=_uses(values, bands, trajectory.home),
        tip=lib.end_effector(motion[0])[:, :3, 3],
        table=safety.table if safety else None,
        box=safety.box if safety else None,
        gaps=tuple(gaps),
        envelopes=envelopes,
        has_friction=safety is not None and bool(safety.viscous or safety.coulomb),
        certificate=certified.certificate,
    )


def _uses(values: dict[str, Array], bands: dict[str, Band], home: Array) -> dict[str, Array]:
    """Uses |value| / limit per kind that the robot limits; the position counts from home."""
    shares = {}
    for kind, value in values.items():
        start = home if kind == "position" else 0.0
        up, down = bands[kind].upper - start, start - bands[kind].lower
        if np.isfinite(up).any() or np.isfinite(down).any():
            shares[kind] = np.maximum((value - start) / up, (start - value) / down)
    return shares


def _envelopes(lib: Library, bands: dict[str, Band]) -> Iterator[Envelope]:
    """Bounds dq ≤ min(limit, √(k (q̂ − q)) − c), and likewise downwards; or the limit alone."""
    for j in range(lib.n_joints):
        low, high = bands["position"].lower[j], bands["position"].upper[j]
        fast = bands["velocity"].upper[j]
        facts = lib.braking
        if facts is None or not np.isfinite([low, high]).all():
            q = np.array([low, high])
            yield Envelope(q, np.full(2, -fast), np.full(2, fast))
            continue
        q = np.linspace(max(low, facts.lower[j]), min(high, facts.upper[j]), _EDGE)
        up = np.sqrt(facts.k[j] * (facts.upper[j] - q)) - facts.c[j]
        down = np.sqrt(facts.k[j] * (q - facts.lower[j])) - facts.c[j]
        yield Envelope(q, -np.minimum(fast, down), np.minimum(fast, up))


def draw_space(figure: "Figure", profile: MotionProfile) -> None:
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
    canvas.heading(figure, f"{profile.robot}, {profile.t[-1]:g} s: path of the tip and distances")


def _distances(axis: "Axes", profile: MotionProfile, gaps: list[Gap]) -> None:
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
        axis.plot(profile.t, gap.values, color=canvas.GREY, linewidth=0.6)
    for gap, (colour, dashes) in zip(bold, BOLD, strict=False):
        label = f"{gap.label}: {1e3 * gap.least:.1f} / {1e3 * gap.margin:g} mm"
        axis.plot(profile.t, gap.values, color=colour, linestyle=dashes, label=label, zorder=3)
    for margin in sorted({gap.margin for gap in gaps}):
        worst = min(gap.left for gap in gaps if gap.margin == margin)
        axis.axhline(margin, color=canvas.VERMILION, linewidth=1.0)
        if worst < 0:
            least = min(0.0, margin + worst)
            axis.axhspan(least, margin, color=canvas.VERMILION, alpha=0.12, linewidth=0)
    top = min(max(gap.values.max() for gap in bold), max(NEAR, 2 * bold[-1].least))
    low = min(0.0, *(gap.least for gap in gaps))
    axis.set_ylim(low - 0.03 * (top - low), 1.02 * top)
    axis.plot([], [], color=canvas.VERMILION, linewidth=1.0, label="margin")
    if others:
        axis.plot([], [], color=canvas.GREY, linewidth=0.6, label=f"{len(others)} others")
    axis.legend(
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
        fontsize=7,
        title="least / margin",
        title_fontsize=7,
        alignment="left",
    )


def _path(axis: "Axes3D", profile: MotionProfile) -> None:
    """Draw path, start and half time with equal scales, and the shadow on the table or floor."""
    tip, middle = profile.tip, profile.tip[len(profile.tip) // 2]
    low, high = _room(profile)
    floor = profile.table if profile.table is not None else low[2]
    axis.plot(tip[:, 0], tip[:, 1], np.full(len(tip), floor), color=canvas.GREY, linewidth=0.8)
    axis.plot(*tip.T, color=canvas.BLUE, label="tip")
    axis.plot(*tip[:1].T, "o", color=canvas.GREEN, markersize=7, label="start and end")
    axis.plot(*middle[:, None], "s", color=canvas.ORANGE, markersize=5, label="half time")
    if profile.table is not None:
        x, y = np.meshgrid([low[0], high[0]], [low[1], high[1]])
        axis.plot_surface(x, y, np.full((2, 2), floor), color=canvas.SKY, alpha=0.25, label="table")
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


def _wires(axis: "Axes3D", low: Array, high: Array) -> None:
    """Draw the twelve edges of a box."""
    ends, label = np.array([low, high]), "box"
    for along, pair in product(range(3), product((0, 1), repeat=2)):
        edge = np.empty((2, 3))
        edge[:, along] = ends[:, along]
        for other, side in zip([k for k in range(3) if k != along], pair, strict=True):
            edge[:, other] = ends[side, other]
        axis.plot(*edge.T, color=canvas.VERMILION, linewidth=0.8, label=label)
        label = "_"


LINES = {  # colour and line style, which is also distinguishable in black and white
    "position": (canvas.BLUE, "-"),
    "velocity": (canvas.ORANGE, "--"),
    "acceleration": (canvas.GREEN, "-."),
    "jerk": (canvas.PURPLE, ":"),
    "torque": (canvas.INK, "-"),
}
PER_SECOND = {"position": "", "velocity": "/s", "acceleration": "/s²"}
FAR = 3.0  # largest drawn limit, in peaks of the curve; larger ones stand in the title
DPI = 130
_ACROSS = 4
_WIDE = 1000.0  # position beyond the range of any joint [rad, m]


def write_pictures(profile: MotionProfile, path: Path) -> tuple[Path, ...]:
    """Write the figures of a motion as PNG files, each complete or not at all."""
    n = len(profile.joints)
    drawings = (
        ((15.0, 1.6 + 1.2 * n), draw_motion),
        ((12.0, 1.0 + 2.4 * -(-n // _ACROSS)), draw_speed),
        ((13.0, 5.6), draw_space),
    )
    pictures = picture_paths(path)
    for file, (size, draw) in zip(pictures, drawings, strict=True):
        with canvas.picture(file, size, DPI) as figure:
            draw(figure, profile)
    return pictures


def picture_paths(path: Path) -> tuple[Path, ...]:
    """Files that `write_pictures` writes."""
    suffixes = "", "-speed", "-space"
    return tuple(path.with_name(f"{path.stem}{suffix}{path.suffix}") for suffix in suffixes)


def draw_motion(figure: "Figure", profile: MotionProfile) -> None:
    """Draw one row per joint: q, dq, ddq, torque and use of limits over time."""
    kinds = (*PER_SECOND, "torque")
    rows = figure.subplots(len(profile.joints), len(kinds) + 1, sharex=True, squeeze=False)
    for j, row in enumerate(rows):
        for kind, axis in zip(kinds, row, strict=False):
            colour, _ = LINES[kind]
            axis.plot(profile.t, profile.motion[kind][:, j], color=colour)
            note = _limits(axis, profile.bands[kind], j)
            name = f"{profile.joints[j]}   " if kind == "position" else ""
            axis.set_title(name + note, color=canvas.INK if name else canvas.VERMILION)
            axis.set_ylabel(_unit(profile, kind, j))
        row[0].axhline(profile.motion["position"][0, j], color=canvas.GREY, linewidth=0.8, zorder=1)
        _shares(row[-1], profile, j)
        for axis in row:
            axis.margins(x=0)
    torque = "torque with friction" if profile.has_friction else "torque"
    for head, axis in zip((*PER_SECOND, torque, "use of limits"), rows[0], strict=True):
        axis.set_title(head, loc="right", fontweight="bold")
    for axis in rows[-1]:
        axis.set_xlabel("time [s]")
    handles, labels = rows[0, -1].get_legend_handles_labels()
    handles.append(rows[0, -1].lines[-1])
    figure.legend(handles, [*labels, "limit"], loc="outside lower left", ncols=6)
    verdict = "hold at every instant" if profile.certificate.holds else "do NOT all hold"
    parts = [f"{u.kind} {100 * u.bound:.1f} % ({u.where})" for u in profile.certificate.uses]
    lines = ["  ·  ".join(parts[k : k + 6]) for k in range(0, len(parts), 6)]
    if profile.certificate.unchecked:
        lines.append(f"NOT checked: {', '.join(profile.certificate.unchecked)}")
    head = f"{profile.robot}, {profile.t[-1]:g} s: limits {verdict}"
    canvas.heading(figure, "\n".join([head, *lines]))


def _unit(profile: MotionProfile, kind: str, joint: int) -> str:
    unit = profile.units[joint]
    return ("N·m" if unit == "rad" else "N") if kind == "torque" else unit + PER_SECOND[kind]


def _limits(axis: "Axes", band: Band, joint: int) -> str:
    """Draw lines at the limits; return the text of limits that are too far away to draw."""
    low, high = axis.get_ylim()
    size = max(abs(low), abs(high))
    far = []
    for end in (band.lower[joint], band.upper[joint]):
        if np.isfinite(end) and abs(end) <= FAR * size:
            axis.axhline(end, color=canvas.VERMILION, linewidth=1.0)
        elif np.isfinite(end):
            far.append(float(end))
    axis.margins(y=0.08)
    if len(far) == 2 and far[0] == -far[1]:
        return f"limit ±{far[1]:.3g}"
    return f"limit {', '.join(f'{end:.3g}' for end in far)}" if far else ""


def _shares(axis: "Axes", profile: MotionProfile, joint: int) -> None:
    """Draw the use of every limit of one joint [%]."""
    peak = 0.0
    for kind, share in profile.shares.items():
        colour, dashes = LINES[kind]
        axis.plot(profile.t, 100 * share[:, joint], color=colour, linestyle=dashes, label=kind)
        peak = max(peak, float(np.nan_to_num(share[:, joint]).max()))
    axis.axhline(100, color=canvas.VERMILION, linewidth=1.0)
    axis.set_ylim(0, max(108.0, 104 * peak))
    axis.set_yticks([0, 50, 100])
    axis.set_ylabel("%")


def draw_speed(figure: "Figure", profile: MotionProfile) -> None:
    """Draw one panel per joint: dq over q, and the velocity limits at each position."""
    n = len(profile.joints)
    down = -(-n // _ACROSS)
    panels = figure.subplots(down, _ACROSS, squeeze=False).ravel()
    for j, axis in enumerate(panels[:n]):
        q, dq = profile.motion["position"][:, j], profile.motion["velocity"][:, j]
        edge = profile.envelopes[j]
        axis.plot(q, dq, color=canvas.BLUE, label="motion")
        axis.plot(q[0], dq[0], "o", color=canvas.GREEN, markersize=5, label="start and end")
        across = np.clip(edge.q, -_WIDE, _WIDE)
        inside = np.isfinite(edge.q).all()
        span = (q.min(), q.max()) if not inside else (edge.q[0], edge.q[-1])
        pad = 0.05 * (span[1] - span[0]) or 1.0
        for ends, label in ((edge.upper, "limit"), (edge.lower, None)):
            axis.plot(across, ends, color=canvas.VERMILION, linewidth=1.0, label=label)
        axis.fill_between(across, edge.lower, edge.upper, color=canvas.SKY, alpha=0.15, linewidth=0)
        for end in edge.q[[0, -1]] if inside else ():
            axis.axvline(end, color=canvas.VERMILION, linewidth=1.0)
        axis.set_xlim(span[0] - pad, span[1] + pad)
        axis.set_title(profile.joints[j])
        axis.set_xlabel(f"q [{profile.units[j]}]")
        axis.set_ylabel(f"dq [{profile.units[j]}/s]")
    for axis in panels[n:]:
        axis.set_axis_off()
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    canvas.heading(
        figure, f"{profile.robot}, {profile.t[-1]:g} s: velocity over position, with limits"
    )
