"""Files of a payload: JSON, Franka's setLoad and Desk, a URDF link, other controllers' files.

| file | content | units |
|---|---|---|
| `set_load.json` | libfranka's `setLoad`: mass, F_x_Cload, inertia by columns | kg, m, kg·m² |
| `endeffector-config.json` | Desk: the same, name, pose of the end effector | kg, m, kg·m² |
| `set_target_payload.script` | URScript `set_target_payload(m, cog, inertia)` | kg, m, kg·m² |
| `load_data.krl` | KUKA's structure LOAD: `M`, `CM`, `J` | kg, mm and degrees, kg·m² |
| `kinova_payload.json` | Kortex `PayloadInformation` | kg, m |
| `xarm_tcp_load.json` | arguments of xArm's `set_tcp_load` | kg, mm |

The centre of mass is in the frame of the mount; each controller expects that of its flange. UR
takes the inertia about the centre of mass with the axes of the flange, in the order xx, yy, zz,
xy, xz, yz. KUKA takes the moments J about the principal axes and their orientation A, B, C (turns
about z, y', x''). Sources: libfranka's reference; Franka, "End effector commissioning"; URScript
manual; KUKA System Software, LOAD; Kortex API, SetPayloadInformation; xArm-Python-SDK.
"""

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from runtime.common.files import json_text, replacing
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.payload.body import FORMAT, NAMES, Body, Payload
from runtime.library import Array, Library

VENDOR_FILES = (
    *("set_target_payload.script", "load_data.krl"),
    *("kinova_payload.json", "xarm_tcp_load.json"),
)
MM = 1e3
FILES = (
    *("payload.json", "set_load.json", "endeffector-config.json", "payload.urdf"),
    *VENDOR_FILES,
)


def vendor_texts(body: Body) -> dict[str, str]:
    """Name → content of the files."""
    m, (x, y, z) = float(body.mass), (float(c) for c in body.com)
    texts = (
        f"set_target_payload({digits(m)}, [{_list(body.com)}], [{_list(body.values[4:])}])\n",
        kuka_load(body),
        json_text({"payload_mass": m, "payload_mass_center": {"x": x, "y": y, "z": z}}),
        json_text({"weight": m, "center_of_gravity": [MM * x, MM * y, MM * z]}),
    )
    return dict(zip(VENDOR_FILES, texts, strict=True))


def kuka_load(body: Body) -> str:
    """Line of KRL with mass [kg], centre of mass [mm], principal axes [deg], moments [kg·m²]."""
    moments, axes = principal_axes(body.inertia)
    frame = zip("XYZABC", (*(MM * body.com), *np.degrees(kuka_angles(axes))), strict=True)
    place = ",".join(f"{name} {digits(value)}" for name, value in frame)
    inertia = ",".join(f"{n} {digits(v)}" for n, v in zip("XYZ", moments, strict=True))
    return f"LOAD_DATA[1]={{M {digits(body.mass)},CM {{{place}}},J {{{inertia}}}}}\n"


def principal_axes(inertia: Array) -> tuple[Array, Array]:
    """I = R diag(J) Rᵀ, det R = 1; each principal axis goes to its nearest coordinate axis."""
    J, R = np.linalg.eigh(inertia)
    # Of the orders of the axes, the one with the largest |diagonal| has the smallest rotation.
    orders = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    best = max(orders, key=lambda order: float(np.abs(np.diagonal(R[:, order])).sum()))
    J, R = J[list(best)], R[:, list(best)]
    # Its sum is above 1, as the mean over the orders is Σ|R_ij|/3 ≥ Σ R_ij²/3 = 1; the trace of a
    # reflection is 1 at most. With a positive diagonal R is therefore a rotation.
    return J, R * np.where(np.diagonal(R) < 0, -1.0, 1.0)


def kuka_angles(R: Array) -> tuple[float, float, float]:
    """A, B, C [rad] of R = Rz(A) Ry(B) Rx(C); at B = ± 90° C is 0."""
    cosine = float(np.hypot(R[0, 0], R[1, 0]))
    b = float(np.arctan2(-R[2, 0], cosine))
    if cosine < 1e-12:  # rounding of a unit vector: A and C turn about the same axis
        return float(np.arctan2(-R[0, 1], R[1, 1])), b, 0.0
    return float(np.arctan2(R[1, 0], R[0, 0])), b, float(np.arctan2(R[2, 1], R[2, 2]))


def _list(values: Array) -> str:
    return ", ".join(map(digits, values))


def digits(value: float) -> str:
    """17 significant digits."""
    return f"{value + 0.0:.17g}"  # + 0.0 turns −0 into 0


def write_payload(payload: Payload, lib: Library, folder: Path, command: str = "") -> list[Path]:
    """Write `FILES` into a folder."""
    facts = load_facts(payload, lib) | {"command": command}
    texts = (
        json_text(facts),
        json_text(facts["set_load"]),
        json_text(facts["endeffector_config"]),
        payload_urdf(payload),
        *vendor_texts(payload.body).values(),
    )
    paths = [folder / name for name in FILES]
    for path, text in zip(paths, texts, strict=True):
        with replacing(path) as file:
            file.write(text.encode())
    return paths


def load_facts(payload: Payload, lib: Library) -> dict[str, Any]:
    """Facts of payload.json."""
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
