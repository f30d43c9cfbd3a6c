"""Files of a payload for the controllers of UR, KUKA, Kinova and xArm.

| file | content | units |
|---|---|---|
| `set_target_payload.script` | URScript `set_target_payload(m, cog, inertia)` | kg, m, kg·m² |
| `load_data.krl` | KUKA's structure LOAD: `M`, `CM`, `J` | kg, mm and degrees, kg·m² |
| `kinova_payload.json` | Kortex `PayloadInformation` | kg, m |
| `xarm_tcp_load.json` | arguments of xArm's `set_tcp_load` | kg, mm |

The centre of mass is in the frame of the mount; each controller expects that of its flange. UR
takes the inertia about the centre of mass with the axes of the flange, in the order xx, yy, zz,
xy, xz, yz. KUKA takes the moments J about the principal axes and their orientation A, B, C (turns
about z, y', x''). Kinova and xArm take no inertia.

Sources: URScript manual, set_target_payload; KUKA System Software, LOAD; Kortex API,
ControlConfig.SetPayloadInformation; xArm-Python-SDK, set_tcp_load.
"""

import json

import numpy as np

from runtime.identification.payload.body import Body
from runtime.library import Array

VENDOR_FILES = (
    *("set_target_payload.script", "load_data.krl"),
    *("kinova_payload.json", "xarm_tcp_load.json"),
)
MM = 1e3
"""Millimetres per metre."""


def vendor_texts(body: Body) -> dict[str, str]:
    """Name → content of the files."""
    m, (x, y, z) = float(body.mass), (float(c) for c in body.com)
    texts = (
        ur_script(body),
        kuka_load(body),
        _json({"payload_mass": m, "payload_mass_center": {"x": x, "y": y, "z": z}}),
        _json({"weight": m, "center_of_gravity": [MM * x, MM * y, MM * z]}),
    )
    return dict(zip(VENDOR_FILES, texts, strict=True))


def ur_script(body: Body) -> str:
    """URScript that sets mass [kg], centre of mass [m] and inertia about it [kg·m²]."""
    inertia = body.values[4:]
    return f"set_target_payload({digits(body.mass)}, [{_list(body.com)}], [{_list(inertia)}])\n"


def kuka_load(body: Body) -> str:
    """Line of KRL with mass [kg], centre of mass [mm], principal axes [deg], moments [kg·m²]."""
    moments, axes = principal_axes(body.inertia)
    frame = zip("XYZABC", (*(MM * body.com), *np.degrees(kuka_angles(axes))), strict=True)
    place = ",".join(f"{name} {digits(value)}" for name, value in frame)
    inertia = ",".join(f"{n} {digits(v)}" for n, v in zip("XYZ", moments, strict=True))
    return f"LOAD_DATA[1]={{M {digits(body.mass)},CM {{{place}}},J {{{inertia}}}}}\n"


def principal_axes(inertia: Array) -> tuple[Array, Array]:
    """I = R diag(J) Rᵀ with det R = 1, each principal axis assigned to its nearest coordinate axis.

    inertia (3, 3) → (3,).
    """
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


def _json(facts: dict[str, object]) -> str:
    return json.dumps(facts, indent=1, allow_nan=False) + "\n"
