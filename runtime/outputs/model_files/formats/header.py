"""A C header with the identified parameters, for programs that use the robot's generated C.

The arrays are arguments of functions such as
<robot>_torque_base(q, dq, ddq, <robot>_identified_beta, tau). Another header has the gravity torque
g(q) = Y(q, 0, 0) π: it contains π and calls <robot>_inverse_dynamics at rest, so that a controller
compiles it together with kernels.c of the robot. A C compiler reads a header again, with a program
that prints its arrays in hexadecimal.
"""

import re
import subprocess
import tempfile
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from runtime.common.compiler import find_compiler, run
from runtime.errors import CompilerError, ExportError
from runtime.library import Array
from runtime.library.parameters import PI_NAMES
from runtime.outputs.model_files.engines.answer import Unreadable, random_states
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.model import IdentifiedModel, springs_left_out
from runtime.outputs.model_files.reload_check import REMEDY, require_torques, unchecked, verified
from runtime.outputs.model_files.urdf_tree import digits

INSTALL = "install a C compiler, or name one in CC"
SECONDS = 60  # time limit of the program that prints the arrays [s]


def read_back(text: str, names: Mapping[str, tuple[int, ...]]) -> dict[str, Array] | None:
    """Read the arrays of a header; None where no compiler is installed."""
    loops = "".join(
        f"    for (i = 0; i < {int(np.prod(shape))}; ++i)"
        f' printf("%a\\n", ((const double *){name})[i]);\n'
        for name, shape in names.items()
    )
    program = (
        f"{text}\n#include <stdio.h>\nint main(void)\n{{\n    int i;\n{loops}    return 0;\n}}\n"
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "main.c").write_text(program, encoding="utf-8")
        try:
            compiler = find_compiler()
        except CompilerError:
            return None
        try:
            run((*compiler, "-std=c99", "-Wall", "-Werror", "main.c", "-o", "main"), folder)
            printed = subprocess.run(
                [folder / "main"], capture_output=True, text=True, check=True, timeout=SECONDS
            )
        except (CompilerError, OSError, subprocess.SubprocessError) as error:
            raise Unreadable(error) from None
    values = iter(float.fromhex(line) for line in printed.stdout.splitlines())
    return {
        name: np.array([next(values) for _ in range(int(np.prod(shape)))]).reshape(shape)
        for name, shape in names.items()
    }


def header_arrays(model: IdentifiedModel) -> dict[str, Array]:
    """π (10 n,), λ (10 n,), β (b,) and, where known, φ (n, k), by the suffix of their C name."""
    lib = model.lib
    arrays = {"pi": model.pi, "lam": lib.lam_from_pi(model.pi), "beta": lib.base_matrix @ model.pi}
    if model.friction.values is not None:
        arrays["friction"] = model.friction.values
    return arrays


def header_text(model: IdentifiedModel) -> str:
    """Header of static const double arrays with 17 significant digits."""
    lib, friction = model.lib, model.friction
    name = f"{lib.name}_identified"
    meaning = {
        "pi": f"per link: {', '.join(PI_NAMES)}; kg, kg m, kg m^2 about the link origin",
        "lam": "per link: ln m, centre of mass, rotation vector, a, b, c",
        "beta": "base parameters, K pi",
        "friction": f"per joint: {', '.join(friction.terms.columns)}; N m per unit of the column",
    }
    comment = (
        *model.comment("Parameters"),
        "The parameters of a link include all bodies that are fixed to it.",
        f"joints: {', '.join(lib.joint_names)}",
        f"links: {', '.join(lib.link_names)}",
    )
    arrays = {f"{name}_{key}": (meaning[key], each) for key, each in header_arrays(model).items()}
    return c_header(f"{name.upper()}_H", comment, arrays)


def c_header(
    guard: str,
    comment: Iterable[str],
    arrays: Mapping[str, tuple[str, Array]],
    before: Sequence[str] = (),
    after: Sequence[str] = (),
) -> str:
    """A header with static const double arrays: C name → meaning and values."""
    lines = [f"#ifndef {guard}", f"#define {guard}", "", "/*"]
    lines += [*(f" * {comment_text(line)}" for line in comment), " */", "", *before]
    for name, (meaning, values) in arrays.items():
        shape = "".join(f"[{size}]" for size in values.shape)
        lines += [f"/* {comment_text(meaning)} */", f"static const double {name}{shape} = {{"]
        lines += [array_rows(values), "};", ""]
    return "\n".join([*lines, *after, f"#endif /* {guard} */", ""])


def read_arrays(text: str, arrays: Mapping[str, Array], what: str = "") -> dict[str, Array] | None:
    """The arrays as a C compiler reads them, equal bit for bit; None without a compiler."""
    read = read_back(text, {name: each.shape for name, each in arrays.items()})
    if read is None:
        return None
    for name, each in arrays.items():
        if not np.array_equal(read[name], each):
            raise ExportError(
                f"not written: expected the identified {what or name.rsplit('_', 1)[1]} in the "
                "header, and a C compiler reads other numbers; report this as a fault of symgen"
            )
    return read


def check_header(model: IdentifiedModel, text: str) -> str:
    """Compile a header; its arrays must equal the identified ones bit for bit."""
    lib, expected = model.lib, header_arrays(model)
    names = {f"{lib.name}_identified_{key}": array for key, array in expected.items()}
    arrays = read_arrays(text, names)
    if arrays is None:
        return unchecked(INSTALL)
    read = dict(zip(expected, arrays.values(), strict=True))
    q, dq, ddq = random_states(lib)
    tau_expected = lib.inverse_dynamics(q, dq, ddq, model.pi)
    torques = {
        "pi": lib.inverse_dynamics(q, dq, ddq, read["pi"]),
        "lam": lib.torque(q, dq, ddq, read["lam"]),
        "beta": lib.base_regressor(q, dq, ddq) @ read["beta"],
    }
    differences = (
        require_torques(tau, tau_expected, f"the torques of {key} differ", REMEDY)
        for key, tau in torques.items()
    )
    return verified("a C compiler", max(differences))


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
        return unchecked(INSTALL)
    q = random_states(lib)[0]
    rest = np.zeros_like(q)
    expected = lib.inverse_dynamics(q, rest, rest, model.pi)
    tau = lib.regressor(q, rest, rest) @ arrays[name]
    difference = require_torques(tau, expected, "the gravity torques differ", REMEDY)
    return verified("a C compiler", difference)


GRAVITY = ExportFormat(
    "gravity",
    "C header with a function of the gravity torque g(q)",
    "{robot}_gravity.h",
    gravity_text,
    check_gravity,
)
