"""A C header with what was identified, for programs on the robot's generated C.

<robot>_torque_base(q, dq, ddq, <robot>_identified_beta, tau)  and its like take the arrays as
they are.
"""

import re
import textwrap

import numpy as np

from runtime.library import Array
from runtime.library.parameters import PI_NAMES
from runtime.outputs.model_files.bodies import digits
from runtime.outputs.model_files.model import Model


def header_arrays(model: Model) -> dict[str, Array]:
    """π, λ, β and φ (n, k) where there is some, by the ends of their names in C."""
    lib = model.lib
    found = {
        "pi": model.pi,
        "lam": lib.lam_from_pi(model.pi),
        "beta": lib.base_matrix @ model.pi,
    }
    if model.drive.values is not None:
        found["friction"] = model.drive.values
    return found


def header_text(model: Model) -> str:
    """static const double arrays with 17 digits."""
    lib, drive = model.lib, model.drive
    name = f"{lib.name}_identified"
    guard = f"{name.upper()}_H"
    says = {
        "pi": f"per link: {', '.join(PI_NAMES)}; kg, kg m, kg m^2 about the link origin",
        "lam": "per link: ln m, centre of mass, rotation vector, a, b, c",
        "beta": "base parameters, K pi",
        "friction": f"per joint: {', '.join(drive.names)}; N m per unit of the column",
    }
    lines = [
        *(f" * {_safe(line)}" for line in model.comment("Parameters")),
        " * A link counts all bodies that are fixed to it.",
        f" * joints: {', '.join(map(_safe, lib.joint_names))}",
        f" * links: {', '.join(map(_safe, lib.link_names))}",
    ]
    parts = [f"#ifndef {guard}", f"#define {guard}", "", "/*", *lines, " */", ""]
    for key, values in header_arrays(model).items():
        shape = "".join(f"[{size}]" for size in values.shape)
        parts += [f"/* {_safe(says[key])} */", f"static const double {name}_{key}{shape} = {{"]
        parts += [_rows(values), "};", ""]
    return "\n".join([*parts, f"#endif /* {guard} */", ""])


def _rows(values: Array) -> str:
    if values.ndim > 1:
        return "\n".join(f"    {{{', '.join(map(digits, each))}}}," for each in values)
    text = ", ".join(map(digits, np.ravel(values)))
    return textwrap.indent(textwrap.fill(text, 92), "    ")


def _safe(line: str) -> str:
    """Text that cannot end a comment, in ASCII."""
    return re.sub(r"\*/|/\*", "* /", line).encode("ascii", "replace").decode()
