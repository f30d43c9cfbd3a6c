"""Kernels → one CUDA header: one thread per sample, arrays of entries, both precisions.

A body is a template over the type T of its numbers and over what it reads from, since inputs that
all samples share are read where they lie and the others from registers.

Loss and gradient of many parameter vectors β on the same samples, r = √W (Y_b β − τ):

    L(β) = r'r / 2      ∂L/∂β = (√W Y_b)' r

One thread per sample writes the nonzeros of √W Y_b and √W τ once. Then one thread per β keeps β and
gradient in registers, and its block reads the rows through shared memory: two multiply-adds per
nonzero, and no traffic but the β and their gradients.
"""

import re
from typing import Any

from symgen.emit.forms import Forms, Kernels
from symgen.emit.sample import Numbers, c_body
from symgen.kernel import Kernel

SHIPPED = (
    *("base_parameters", "base_adjoint", "base_inverse_dynamics", "inverse_dynamics"),
    *("mass_matrix", "bias_forces", "forward_dynamics", "end_effector", "base_regressor"),
    *("loss_gradient", "torque_derivatives"),
)
"""Kernels of the header, called functions before their callers."""
NUMBERS = Numbers("T", "T({})", turn="symgen_turn")
SHARED_MEMORY = 24576
"""Bytes of rows that a block keeps in shared memory, half of what every device has."""
WHOLE = 16
"""Rows are padded to as many bytes: four numbers in single precision load as one."""


def cuda_context(name: str, kernels: tuple[Kernel, ...], forms: Forms) -> dict[str, Any]:
    """Values for the template of the header."""
    by_name = {kernel.name: kernel for kernel in kernels}
    shipped = [by_name[kernel] for kernel in SHIPPED if kernel in by_name]
    bodies = {kernel.name: _body(name, kernel, by_name, forms) for kernel in shipped}
    rows = _rows(by_name["base_regressor"], bodies["base_regressor"])
    return {"cuda": shipped, "bodies": bodies, "rows": rows}


def _body(name: str, kernel: Kernel, kernels: Kernels, forms: Forms) -> list[str]:
    if kernel.through and kernels.keys() >= set(kernel.through):  # calls of other kernels
        return [
            line.replace("static ", "").replace("double ", "T ").replace(f"{name}_", "")
            for line in forms.bodies[kernel.name]
        ]
    return c_body(kernel, NUMBERS)


def _rows(regressor: Kernel, body: list[str]) -> dict[str, Any]:
    """Nonzeros of the base regressor, joint by joint, and the statements that fill them."""
    (output,) = regressor.outputs
    joints, columns = output.shape
    stores = {int(m[1]): m[2] for line in body if (m := _STORE.fullmatch(line))}
    zero = NUMBERS.constant(0.0)
    filled = sorted(k for k, value in stores.items() if value != zero)
    place = {entry: k for k, entry in enumerate(filled)}
    lines = []
    for line in body:
        store = _STORE.fullmatch(line)
        if store is None:
            lines.append(line)
        elif (entry := int(store[1])) in place:
            lines.append(f"row[{place[entry]}] = root[{entry // columns}] * ({store[2]});")
    of_joint = [[e for e in filled if e // columns == joint] for joint in range(joints)]
    length = len(filled) + joints
    padded = -(-length // (WHOLE // 4)) * (WHOLE // 4)
    return {
        "lines": lines,
        "joints": [[(place[e], e % columns) for e in entries] for entries in of_joint],
        "filled": len(filled),
        "columns": columns,
        "padded": padded,
        "tile": max(SHARED_MEMORY // (8 * padded), 0),
    }


_STORE = re.compile(r"Y_b\[(\d+)\] = (.*);")
