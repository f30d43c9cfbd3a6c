"""An identified or known payload: mass, centre of mass and inertia of a body, its mount on a link.

    c = h / m,   Σ_com = Σ − h hᵀ / m,   I_com = tr(Σ_com) 1 − Σ_com,   C_x = J C_π Jᵀ

The mount is a moving link and the frame in which the values are given. The pseudo-inertia of a body
is transformed from the frame F to that of its link by X = [[R, p], [0, 1]]:

    P_link = X P_F Xᵀ,  a linear map of π.   R, p: pose of F in the link's frame

A known payload is given as numbers MASS,CX,CY,CZ[,IXX,IYY,IZZ,IXY,IXZ,IYZ] or as a JSON in the form
of `payload.json`: mass [kg], com [m], inertia [3 × 3 kg·m²] or none, link.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import json_of
from runtime.common.tables import Table
from runtime.common.texts import numbers_of
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.convex.entropic_prior import Bodies, bodies_of
from runtime.estimators.regression.samples import NORMAL_95
from runtime.library import Array, Library
from runtime.library.parameters import inertia_entries, inertia_matrix, link_columns
from runtime.recording.notebook import Shown

FORMAT = 1  # number of the format of payload.json, raised by a change that readers would misread
_ROUNDING = 1e-9  # negative part of a principal moment, over the trace, that counts as rounding


@dataclass(frozen=True, slots=True)
class KnownPayload:
    """A payload of known mass and centre of mass."""

    mass: float  # kg
    com: Array  # centre of mass in the frame of the mount, (3,) m
    inertia: Array | None = None  # about the centre of mass, (3, 3) kg·m²; None where unknown
    link: str | None = None  # link that carries it; None is the link of the tip
    frame: str = ""  # frame of com and inertia; empty is that of the mount
    identified: bool = False  # True when it was identified from torques and cannot calibrate them

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass > 0):
            raise IdentificationError(
                f"expected a mass above 0 kg of the known payload, got {self.mass:g}; weigh it"
            )
        if np.shape(self.com) != (3,) or not np.isfinite(self.com).all():
            raise IdentificationError(
                "expected three finite numbers in m as centre of mass of the known payload, got "
                f"{np.asarray(self.com).tolist()}; measure it in the frame of the flange"
            )
        if self.inertia is None:
            return
        # Σ_com = ½ tr(I) 1 − I ⪰ 0 is physically consistent.
        tensor = np.asarray(self.inertia, dtype=float)
        wrong = (
            tensor.shape != (3, 3) or not np.isfinite(tensor).all() or (tensor != tensor.T).any()
        )
        if not wrong:
            trace = float(np.trace(tensor))
            smallest = np.linalg.eigvalsh(trace / 2 * np.eye(3) - tensor)[0]
            wrong = bool(smallest < -_ROUNDING * abs(trace))
        if wrong:
            raise IdentificationError(
                "the inertia of the known payload is not physically consistent (expected three "
                "rows of three in kg·m² about the centre of mass, symmetric, no principal moment "
                "above the sum of the others); correct it, or leave it out so that it is identified"
            )


def read_known_payload(text: str) -> KnownPayload:
    """Read a payload from an option: numbers, or the path of a JSON."""
    path = Path(text)
    if path.suffix == ".json":
        return _from_json(path)
    values = np.array(numbers_of(text))
    if len(values) not in {4, 10}:
        raise RecordingError(
            "expected the payload as MASS,CX,CY,CZ, or these and IXX,IYY,IZZ,IXY,IXZ,IYZ about the "
            f"centre of mass, or a file that ends in .json, got '{text}'; correct it"
        )
    inertia = inertia_matrix(values[4:]) if len(values) > 4 else None
    return KnownPayload(float(values[0]), values[1:4], inertia)


def read_payload_facts(path: Path) -> dict[str, Any]:
    """Facts of a payload.json, or of a JSON in its form that is written by hand."""
    facts = dict(json_of(path))
    number = facts.get("format", FORMAT)
    if isinstance(number, int) and number > FORMAT:
        raise RecordingError(
            f"'{path}' has the format {number}, expected {FORMAT}; update symgen, or identify the "
            "payload again with this version"
        )
    return facts


def _from_json(path: Path) -> KnownPayload:
    try:
        facts = read_payload_facts(path)
        inertia = facts.get("inertia")
        return KnownPayload(
            mass=float(facts["mass"]),
            com=np.array(facts["com"], dtype=float),
            inertia=None if inertia is None else np.array(inertia, dtype=float),
            link=None if facts.get("link") is None else str(facts["link"]),
            frame=str(facts.get("frame", "")),
            identified="sigma" in facts,
        )
    except (OSError, ValueError, KeyError, TypeError):
        raise RecordingError(
            f"'{path}' holds no payload; write a JSON with mass in kg, com = three numbers in m "
            "and, where it is known, inertia = three rows of three in kg·m²"
        ) from None


NAMES = ("mass", "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz")
"""Names of the ten values: kg, m ×3, kg·m² ×6, with the inertia about the centre of mass."""


@dataclass(frozen=True, slots=True)
class Mount:
    """A link and a frame on it."""

    link: str  # name of the moving link that the payload is fixed to
    index: int  # place of the link among the links
    frame: str  # name of the frame F of the values, the tip's or the link's
    rotation: Array  # R, (3, 3)
    translation: Array  # p, (3,) m
    to_frame: Array  # π in F from π in the link's frame, (10, 10)
    bodies: Bodies  # map from π to P(π) of one body

    @property
    def columns(self) -> slice:
        """Places of the link's ten columns in the regressor."""
        return link_columns(self.index)


