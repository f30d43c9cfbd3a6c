"""A C header with the gravity torque g(q) = Y(q, 0, 0) π of the identified robot.

It contains π and calls <robot>_inverse_dynamics at rest, so that a controller compiles it together
with kernels.c of the robot.
"""

import numpy as np

from runtime.errors import ExportError
from runtime.outputs.model_files.engines import compiler
from runtime.outputs.model_files.engines.answer import random_states
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.formats.header import c_header, read_arrays
from runtime.outputs.model_files.model import IdentifiedModel, springs_left_out
from runtime.outputs.model_files.reload_check import (
    TOLERANCE,
    torque_difference,
    unchecked,
    verified,
)


def gravity_text(model: IdentifiedModel) -> str:
    """Header of a function <robot>_gravity(q, tau); numbers have 17 significant digits."""
    lib = model.lib
    name, n = lib.name, lib.n_joints
    kernel = f"{name}_inverse_dynamics"
    without = "Friction, springs and torque curves are" if springs_left_out(lib) else "Friction is"
    note = f"Compile with kernels.c of the robot. {without} not included."
    arguments = f"const double q[{n}], const double dq[{n}], const double ddq[{n}]"
    return c_header(
        f"{name.upper()}_GRAVITY_H",
        (*model.comment("Gravity torque", note), f"joints: {', '.join(lib.joint_names)}"),
        {
            f"{name}_gravity_pi": (
                "pi of all links; kg, kg m, kg m^2 about the link origin",
                model.pi,
            )
        },
        before=(
            *("#ifdef __cplusplus", 'extern "C" {', "#endif"),
            f"void {kernel}({arguments}, const double pi[{model.pi.size}], double tau[{n}]);",
            *("#ifdef __cplusplus", "}", "#endif", ""),
        ),
        after=(
            "/* tau = Y(q, 0, 0) pi; q [rad, m] -> tau [N m, N] */",
            f"static inline void {name}_gravity(const double q[{n}], double tau[{n}])",
            "{",
            f"    const double rest[{n}] = {{0.0}};",
            f"    {kernel}(q, rest, rest, {name}_gravity_pi, tau);",
            *("}", ""),
        ),
    )


def check_gravity(model: IdentifiedModel, text: str) -> str:
    """Compile the header; its π must equal the identified one bit for bit."""
    lib, name = model.lib, f"{model.lib.name}_gravity_pi"
    arrays = read_arrays(text, {name: model.pi})
    if arrays is None:
        return unchecked(compiler.INSTALL)
    q = random_states(lib)[0]
    rest = np.zeros_like(q)
    expected = lib.inverse_dynamics(q, rest, rest, model.pi)
    difference = torque_difference(lib.regressor(q, rest, rest) @ arrays[name], expected)
    if not difference <= TOLERANCE:
        raise ExportError(
            f"not written: the gravity torques differ by {difference:.1e} of the largest torque, "
            f"where {TOLERANCE:g} is allowed; run: python -m symgen build"
        )
    return verified("a C compiler", difference)


GRAVITY = ExportFormat(
    "gravity",
    "C header with a function of the gravity torque g(q)",
    "{robot}_gravity.h",
    gravity_text,
    check_gravity,
)
