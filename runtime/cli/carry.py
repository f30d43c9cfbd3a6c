"""The option --carry of `symgen excite`: a body in the hand as numbers or as a file."""

from pathlib import Path

import numpy as np

from runtime.common.files import json_of
from runtime.errors import RecordingError
from runtime.excitation.limits.carried_body import CarriedBody, CarriedBox
from runtime.identification.payload.body import Mount, mount_of, pi_of_body
from runtime.identification.payload.known import KnownPayload, read_known_payload
from runtime.library import Array, Library

CARRY = (
    "Body in the hand, part of torques and distances; without it the hand is empty. "
    "MASS,CX,CY,CZ,LX,LY,LZ in the frame of the tip: mass in kg, centre in m, edges of a box "
    "around it in m; or a JSON with mass, com, inertia and box = [xmin, xmax, ymin, ymax, zmin, "
    "zmax], such as payload.json with a box added."
)
"""Help of the option."""
_WITH_BOX = 7
"""Numbers of a body with the edges of its box."""
_BOX = 6


def carried_body(lib: Library, text: str | None) -> CarriedBody | None:
    """Body of the option --carry in the frame of the link that carries it.

    A body whose inertia is not given is a homogeneous box, or a point mass without a box.
    """
    if text is None:
        return None
    body, box = _read(text)
    mount = mount_of(lib, body.link)
    if body.frame not in {"", mount.frame}:
        raise RecordingError(
            f"'{text}' gives the body in the frame '{body.frame}', and --carry takes "
            f"'{mount.frame}'; express centre of mass, inertia and box in that frame"
        )
    inertia = body.inertia if body.inertia is not None else _homogeneous(body.mass, box)
    in_frame = pi_of_body(mount.bodies, body.mass, body.com, inertia)
    pi = np.linalg.solve(mount.to_frame, in_frame)
    return CarriedBody(
        mount.index, tuple(pi.tolist()), None if box is None else _placed(mount, box)
    )


def _read(text: str) -> tuple[KnownPayload, Array | None]:
    """The body and its box, rows of lower and upper ends, (2, 3) m."""
    if Path(text).suffix == ".json":
        body = read_known_payload(text)
        return body, _box_of(json_of(Path(text)).get("box"), text)
    words = text.split(",")
    if len(words) != _WITH_BOX:
        try:
            return read_known_payload(text), None
        except RecordingError:
            raise _no_body(text) from None
    try:
        edges = np.array([float(word) for word in words[4:]])
        body = read_known_payload(",".join(words[:4]))
    except (ValueError, RecordingError):
        raise _no_body(text) from None
    return body, np.array([body.com - edges / 2, body.com + edges / 2])


def _box_of(entry: object, text: str) -> Array | None:
    if entry is None:
        return None
    try:
        ends = np.array(entry, dtype=float)
    except (TypeError, ValueError):
        ends = np.zeros(0)
    if ends.shape != (_BOX,) or not np.isfinite(ends).all() or not (ends[::2] < ends[1::2]).all():
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


def _placed(mount: Mount, box: Array) -> CarriedBox:
    center = mount.translation + mount.rotation @ box.mean(axis=0)
    return CarriedBox(
        tuple(center.tolist()),
        tuple(tuple(row) for row in mount.rotation.tolist()),
        tuple((box[1] - box[0]).tolist()),
    )


def _no_body(text: str) -> RecordingError:
    return RecordingError(
        "--carry needs MASS,CX,CY,CZ,LX,LY,LZ (kg and m), the same without edges, ten numbers with "
        f"the inertia, or a file that ends in .json; got '{text}'"
    )
