"""Files of a payload: JSON, Franka's setLoad and Desk, a URDF link, other controllers' files.

libfranka's `Robot::setLoad` takes mass [kg], F_x_Cload: flange to centre of mass [m], and the
inertia about the centre of mass [kg·m²], 9 numbers column by column; Desk's
`endeffector-config.json` holds the same with the pose of the end effector (16 numbers column by
column) and a name. Source: libfranka's reference; Franka, "End effector commissioning".
"""

import json
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from runtime.estimators.regression.residuals import NORMAL_95
from runtime.files import replacing
from runtime.identification.payload.body import NAMES, Body
from runtime.identification.payload.identified_payload import Payload
from runtime.identification.payload.known import FORMAT
from runtime.identification.payload.vendor_files import VENDOR_FILES, digits, vendor_texts
from runtime.library import Array, Library

FILES = (
    *("payload.json", "set_load.json", "endeffector-config.json", "payload.urdf"),
    *VENDOR_FILES,
)


def write_payload(payload: Payload, lib: Library, folder: Path, command: str = "") -> list[Path]:
    """Write `FILES` into a folder.

    Args:
        payload: identified payload.
        lib: library of the robot.
        folder: folder of the files; made where it is missing.
        command: command line.

    Returns:
        Paths of the files.

    Raises:
        RuntimeFault: the folder cannot be written.
    """
    facts = load_facts(payload, lib) | {"command": command}
    texts = (
        _json(facts),
        _json(facts["set_load"]),
        _json(facts["endeffector_config"]),
        payload_urdf(payload),
        *vendor_texts(payload.body).values(),
    )
    paths = [folder / name for name in FILES]
    for path, text in zip(paths, texts, strict=True):
        with replacing(path) as file:
            file.write(text.encode())
    return paths


def load_facts(payload: Payload, lib: Library) -> dict[str, Any]:
    """Facts of payload.json.

    Args:
        payload: identified payload.
        lib: library of the robot.

    Returns:
        JSON-ready values in SI units, in the frame of the mount; `pi_in_link` is in that of the
        link.
    """
    body, mount = payload.body, payload.mount
    return {
        "format": FORMAT,
        "robot": lib.name,
        "link": mount.link,
        "frame": mount.frame,
        "status": payload.status,
        "notes": list(payload.notes),
        "arm": payload.arm,
        "differential": payload.differential,
        "gain_error": payload.gain_error,
        "mass": body.mass,
        "com": body.com.tolist(),
        "inertia": body.inertia.tolist(),
        "names": list(NAMES),
        "values": body.values.tolist(),
        "sigma": body.sigma.tolist(),
        "interval95": _intervals(body),
        "sigma_white": payload.white.sigma.tolist(),
        "interval95_white": _intervals(payload.white),
        "prior_dominated": list(payload.prior_dominated),
        "pi_in_link": payload.pi.tolist(),
        "covariance_of_pi": payload.covariance.tolist(),
        "offsets": payload.offsets.tolist(),
        "noise": payload.noise.tolist(),
        "samples": payload.n_samples,
        "effective_samples": payload.n_effective,
        "set_load": {
            "load_mass": body.mass,
            "F_x_Cload": body.com.tolist(),
            "load_inertia": _by_column(body.inertia),
        },
        "endeffector_config": {
            "id": "payload",
            "name": "Payload",
            "color": "#808080",
            "mass": body.mass,
            "centerOfMass": body.com.tolist(),
            "transformation": _by_column(np.eye(4)),
            "inertia": _by_column(body.inertia),
        },
        "model_hash": lib.manifest.model_hash,
    }


def payload_urdf(payload: Payload) -> str:
    """A URDF of the payload's link, fixed to the frame of the mount, 17 significant digits."""
    body, root = payload.body, Element("robot", {"name": "payload"})
    SubElement(root, "link", {"name": payload.mount.frame})
    inertial = SubElement(SubElement(root, "link", {"name": "payload"}), "inertial")
    SubElement(inertial, "origin", {"xyz": " ".join(map(digits, body.com)), "rpy": "0 0 0"})
    SubElement(inertial, "mass", {"value": digits(body.mass)})
    names = (("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2))
    values = {f"i{name}": digits(body.inertia[i, j]) for name, i, j in names}
    SubElement(inertial, "inertia", values)
    joint = SubElement(root, "joint", {"name": "payload_mount", "type": "fixed"})
    SubElement(joint, "parent", {"link": payload.mount.frame})
    SubElement(joint, "child", {"link": "payload"})
    SubElement(joint, "origin", {"xyz": "0 0 0", "rpy": "0 0 0"})
    indent(root, space="  ")
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, "unicode") + "\n"


def _intervals(body: Body) -> list[list[float]]:
    half = NORMAL_95 * body.sigma
    return [[float(x - h), float(x + h)] for x, h in zip(body.values, half, strict=True)]


def _by_column(matrix: Array) -> list[float]:
    return [float(x) for x in matrix.ravel(order="F")]


def _json(facts: dict[str, Any]) -> str:
    return json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
