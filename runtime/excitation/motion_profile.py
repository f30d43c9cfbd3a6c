"""Profile of a motion beside its limits, as plain arrays: everything that pictures of it show.

Values come from the robot's kernels and from the `constraints` of the design, at equally spaced
times. The certificate states what holds between them. In document mode, torque and distances are
not limited: they are included, and the certificate lists them as unchecked.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.distance_limits import Clearance
from runtime.excitation.limits.safety import Safety
from runtime.excitation.limits.torque_limits import TorqueLimit
from runtime.excitation.proof.certificate import KINDS, Certificate, CertifiedMotion
from runtime.library import Array, Library

SAMPLES = 1001  # number of times over the motion; with the ends and the middle
_EDGE = 201  # number of points of the velocity bound over a range


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
    limits = lib.limits()
    bands = {
        "position": Band(limits["lower"], limits["upper"]),
        **{kind: Band(-limits[kind], limits[kind]) for kind in KINDS[1:]},
        "torque": torque_band,
    }
    return MotionProfile(
        robot=lib.name,
        joints=lib.joint_names,
        units=tuple(joint.unit for joint in lib.manifest.joints),
        t=t,
        motion=values,
        bands=bands,
        shares=_shares(values, bands, trajectory.home),
        tip=lib.end_effector(motion[0])[:, :3, 3],
        table=safety.table if safety else None,
        box=safety.box if safety else None,
        gaps=tuple(gaps),
        envelopes=tuple(_envelopes(lib, bands)),
        has_friction=safety is not None and bool(safety.viscous or safety.coulomb),
        certificate=certified.certificate,
    )


def _shares(values: dict[str, Array], bands: dict[str, Band], home: Array) -> dict[str, Array]:
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