def mount_of(lib: Library, link: str | None = None) -> Mount:
    """Mount on a named link, in the frame of the flange where the link carries it, else in its own.

    The flange is the tip, or lies before the tool of the robot's file, whose tip is named then.
    """
    known = lib.manifest
    tip, facts = known.tip, known.tip_frame
    if known.mount is not None and known.mount_frame is not None and link != tip:
        tip, facts = known.mount, known.mount_frame
    carrier = facts.link if link in {None, tip} else str(link)
    if carrier not in lib.link_names:
        raise IdentificationError(
            f"'{lib.name}' has no moving link '{carrier}'; choose one of "
            f"{', '.join(lib.link_names)}, or the tip {tip}"
        )
    index, on_tip = lib.link_names.index(carrier), carrier == facts.link
    rotation = np.array(facts.rotation) if on_tip else np.eye(3)
    translation = np.array(facts.translation) if on_tip else np.zeros(3)
    pose, bodies = np.eye(4), bodies_of(lib)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    back = np.linalg.inv(pose)
    # π ↦ π' with P(π') = X⁻¹ P(π) X⁻ᵀ, column by column of the basis.
    to_frame = bodies.pi_of(back @ bodies.basis @ back.T).T
    frame = tip if on_tip else carrier
    return Mount(carrier, index, frame, rotation, translation, to_frame, bodies)


@dataclass(frozen=True, slots=True)
class Body:
    """One body in one frame."""

    mass: float  # mass, kg
    com: Array  # centre of mass, (3,) m
    inertia: Array  # about the centre of mass, axes of the frame, (3, 3) kg·m²
    covariance: Array  # of (mass, com, xx, yy, zz, xy, xz, yz), (10, 10)

    @property
    def values(self) -> Array:
        """The ten values named by `NAMES`."""
        return np.array([self.mass, *self.com, *inertia_entries(self.inertia)])

    @property
    def sigma(self) -> Array:
        """Standard deviations of the ten values."""
        return np.sqrt(np.diagonal(self.covariance))


def body_of(bodies: Bodies, pi: Array, covariance: Array) -> Body:
    """Mass, centre of mass and inertia from π (10,), with their covariance by the delta method."""
    P = bodies.pseudo_inertia(pi)[0]
    m, h = float(P[3, 3]), P[:3, 3]
    inertia = _about((P[:3, :3] - np.outer(h, h) / m)[None])[0]
    slope = jacobian(bodies, pi)
    return Body(m, h / m, inertia, slope @ covariance @ slope.T)


