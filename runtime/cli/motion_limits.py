"""Limits of a motion: their options, the body of --carry, and bands of model errors."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.cli.common import RobotChoices, numbers_option
from runtime.common.files import json_of
from runtime.common.settings import method_field, model_field
from runtime.common.texts import number_of
from runtime.errors import RecordingError, RuntimeFault
from runtime.estimators.convex.entropic_prior import bodies_of, prior_of
from runtime.estimators.prior_file import TRUST
from runtime.estimators.regression.samples import NORMAL_95
from runtime.excitation.limits.constraints import TABLE_MARGIN
from runtime.excitation.limits.safety import TABLE, CarriedBody, CarriedBox, Safety, read_obstacles
from runtime.identification.payload import body as bodies
from runtime.library import Array, Library
from runtime.library.parameters import link_columns

_WITH_BOX = 7  # count of the numbers of a body with the edges of its box
BOX = 6  # count of the numbers of --box, and of a box in a file
NO_TABLE = "none"  # value of --table where there is no table


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceChoices(RobotChoices):
    """Places that a moving robot keeps away from."""

    table: str | None = model_field(
        metavar="Z",
        help="Height of a table that the arm stays above, m in the base frame; none where "
        "there is no table. --export needs one of both.",
    )
    box: str | None = model_field(
        metavar="BOX",
        help="XMIN,XMAX,YMIN,YMAX,ZMIN,ZMAX of a box that the tip stays in, m in the base "
        "frame; inf leaves a side open.",
    )
    clearance: float | None = model_field(
        help="Least distance between links, above the table and from obstacles, m; default the "
        f"margins of the robot, {TABLE_MARGIN:g} above the table and from obstacles."
    )
    obstacles: Path | None = model_field(
        metavar="FILE",
        help="TOML of obstacles that the links keep away from: tables [\\[obstacle]] with "
        "name, center, size (edges), rpy and radius, m and rad in the base frame.",
    )

    @property
    def has_no_table(self) -> bool:
        """Whether the user states that there is no table."""
        return self.table == NO_TABLE

    def safety(self, **numbers: Any) -> Safety:
        """Limits besides those that the robot states."""
        return Safety(
            clearance=self.clearance,
            table=None if self.table is None or self.has_no_table else _height(self.table),
            box=None if self.box is None else numbers_option(self.box, BOX, "--box"),
            obstacles=() if self.obstacles is None else read_obstacles(self.obstacles),
            **numbers,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitChoices(PlaceChoices):
    """Limits of a designed motion."""

    unchecked: list[str] | None = model_field(
        metavar="LIMIT",
        help="Limit that --export may leave unchecked; repeatable: self-collision, table, "
        "carried-body, springs-of-unknown-stiffness; with --settings document=true torque, "
        "position-dependent-velocity, torque-rate and tip-speed too; all for every one.",
    )
    carry: str | None = model_field(
        metavar="BODY",
        help="Body in the hand, part of torques and distances; without it the hand is empty. "
        "MASS,CX,CY,CZ,LX,LY,LZ in the frame of the tip: mass in kg, centre in m, edges of a box "
        "around it in m; or a JSON with mass, com, inertia and box = [xmin, xmax, ymin, ymax, "
        "zmin, zmax], such as payload.json with a box added.",
    )
    torque_fraction: float = model_field(
        0.95, help="Fraction of the torque limits that the motion may use, 0 to 1."
    )
    viscous: str | None = model_field(
        metavar="FV",
        help="Viscous friction in the torque limits, N·m·s/rad or N·s/m: one number or one per "
        "joint with commas; default 0.",
    )
    coulomb: str | None = model_field(
        metavar="FC",
        help="Coulomb friction in the torque limits, N·m or N: one number or one per joint "
        "with commas; default 0.",
    )
    payload_band: str | None = method_field(
        metavar="MASS,REACH",
        help="The limits of torques hold for every payload that differs from --carry, or from "
        "an empty hand, by masses of ± MASS kg in all within REACH m of its centre, or of the "
        "tip.",
    )
    friction_band: float | None = method_field(
        metavar="PERCENT",
        help="The limits of torques hold for --settings viscous=FV and the setting coulomb ± "
        "PERCENT of both.",
    )
    model_band: str | None = method_field(
        metavar="TRUST",
        help="The limits of torques hold for all link parameters within the 95 % intervals of "
        "the inertial prior around the URDF: cad, gripper, none, or the trust κ itself.",
    )

    @property
    def accepted(self) -> list[str]:
        """Limits that the user allows to stay unchecked."""
        return [*(self.unchecked or ()), *([TABLE] if self.has_no_table else [])]

    def limits(self, lib: Library) -> Safety:
        """All limits besides those that the robot states."""
        body = carried_body(lib, self.carry)
        band = np.zeros(len(lib.pi0))  # half-widths of the parameters of all links
        if self.payload_band is not None:
            band += band_of_payload(lib, self.payload_band, body)
        if self.model_band is not None:
            band += band_of_prior(lib, self.model_band)
        return self.safety(
            torque_fraction=self.torque_fraction,
            viscous=_per_joint(lib, self.viscous, "the setting viscous"),
            coulomb=_per_joint(lib, self.coulomb, "the setting coulomb"),
            carried=body,
            band=tuple(band.tolist()) if band.any() else (),
            friction_band=(self.friction_band or 0.0) / 100,
        )


def _height(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise RuntimeFault(
            f"--table needs a height in m in the base frame, or none where there is no table, got "
            f"'{text}'"
        ) from None


def _per_joint(lib: Library, text: str | None, option: str) -> tuple[float, ...]:
    """One number or one per joint; empty where the option is not given."""
    return () if text is None else numbers_option(text, lib.n_joints if "," in text else 1, option)


def carried_body(lib: Library, text: str | None) -> CarriedBody | None:
    """Body of --carry in the frame of its link; without inertia a homogeneous box or a point."""
    if text is None:
        return None
    body, box = _body_and_box(text)
    mount = bodies.mount_of(lib, body.link)
    if body.frame not in {"", mount.frame}:
        raise RecordingError(
            f"'{text}' gives the body in the frame '{body.frame}', and --carry takes "
            f"'{mount.frame}'; express centre of mass, inertia and box in that frame"
        )
    inertia = body.inertia if body.inertia is not None else _homogeneous(body.mass, box)
    in_frame = bodies.pi_of_body(mount.bodies, body.mass, body.com, inertia)
    pi = np.linalg.solve(mount.to_frame, in_frame)
    return CarriedBody(mount.index, tuple(pi.tolist()), box if box is None else _placed(mount, box))


def _body_and_box(text: str) -> tuple[bodies.KnownPayload, Array | None]:
    """The body and its box, rows of lower and upper ends, (2, 3) m."""
    if Path(text).suffix == ".json":
        body = bodies.read_known_payload(text)
        return body, _box_of(json_of(Path(text)).get("box"), text)
    words = text.split(",")
    edges = words[4:] if len(words) == _WITH_BOX else []
    try:
        half = np.array([float(word) for word in edges]) / 2
        body = bodies.read_known_payload(",".join(words[:4]) if edges else text)
    except (ValueError, RecordingError):
        raise RecordingError(
            "--carry needs MASS,CX,CY,CZ,LX,LY,LZ (kg and m), the same without edges, ten numbers "
            f"with the inertia, or a file that ends in .json; got '{text}'"
        ) from None
    return body, np.array([body.com - half, body.com + half]) if edges else None


def _box_of(entry: object, text: str) -> Array | None:
    if entry is None:
        return None
    try:
        ends = np.array(entry, dtype=float)
    except (TypeError, ValueError):
        ends = np.zeros(0)
    if ends.shape != (BOX,) or not np.isfinite(ends).all() or not (ends[::2] < ends[1::2]).all():
        raise RecordingError(
            f"the box of '{text}' needs six finite numbers xmin, xmax, ymin, ymax, zmin, zmax in m "
            f"with each minimum below its maximum, got {entry}"
        )
    return np.array([ends[::2], ends[1::2]])


def _homogeneous(mass: float, box: Array | None) -> Array:
    """Inertia m/12 (|l|² 1 − diag(l²)) of a box with edges l about its centre, (3, 3) kg·m²."""
    if box is None:
        return np.zeros((3, 3))
    squares = (box[1] - box[0]) ** 2
    return np.asarray(mass / 12 * np.diag(squares.sum() - squares))


def _placed(mount: bodies.Mount, box: Array) -> CarriedBox:
    center = mount.translation + mount.rotation @ box.mean(axis=0)
    rotation, edges = mount.rotation.tolist(), (box[1] - box[0]).tolist()
    return CarriedBox(tuple(center.tolist()), tuple(map(tuple, rotation)), tuple(edges))


def band_of_prior(lib: Library, trust: str) -> Array:
    """95 % intervals (10 L,) of the prior around the URDF: σ² = diag (κ B)⁻¹, B its curvature."""
    kappa = TRUST.get(trust, number_of(trust))
    if kappa is None or not 0 < kappa < np.inf:
        raise RuntimeFault(
            f"the setting model_band needs {', '.join(TRUST)} or a trust above 0, got '{trust}'"
        )
    root = bodies_of(lib).spread(prior_of(lib).centre)
    return np.asarray(NORMAL_95 * np.sqrt((root**2).sum(axis=2) / kappa).ravel())


def band_of_payload(lib: Library, text: str, body: CarriedBody | None) -> Array:
    """Half-widths of the parameters of the link with the payload, (10 L,) [kg, kg·m, kg·m²].

    Masses of M in all, at places p with |p_i − c_i| ≤ r, change m by M, m c_i by M (|c_i| + r), and
    the inertia by M (|p|² 1 − p pᵀ) at most, entry by entry.
    """
    mass, reach = numbers_option(text, 2, "the setting payload_band")
    if not (0 < mass < np.inf and 0 <= reach < np.inf):
        raise RuntimeFault(
            f"the setting payload_band needs a mass above 0 kg and a reach from 0 m up, got "
            f"'{text}'"
        )
    mount = bodies.mount_of(lib)
    link, centre = mount.index, mount.translation
    if body is not None:
        link = body.link
        centre = np.array(body.pi[1:4]) / body.pi[0] if body.pi[0] > 0 else centre
    x, y, z = np.abs(centre) + reach
    moments = [y * y + z * z, x * x + z * z, x * x + y * y, x * y, x * z, y * z]
    band = np.zeros(len(lib.pi0))
    band[link_columns(link)] = mass * np.array([1.0, x, y, z, *moments])
    return band
