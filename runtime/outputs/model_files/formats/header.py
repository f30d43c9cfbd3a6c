"""A C header with the identified parameters, for programs that use the robot's generated C.

The arrays are arguments of functions such as
<robot>_torque_base(q, dq, ddq, <robot>_identified_beta, tau).
"""

import re
import textwrap

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array
from runtime.library.parameters import PI_NAMES
from runtime.outputs.model_files.bodies import digits
from runtime.outputs.model_files.engines import compiler
from runtime.outputs.model_files.engines.answer import random_states
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.reload_check import (
    TOLERANCE,
    torque_difference,
    unchecked,
    verified,
)


def header_arrays(model: IdentifiedModel) -> dict[str, Array]:
    """π (10 n,), λ (10 n,), β (b,) and, where known, φ (n, k), by the suffix of their C name."""
    lib = model.lib
    arrays = {
        "pi": model.pi,
        "lam": lib.lam_from_pi(model.pi),
        "beta": lib.base_matrix @ model.pi,
    }
    if model.friction.values is not None:
        arrays["friction"] = model.friction.values
    return arrays


def header_text(model: IdentifiedModel) -> str:
    """Header of static const double arrays with 17 significant digits."""
    lib, friction = model.lib, model.friction
    name = f"{lib.name}_identified"
    guard = f"{name.upper()}_H"
    meaning = {
        "pi": f"per link: {', '.join(PI_NAMES)}; kg, kg m, kg m^2 about the link origin",
        "lam": "per link: ln m, centre of mass, rotation vector, a, b, c",
        "beta": "base parameters, K pi",
        "friction": f"per joint: {', '.join(friction.terms.columns)}; N m per unit of the column",
    }
    lines = [
        *(f" * {comment_text(line)}" for line in model.comment("Parameters")),
        " * The parameters of a link include all bodies that are fixed to it.",
        f" * joints: {', '.join(map(comment_text, lib.joint_names))}",
        f" * links: {', '.join(map(comment_text, lib.link_names))}",
    ]
    parts = [f"#ifndef {guard}", f"#define {guard}", "", "/*", *lines, " */", ""]
    for key, values in header_arrays(model).items():
        shape = "".join(f"[{size}]" for size in values.shape)
        parts += [
            f"/* {comment_text(meaning[key])} */",
            f"static const double {name}_{key}{shape} = {{",
        ]
        parts += [array_rows(values), "};", ""]
    return "\n".join([*parts, f"#endif /* {guard} */", ""])


def check_header(model: IdentifiedModel, text: str) -> str:
    """Compile a header; its arrays must equal the identified ones bit for bit."""
    lib, expected_arrays = model.lib, header_arrays(model)
    names = {f"{lib.name}_identified_{key}": array.shape for key, array in expected_arrays.items()}
    arrays = compiler.read_back(text, names)
    if arrays is None:
        return unchecked(compiler.INSTALL)
    read = dict(zip(expected_arrays, arrays.values(), strict=True))
    for key, array in expected_arrays.items():
        if not np.array_equal(read[key], array):
            raise ExportError(
                f"not written: expected the identified {key} in the header, and a C compiler "
                "reads other numbers; report this as a fault of symgen"
            )
    q, dq, ddq = random_states(lib)
    expected = lib.inverse_dynamics(q, dq, ddq, model.pi)
    torques = {
        "pi": lib.inverse_dynamics(q, dq, ddq, read["pi"]),
        "lam": lib.torque(q, dq, ddq, read["lam"]),
        "beta": lib.base_regressor(q, dq, ddq) @ read["beta"],
    }
    worst = 0.0
    for key, tau in torques.items():
        worst = max(worst, difference := torque_difference(tau, expected))
        if not difference <= TOLERANCE:
            raise ExportError(
                f"not written: the torques of {key} differ by {difference:.1e} of the largest "
                f"torque, where {TOLERANCE:g} is allowed; run: python -m symgen build"
            )
    return verified("a C compiler", worst)


def array_rows(values: Array) -> str:
    """Elements of a C initialiser with 17 significant digits, one line per row of a matrix."""
    if values.ndim > 1:
        return "\n".join(f"    {{{', '.join(map(digits, each))}}}," for each in values)
    text = ", ".join(map(digits, np.ravel(values)))
    return textwrap.indent(textwrap.fill(text, 92), "    ")


def comment_text(line: str) -> str:
    """ASCII text that cannot end a comment, not by a trigraph or a line splice either."""
    return re.sub(r"[*?\\]|[^ -~]", "_", line)


HEADER = ExportFormat(
    "header",
    "C header with π, λ, β and the friction coefficients",
    "{robot}_identified.h",
    header_text,
    check_header,
)