def pi_of_body(bodies: Bodies, mass: float, com: Array, inertia: Array) -> Array:
    """π (10,) from mass, centre of mass (3,) and inertia (3, 3), the inverse of `body_of`."""
    P = np.zeros((4, 4))
    P[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia + mass * np.outer(com, com)
    P[:3, 3] = P[3, :3] = mass * com
    P[3, 3] = mass
    return bodies.pi_of(P)[0]


def jacobian(bodies: Bodies, pi: Array) -> Array:
    """∂(mass, com, xx, yy, zz, xy, xz, yz)/∂π: pi (10,) [kg, kg·m ×3, kg·m² ×6] → (10, 10)."""
    P, unit = bodies.pseudo_inertia(pi)[0], bodies.basis
    m, h = P[3, 3], P[:3, 3]
    dm, dh = unit[:, 3, 3], unit[:, :3, 3]
    d_com = (dh - np.outer(dm, h / m)) / m
    cross = dh[:, :, None] * h[None, None, :]
    d_sigma = unit[:, :3, :3] - (cross + np.swapaxes(cross, 1, 2)) / m
    d_inertia = _about(d_sigma + dm[:, None, None] * np.outer(h, h) / m**2)
    return np.vstack([dm, d_com.T, inertia_entries(d_inertia).T])


def _about(sigma: Array) -> Array:
    """tr(Σ) 1 − Σ, (n, 3, 3)."""
    traces = np.trace(sigma, axis1=1, axis2=2)
    return np.asarray(traces[:, None, None] * np.eye(3) - sigma)


@dataclass(frozen=True, slots=True)
class Payload(Shown):
    """An identified payload with its uncertainty.

    Attributes:
        mount: link and frame.
        pi: parameters in the link's frame, (10,) [kg, kg·m ×3, kg·m² ×6].
        covariance: of π for N_eff samples, (10, 10).
        body: mass, centre of mass and inertia in the mount's frame, covariance for N_eff samples.
        white: the same body with the covariance for white noise.
        offsets: b, (n,) N·m or N.
        noise: σ_j, (n,) N·m or N.
        n_samples: N, in the mean over the joints: rows in which a joint rests are left out.
        n_effective: N_eff.
        differential: True when a run without the payload was subtracted.
        prior_dominated: names of values that the prior determines rather than the data.
        arm: origin of the arm's model.
        status: one sentence.
        notes: sentences of advice.
        gain_error: standard deviation of the torque gains that the covariances include, by the
            residual.
    """

    mount: Mount
    pi: Array
    covariance: Array
    body: Body
    white: Body
    offsets: Array
    noise: Array
    n_samples: int
    n_effective: float
    differential: bool
    prior_dominated: tuple[str, ...]
    arm: str
    status: str
    notes: tuple[str, ...]
    gain_error: float

    @property
    def heading(self) -> str:
        """Link and frame of the values."""
        return f"Payload on {self.mount.link}, in the frame of {self.mount.frame}"

    def tables(self) -> tuple[Table, ...]:
        """The ten values with their 95 % intervals, for N_eff samples and for white noise."""
        units = ("kg", *("m",) * 3, *("kg·m²",) * 6)
        body, white = self.body, self.white
        rows = tuple(
            (
                name,
                f"{body.values[k]:.6g}",
                f"{NORMAL_95 * body.sigma[k]:.2g}",
                f"{NORMAL_95 * white.sigma[k]:.2g}",
                unit,
                "from the prior" if name in self.prior_dominated else "",
            )
            for k, (name, unit) in enumerate(zip(NAMES, units, strict=True))
        )
        head = ("value", "estimate", "± 95 %", "± 95 % white noise", "unit", "")
        return (Table(head, rows, title=f"{self.heading}: {self.status}"),)
