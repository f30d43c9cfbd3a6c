"""β = K π by the recursion of Gautier & Khalil (Table 3.2 with Rules 1 and 2).

An oracle for the base parameters of serial arms with revolute joints in modified DH form.
Source: Gautier & Khalil, IEEE T-RA 6(3), 1990.
"""

import numpy as np
from numpy.typing import NDArray

from symgen.chain import Chain, Joint
from symgen.errors import RankError
from symgen.mechanics.inertia import N_PARAMETERS, PI_NAMES

Array = NDArray[np.float64]


def regrouped_base(chain: Chain) -> tuple[tuple[int, ...], Array]:
    """Columns and K by the recursion of Table 3.2 with Rules 1 and 2."""
    n = len(chain.joints)
    size = N_PARAMETERS * n
    rows = {
        (i, name): np.eye(size)[N_PARAMETERS * i + k]
        for i in range(n)
        for k, name in enumerate(PI_NAMES)
    }
    # rows[i, name] is the coefficient vector of an entry of link i; link n − 1 moves first, so that
    # each link has received the entries of its child before its own are moved to its parent.
    for i in range(n - 1, 0, -1):
        c, s, a, d = _modified_dh(chain.joints[i], i - 1)
        yy, mz, m = rows[i, "YY"], rows[i, "mZ"], rows[i, "m"]
        moved = {  # Table 3.2: what the parent's entries gain
            "XX": yy + 2 * d * mz + d**2 * m,
            "YY": c**2 * yy + 2 * d * c**2 * mz + (a**2 + d**2 * c**2) * m,
            "ZZ": s**2 * yy + 2 * d * s**2 * mz + (a**2 + d**2 * s**2) * m,
            "XY": a * s * mz + a * d * s * m,
            "XZ": -a * c * mz - a * d * c * m,
            "YZ": c * s * yy + 2 * d * c * s * mz + d**2 * c * s * m,
            "mX": a * m,
            "mY": -s * mz - d * s * m,
            "mZ": c * mz + d * c * m,
            "m": m,
        }
        for name, extra in moved.items():
            rows[i - 1, name] = rows[i - 1, name] + extra
        rows[i, "XX"] = rows[i, "XX"] - yy  # XX − YY stays; YY, mZ and m have left the link
        for name in ("YY", "mZ", "m"):
            del rows[i, name]
    _modified_dh(chain.joints[0], -1)
    silent = ["XX", "XY", "XZ", "YY", "YZ", "mZ", "m"]  # Rule 1
    if np.allclose(np.cross(_first_axis(chain), chain.gravity), 0):
        silent += ["mX", "mY"]  # Rule 2
    for name in silent:
        del rows[0, name]
    keys = sorted(rows, key=lambda key: (key[0], PI_NAMES.index(key[1])))
    columns = tuple(N_PARAMETERS * i + PI_NAMES.index(name) for i, name in keys)
    return columns, np.array([rows[key] for key in keys])


def _first_axis(chain: Chain) -> Array:
    return np.array(chain.joints[0].rotation) @ np.array(chain.joints[0].axis)


def _modified_dh(joint: Joint, parent: int) -> tuple[float, float, float, float]:
    """cos α, sin α, a, d of a joint placed by Rot_x(α) Trans_x(a) Trans_z(d)."""
    r, p = np.array(joint.rotation), np.array(joint.translation)
    c, s = r[2, 2], r[2, 1]
    d = -s * p[1] + c * p[2]
    in_form = (
        joint.kind != "prismatic"
        and joint.parent == parent
        and joint.axis == (0.0, 0.0, 1.0)
        and np.allclose(r, [[1, 0, 0], [0, c, -s], [0, s, c]], atol=1e-9)
        and np.allclose(p[1:], [-s * d, c * d], atol=1e-9)
    )
    if not in_form:
        raise RankError(
            f"joint '{joint.name}' is not a revolute joint in modified DH form, which the symbolic "
            "regrouping of Table 3.2 needs; use numeric_base"
        )
    return float(c), float(s), float(p[0]), float(d)
